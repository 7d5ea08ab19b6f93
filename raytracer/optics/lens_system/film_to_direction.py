"""Directions that places of the film see through a lens, and places of the film that see directions."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import generic
from raytracer.optics.glass import LINE_D
from raytracer.optics.lens_system.lens_setup import LensSetup
from raytracer.optics.lens_system.pupils.search import pupil_center
from raytracer.optics.lens_system.pupils.tables import QuadrantPupilTable
from raytracer.optics.lens_system.pupils.transmission import exit_pupil_plane
from raytracer.optics.lens_system.ray_tracing import trace_rays
from raytracer.optics.sensor_formats import SensorSize

# Iterations that find the place of the film that sees a direction.
_ROUNDS = 16


def trace_film_rays(
    setting: LensSetup, places: NDArray[np.float64], targets: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Trace rays from places of the film (n, 2) through points of the plane of the pupils (n, 2), at the d line.

    Returns
    -------
    Points (mm) from the middle of the entrance pupil, and directions, as right, up, forward: (n, 3); NaN where lost.
    """
    plane = exit_pupil_plane(setting.surfaces, setting.film)
    starts = np.column_stack([places, np.full(len(places), setting.film)])
    ways = np.column_stack([targets, np.full(len(places), plane)]) - starts
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    weights, points, onward = trace_rays(setting.surfaces, starts, ways, False)
    points[:, 2] -= setting.thin.pupil
    for rows in (points, onward):
        rows[:, 2] *= -1.0
        rows[weights == 0.0] = np.nan
    return points, onward


