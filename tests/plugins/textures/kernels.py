"""Compiled loops over textures."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raytracer.core.compiler.dispatch import entry
from raytracer.core.geometry import Site
from raytracer.film.formats.base.image_format import StoredImage
from raytracer.plugins.textures.base.interface import TextureSpec, texture, texture_gradient
from raytracer.schema.registry import TEXTURES


@entry
def _look_up(table, index, points, uv, out):
    for i in range(len(points)):
        r, g, b = texture(table, index, Site((points[i, 0], points[i, 1], points[i, 2]), uv[i, 0], uv[i, 1], 0.0))
        out[i, 0], out[i, 1], out[i, 2] = r, g, b


@entry
def _slopes(table, index, points, uv, tangent, bitangent, out):
    for i in range(len(points)):
        site = Site((points[i, 0], points[i, 1], points[i, 2]), uv[i, 0], uv[i, 1], 0.0)
        out[i, 0], out[i, 1] = texture_gradient(table, index, site, tangent, bitangent)


def spec_of(kind: str, **parameters: Any) -> TextureSpec:
    """A checked texture."""
    return TEXTURES.specs()[kind].model_validate({"type": kind, **parameters})


def picture(texels: ArrayLike, *, integer: bool = True) -> Mapping[str, StoredImage]:
    """An image as a texture is handed it: bytes if `integer`, or float32."""
    array = np.asarray(texels, np.uint8 if integer else np.float32)
    return {"file": StoredImage(array[..., None] if array.ndim == 2 else array, integer)}


def table_of(*specs: TextureSpec, files: Mapping[str, Any] | None = None) -> Any:
    """The packed table of textures of one group."""
    return type(specs[0]).pack(list(specs), [files or {}] * len(specs))


def looked_up(
    table: Any, *, points: ArrayLike | None = None, uv: ArrayLike | None = None, index: int = 0
) -> NDArray[np.float64]:
    """Colours (n, 3) at points (n, 3) or at parameters (n, 2)."""
    count = len(np.atleast_2d(np.asarray(uv if points is None else points)))
    at = np.zeros((count, 3)) if points is None else np.atleast_2d(np.asarray(points, np.float64))
    parameters = np.zeros((count, 2)) if uv is None else np.atleast_2d(np.asarray(uv, np.float64))
    out = np.empty((count, 3))
    _look_up(table, index, np.ascontiguousarray(at), np.ascontiguousarray(parameters), out)
    return out


def slopes(
    table: Any,
    *,
    points: ArrayLike | None = None,
    uv: ArrayLike | None = None,
    tangent: tuple[float, float, float] = (1.0, 0.0, 0.0),
    bitangent: tuple[float, float, float] = (0.0, 1.0, 0.0),
) -> NDArray[np.float64]:
    """Slopes (n, 2) along u and v."""
    count = len(np.atleast_2d(np.asarray(uv if points is None else points)))
    at = np.zeros((count, 3)) if points is None else np.atleast_2d(np.asarray(points, np.float64))
    parameters = np.zeros((count, 2)) if uv is None else np.atleast_2d(np.asarray(uv, np.float64))
    out = np.empty((count, 2))
    _slopes(table, 0, np.ascontiguousarray(at), np.ascontiguousarray(parameters), tangent, bitangent, out)
    return out
