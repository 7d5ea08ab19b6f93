"""Packed tables of pupils, and the kernels that sample points of them."""

import math
from functools import singledispatch
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import generic

Points = NDArray[np.float64]


class RadialPupilTable(NamedTuple):
    """Packed pupils of a lens that is symmetric about its axis: an ellipse for each radius on the film.

    ellipses (mm) : float64 (n, 3), the middle, along the direction from the axis to the place on the film, the half
        axis along that, and the one across.
    per_mm (1/mm) : places of the table per radius.
    edge (mm) : radius from which on no light arrives.
    """

    ellipses: Points
    per_mm: float
    edge: float


class QuadrantPupilTable(NamedTuple):
    """Packed pupils of a lens that is symmetric about two planes: an ellipse for each place of a quadrant.

    ellipses (mm) : float64 (n, m, 4), by |y| and |x| on the film: the middle (x, y), on the side of the place, and the
        half axes along x and y.
    per_mm_x, per_mm_y (1/mm) : places of the table per distance.
    """

    ellipses: Points
    per_mm_x: float
    per_mm_y: float


@singledispatch
def pupil_extent(pupils: Any, along: float) -> float:
    """Find the greatest distance from the axis (mm) at which light to the film crosses a plane before it.

    along : distance of that plane from the film, over that of the plane of the pupils.
    """
    raise NotImplementedError(type(pupils))


@pupil_extent.register
def pupil_extent_radial_pupil_table(pupils: RadialPupilTable, along: float) -> float:
    radius = np.arange(len(pupils.ellipses)) / pupils.per_mm
    middle, *halves = pupils.ellipses.T
    extent = np.abs(radius + along * (middle - radius)) + along * np.maximum(*halves)
    return float(extent[radius < pupils.edge].max())


@pupil_extent.register
def pupil_extent_quadrant_pupil_table(pupils: QuadrantPupilTable, along: float) -> float:
    up, across = (np.arange(size) for size in pupils.ellipses.shape[:2])
    places = np.stack(np.meshgrid(across / pupils.per_mm_x, up / pupils.per_mm_y), axis=-1)
    middle, halves = pupils.ellipses[..., :2], pupils.ellipses[..., 2:]
    extent = np.linalg.norm(places + along * (middle - places), axis=-1) + along * halves.max(axis=-1)
    return float(extent[(halves > 0.0).all(axis=-1)].max())


@generic
def sample_exit_pupil(pupils, x, y, u, v):
    """Sample a point of the plane that rays aim at for a place (x, y) of the film, by a point (u, v) of the unit disc.

    Returns
    -------
    (x, y, area of the ellipse that points are drawn from); the area is 0 where no light arrives.  mm and mm2.
    """


@sample_exit_pupil.register(RadialPupilTable)
def sample_exit_pupil_radial_pupil_table(pupils, x, y, u, v):
    radius = math.sqrt(x * x + y * y)
    place = radius * pupils.per_mm
    # Beyond the table nothing is known.
    if not (radius < pupils.edge and place <= len(pupils.ellipses) - 1.0):
        return x, y, 0.0
    row = min(int(place), len(pupils.ellipses) - 2)
    part = place - row
    rest = 1.0 - part
    middle = rest * pupils.ellipses[row, 0] + part * pupils.ellipses[row + 1, 0]
    along = rest * pupils.ellipses[row, 1] + part * pupils.ellipses[row + 1, 1]
    across = rest * pupils.ellipses[row, 2] + part * pupils.ellipses[row + 1, 2]
    # On the axis all directions are alike.
    cosine, sine = (x / radius, y / radius) if radius > 0.0 else (1.0, 0.0)
    # The disc keeps its own directions as far as it can, so that well spread points stay so from place to place.
    a, b = middle + along * (cosine * u + sine * v), across * (cosine * v - sine * u)
    return cosine * a - sine * b, sine * a + cosine * b, math.pi * along * across


@sample_exit_pupil.register(QuadrantPupilTable)
def sample_exit_pupil_quadrant_pupil_table(pupils, x, y, u, v):
    across, up = abs(x) * pupils.per_mm_x, abs(y) * pupils.per_mm_y
    rows, columns = pupils.ellipses.shape[0], pupils.ellipses.shape[1]
    if not (across <= columns - 1.0 and up <= rows - 1.0):
        return x, y, 0.0
    column, row = min(int(across), columns - 2), min(int(up), rows - 2)
    right, above = across - column, up - row
    left, below = 1.0 - right, 1.0 - above
    w00, w01, w10, w11 = below * left, below * right, above * left, above * right
    e00, e01 = pupils.ellipses[row, column], pupils.ellipses[row, column + 1]
    e10, e11 = pupils.ellipses[row + 1, column], pupils.ellipses[row + 1, column + 1]
    middle_x = w00 * e00[0] + w01 * e01[0] + w10 * e10[0] + w11 * e11[0]
    middle_y = w00 * e00[1] + w01 * e01[1] + w10 * e10[1] + w11 * e11[1]
    half_x = w00 * e00[2] + w01 * e01[2] + w10 * e10[2] + w11 * e11[2]
    half_y = w00 * e00[3] + w01 * e01[3] + w10 * e10[3] + w11 * e11[3]
    a = math.copysign(1.0, x) * middle_x + half_x * u
    b = math.copysign(1.0, y) * middle_y + half_y * v
    return a, b, math.pi * half_x * half_y
