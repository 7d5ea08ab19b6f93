"""A material's functions for rows of directions."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.geometry import Site
from raytracer.core.vec import Vec3
from raytracer.plugins.materials.base.interface import emission, evaluate, row, scatter
from raytracer.plugins.textures.base.interface import ParameterPacker
from raytracer.schema.spec import Spec
from tests.vectorised import random_draws, rows, vectorised

Array = NDArray[np.float64]
UP = (0.0, 0.0, 1.0)
SITE = Site((0.1, 0.2, 0.3), 0.25, 0.75, 1.5)


def packed_row(spec: Spec, site: Site = SITE):
    """The record that the kernels take for one material, at a site."""
    return row(type(spec).pack([spec], ParameterPacker()), 0, None, site)


def incoming(degrees: float, azimuth: float = 0.4) -> Vec3:
    """Unit direction of travel onto a surface with normal +z, `degrees` from the normal."""
    theta = math.radians(degrees)
    return (math.sin(theta) * math.cos(azimuth), math.sin(theta) * math.sin(azimuth), -math.cos(theta))


def scatter_many(
    spec: Spec, direction: Vec3, count: int, *, front: bool = True, seed: int = 5, normal: Vec3 = UP
) -> tuple[Array, Array, Array]:
    """Directions (count, 3), weights (count, 3) and pdfs (count,) of `scatter`."""
    return scatter_row(packed_row(spec), direction, count, front=front, seed=seed, normal=normal)


def scatter_row(
    material: NamedTuple, direction: Vec3, count: int, *, front: bool = True, seed: int = 5, normal: Vec3 = UP
) -> tuple[Array, Array, Array]:
    """Scatter from a row as `scatter_many` does."""
    out = vectorised(scatter)(material, direction, normal, front, random_draws(count, seed=seed))
    return out.direction, out.weight, out.pdf


def evaluate_many(
    spec: Spec, direction: Any, outgoing: Array, *, front: Any = True, normal: Any = UP
) -> tuple[Any, Any]:
    """f |cos| (n, 3) and pdf (n,) of `evaluate` toward directions (n, 3); the rest may be one for all, or (n,)."""
    return evaluate_row(packed_row(spec), direction, outgoing, front=front, normal=normal)


def evaluate_row(
    material: NamedTuple, direction: Any, outgoing: Array, *, front: Any = True, normal: Any = UP
) -> tuple[Any, Any]:
    """Evaluate a row as `evaluate_many` does."""
    arriving, normals = (rows(np.broadcast_to(vectors, np.shape(outgoing))) for vectors in (direction, normal))
    sides = rows(np.broadcast_to(front, len(outgoing)))
    return vectorised(evaluate)(material, arriving, normals, sides, rows(outgoing))


def emitted(spec: Spec, front: bool) -> Vec3:
    """`emission`."""
    return emission(type(spec).pack([spec], ParameterPacker()), 0, front, None, SITE)


def mirrored(direction: Vec3) -> Array:
    """`direction` reflected at a surface with normal +z."""
    return np.array([direction[0], direction[1], -direction[2]])


def frame(axis: Array) -> Array:
    """Orthonormal rows (3, 3) of which the last is the unit vector `axis`."""
    helper = np.eye(3)[np.argmin(np.abs(axis))]
    s = np.cross(helper, axis)
    s /= np.linalg.norm(s)
    return np.array([s, np.cross(axis, s), axis])
