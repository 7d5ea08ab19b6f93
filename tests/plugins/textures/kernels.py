"""Textures, and what they are at rows of points or parameters."""

import numpy as np

from raytracer.core.geometry import Site
from raytracer.film.formats.base.image_format import StoredImage
from raytracer.plugins.textures.base.interface import texture, texture_gradient
from raytracer.schema.registry import TEXTURES
from tests.vectorised import rows, vectorised


def spec_of(kind, **parameters):
    """A checked texture."""
    return TEXTURES.specs()[kind].model_validate({"type": kind, **parameters})


def picture(texels, *, integer=True):
    """An image as a texture is handed it: bytes if `integer`, or float32."""
    array = np.asarray(texels, np.uint8 if integer else np.float32)
    return {"file": StoredImage(array[..., None] if array.ndim == 2 else array, integer)}


def table_of(*specs, files=None):
    """The packed table of textures of one group."""
    return type(specs[0]).pack(list(specs), [files or {}] * len(specs))


def _sites(points, uv):
    count = len(np.atleast_2d(np.asarray(uv if points is None else points)))
    at = np.zeros((count, 3)) if points is None else np.atleast_2d(np.asarray(points, np.float64))
    parameters = np.zeros((count, 2)) if uv is None else np.atleast_2d(np.asarray(uv, np.float64))
    return Site(rows(at), *map(rows, parameters.T), 0.0)


def looked_up(table, *, points=None, uv=None, index=0):
    """Colours (n, 3) at points (n, 3) or at parameters (n, 2)."""
    return vectorised(texture)(table, index, _sites(points, uv))


def slopes(table, *, points=None, uv=None, tangent=(1.0, 0.0, 0.0), bitangent=(0.0, 1.0, 0.0)):
    """Slopes (n, 2) along u and v."""
    return vectorised(texture_gradient)(table, 0, _sites(points, uv), tangent, bitangent)