def _film_to_direction(
    setting: LensSetup, places: NDArray[np.float64], targets: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Find the directions (n, 3), from the middle of the entrance pupil, of such rays at the distance of focus."""
    points, ways = trace_film_rays(setting, places, targets)
    distance = setting.thin.focus_distance
    if math.isinf(distance):
        return ways
    along = (points * ways).sum(axis=1)
    way = -along + np.sqrt(along**2 - (points**2).sum(axis=1) + distance**2)
    return np.asarray(points + way[:, None] * ways)


def fields_of_view(setting: LensSetup, film: SensorSize) -> dict[str, float]:
    """Compute the fields of view (deg) between opposite edges and corners by rays, if the lens reaches these."""
    angles = {}
    for name, x, y in (("v", 0.0, 0.5), ("h", 0.5, 0.0), ("d", 0.5, 0.5)):
        place = (x * film.width, y * film.height)
        target = pupil_center(setting.surfaces, setting.film, *place, LINE_D)
        if target is not None:
            ((right, up, forward),) = _film_to_direction(setting, np.array([place]), target[None])
            angles[f"{name}fov_deg"] = 2.0 * math.degrees(math.atan2(math.hypot(right, up), forward))
    return angles


class RadialViewTable(NamedTuple):
    """Packed table of a lens that is symmetric about its axis: radius on the film by angle.

    radius (mm) : float64 (n,), of evenly spaced angles from 0 on.
    per_radian (1/rad) : places of the table per angle.
    """

    radius: NDArray[np.float64]
    per_radian: float


class QuadrantViewTable(NamedTuple):
    """Packed table of a lens that is symmetric about two planes: directions of places of a quadrant of the film.

    slopes : float64 (n, m, 2), by |y| and |x| on the film: tangents to the side and up.
    step_x, step_y (mm) : of the table.
    image_x, image_y (mm) : distance on the film per slope, near the axis.
    """

    slopes: NDArray[np.float64]
    step_x: float
    step_y: float
    image_x: float
    image_y: float


_ANGLES = 1025


def build_view_table(setting: LensSetup, pupils: Any) -> RadialViewTable | QuadrantViewTable:
    """Build the table that `direction_to_film` looks up, from the middles of the pupils."""
    ellipses = pupils.ellipses
    if isinstance(pupils, QuadrantPupilTable):
        rows, columns = ellipses.shape[:2]
        places = np.stack(np.meshgrid(np.arange(columns) / pupils.per_mm_x, np.arange(rows) / pupils.per_mm_y), axis=-1)
        directions = _film_to_direction(setting, places.reshape(-1, 2), ellipses[..., :2].reshape(-1, 2)).reshape(
            rows, columns, 3
        )
        slopes = -directions[..., :2] / directions[..., 2:]
        step_x, step_y = 1.0 / pupils.per_mm_x, 1.0 / pupils.per_mm_y
        image_x, image_y = step_x / float(slopes[0, 1, 0]), step_y / float(slopes[1, 0, 1])
        return QuadrantViewTable(np.ascontiguousarray(slopes), step_x, step_y, image_x, image_y)
    from scipy.interpolate import PchipInterpolator

    radii = np.arange(len(ellipses)) / pupils.per_mm
    targets = np.column_stack([ellipses[:, 0], np.zeros(len(ellipses))])
    directions = _film_to_direction(setting, np.column_stack([radii, np.zeros(len(radii))]), targets)
    angles = np.arctan2(-directions[:, 0], directions[:, 2])
    angles[0] = 0.0
    # Up to where the lens shows nothing, or the same again.
    odd = np.flatnonzero(~(np.diff(angles) > 0.0))
    count = int(odd[0]) + 1 if len(odd) else len(angles)
    if count < 2:
        return RadialViewTable(np.zeros(2), 1.0)
    even = np.linspace(0.0, angles[count - 1], _ANGLES)
    return RadialViewTable(
        np.ascontiguousarray(PchipInterpolator(angles[:count], radii[:count])(even)), (_ANGLES - 1) / float(even[-1])
    )


@generic
def direction_to_film(view, right, up, forward):
    """Find the place of the film (mm, upright) that sees a direction; NaN if there is none."""


@direction_to_film.register(RadialViewTable)
def direction_to_film_radial_view_table(view, right, up, forward):
    across = math.hypot(right, up)
    place = math.atan2(across, forward) * view.per_radian
    if not place <= len(view.radius) - 1.0:
        return math.nan, math.nan
    if across == 0.0:
        return 0.0, 0.0
    row = min(int(place), len(view.radius) - 2)
    part = place - row
    radius = view.radius[row] + part * (view.radius[row + 1] - view.radius[row])
    return radius * right / across, radius * up / across


@direction_to_film.register(QuadrantViewTable)
def direction_to_film_quadrant_view_table(view, right, up, forward):
    if forward <= 0.0:
        return math.nan, math.nan
    rows, columns = view.slopes.shape[0], view.slopes.shape[1]
    wanted_x, wanted_y = abs(right / forward), abs(up / forward)
    x, y = wanted_x * view.image_x, wanted_y * view.image_y
    # Newton's method with the slope at the middle of the film: distortion is small beside that.
    for _round in range(_ROUNDS):
        across, above = x / view.step_x, y / view.step_y
        column, row = max(0, min(int(across), columns - 2)), max(0, min(int(above), rows - 2))
        u, v = across - column, above - row
        a, b = view.slopes[row, column], view.slopes[row, column + 1]
        c, d = view.slopes[row + 1, column], view.slopes[row + 1, column + 1]
        slope_x = (1.0 - v) * ((1.0 - u) * a[0] + u * b[0]) + v * ((1.0 - u) * c[0] + u * d[0])
        slope_y = (1.0 - v) * ((1.0 - u) * a[1] + u * b[1]) + v * ((1.0 - u) * c[1] + u * d[1])
        x += view.image_x * (wanted_x - slope_x)
        y += view.image_y * (wanted_y - slope_y)
    if not (0.0 <= x <= (columns - 1) * view.step_x and 0.0 <= y <= (rows - 1) * view.step_y):
        return math.nan, math.nan
    return math.copysign(x, right), math.copysign(y, up)
