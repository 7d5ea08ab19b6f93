"""Where a lens sees to: directions of places of the film, and places of directions."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.glass import LINE_D
from raytracer.jit import generic
from raytracer.lenses.pupils import SquarePupils, aiming_plane, middle
from raytracer.lenses.setting import Setting
from raytracer.lenses.surfaces import trace_rays
from raytracer.sensors import Size

# Steps by which a place of the film is found that sees a direction.
_ROUNDS = 16


def traced(
    setting: Setting, places: NDArray[np.float64], targets: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rays from places of the film (n, 2) through points of the plane that is aimed at (n, 2), at the d line.

    Returns
    -------
    Points (mm) from the middle of the entrance pupil, and directions, as right, up, forward: (n, 3); NaN where lost.
    """
    plane = aiming_plane(setting.surfaces, setting.film)
    starts = np.column_stack([places, np.full(len(places), setting.film)])
    ways = np.column_stack([targets, np.full(len(places), plane)]) - starts
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    weights, points, onward = trace_rays(setting.surfaces, starts, ways, False)
    points[:, 2] -= setting.thin.pupil
    for rows in (points, onward):
        rows[:, 2] *= -1.0
        rows[weights == 0.0] = np.nan
    return points, onward


def _sights(setting: Setting, places: NDArray[np.float64], targets: NDArray[np.float64]) -> NDArray[np.float64]:
    """Directions (n, 3) from the middle of the entrance pupil in which such rays are at the distance of focus."""
    points, ways = traced(setting, places, targets)
    distance = setting.thin.focus_distance
    if math.isinf(distance):
        return ways
    along = (points * ways).sum(axis=1)
    way = -along + np.sqrt(along**2 - (points**2).sum(axis=1) + distance**2)
    return np.asarray(points + way[:, None] * ways)


def angles_of(setting: Setting, film: Size) -> dict[str, float]:
    """Fields of view (deg) between opposite edges and corners, by rays, as far as the lens reaches these."""
    found = {}
    for name, x, y in (("v", 0.0, 0.5), ("h", 0.5, 0.0), ("d", 0.5, 0.5)):
        place = (x * film.width, y * film.height)
        target = middle(setting.surfaces, setting.film, *place, LINE_D)
        if target is not None:
            ((right, up, forward),) = _sights(setting, np.array([place]), target[None])
            found[f"{name}fov_deg"] = 2.0 * math.degrees(math.atan2(math.hypot(right, up), forward))
    return found


class RoundView(NamedTuple):
    """Packed, of a lens that is alike all around its axis: how far from the axis an angle is seen.

    radius (n,) float64, on the film (mm), of evenly spaced angles from 0 on; per_radian, how many a radian has.
    """

    radius: NDArray[np.float64]
    per_radian: float


class SquareView(NamedTuple):
    """Packed, of any other: in which direction each place of a quadrant of the film sees.

    slopes (n, m, 2) float64, by |y| and |x| on the film: how far to the side and up a metre ahead; step_x and step_y,
    of the table (mm); image_x and image_y, how large a slope is on the film, near the axis (mm).
    """

    slopes: NDArray[np.float64]
    step_x: float
    step_y: float
    image_x: float
    image_y: float


_ANGLES = 1025


def view_of(setting: Setting, pupils: Any) -> RoundView | SquareView:
    """What `project` needs, from where the pupil is."""
    ellipses = pupils.ellipses
    if isinstance(pupils, SquarePupils):
        rows, columns = ellipses.shape[:2]
        places = np.stack(np.meshgrid(np.arange(columns) / pupils.per_mm_x, np.arange(rows) / pupils.per_mm_y), axis=-1)
        sights = _sights(setting, places.reshape(-1, 2), ellipses[..., :2].reshape(-1, 2)).reshape(rows, columns, 3)
        slopes = -sights[..., :2] / sights[..., 2:]
        step_x, step_y = 1.0 / pupils.per_mm_x, 1.0 / pupils.per_mm_y
        image_x, image_y = step_x / float(slopes[0, 1, 0]), step_y / float(slopes[1, 0, 1])
        return SquareView(np.ascontiguousarray(slopes), step_x, step_y, image_x, image_y)
    from scipy.interpolate import PchipInterpolator

    radii = np.arange(len(ellipses)) / pupils.per_mm
    targets = np.column_stack([ellipses[:, 0], np.zeros(len(ellipses))])
    sights = _sights(setting, np.column_stack([radii, np.zeros(len(radii))]), targets)
    angles = np.arctan2(-sights[:, 0], sights[:, 2])
    angles[0] = 0.0
    # Up to where the lens shows nothing, or the same again.
    odd = np.flatnonzero(~(np.diff(angles) > 0.0))
    count = int(odd[0]) + 1 if len(odd) else len(angles)
    if count < 2:
        return RoundView(np.zeros(2), 1.0)
    even = np.linspace(0.0, angles[count - 1], _ANGLES)
    return RoundView(
        np.ascontiguousarray(PchipInterpolator(angles[:count], radii[:count])(even)), (_ANGLES - 1) / float(even[-1])
    )


@generic
def seen_at(view, right, up, forward):
    """Where on the film (mm, upright) a direction is seen; NaN if nowhere."""
    raise NotImplementedError


@seen_at.register(RoundView)
def _(view, right, up, forward):
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


@seen_at.register(SquareView)
def _(view, right, up, forward):
    if forward <= 0.0:
        return math.nan, math.nan
    rows, columns = view.slopes.shape[0], view.slopes.shape[1]
    wanted_x, wanted_y = abs(right / forward), abs(up / forward)
    x, y = wanted_x * view.image_x, wanted_y * view.image_y
    # Go by what the middle of the film would need, again and again: distortion is little beside that.
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
