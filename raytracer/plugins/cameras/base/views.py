"""Many views of one scene in one picture: what camera arrays and light slabs share."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.cameras.interface import Defocus, camera_ray, defocus_of, film_corner, place_in_view, project
from raytracer.cameras.perspective import (
    ImagePlane,
    PerspectiveCamera,
    film_direction,
    lens_ray,
    place_on_film,
)
from raytracer.cameras.placement import Frame, in_frame
from raytracer.jit import kernel
from raytracer.plenoptic.focusing import refocusable, spacing
from raytracer.plenoptic.mosaic import Mosaic
from raytracer.plenoptic.views import Plane, Pose, Views
from raytracer.vec import add, madd, scale

MOST_VIEWS = 1024
"""Views in a row, or in a column, at most."""


# Beyond views of a few pixels too there is room for any usual filter.
_LEAST_MARGIN = 16


class Grid(NamedTuple):
    """Packed: where views are, and where their films lie.

    left, top, the place of the first view, right and up from the middle (m); across, down, from one to the next (m);
    inverse_convergence, one over the distance at which all see the same at the same place of their films (1/m);
    width, height, of a view (px); stride, from one film to the next (px), and guard, what lies free around each.
    """

    left: float
    top: float
    across: float
    down: float
    inverse_convergence: float
    width: int
    height: int
    stride: int
    guard: int


class ViewsCamera(NamedTuple):
    """Packed: a perspective camera at each place of a grid, its film shifted so that all views converge."""

    frame: Frame
    plane: ImagePlane
    lens: Any
    irradiance: Any
    grid: Grid


def margin(width: int, height: int) -> int:
    """How far beyond a view of width x height pixels its film reaches (px)."""
    return max(width, height, _LEAST_MARGIN)


def spread(
    rows: int, columns: int, spacing: tuple[float, float], width: int, height: int, inverse_convergence: float
) -> Grid:
    """A grid of views of width x height pixels; `spacing` is that to the right and that down (m)."""
    across, down = spacing
    # Strides are powers of two, so that the step back to a view is exact.
    guard = margin(width, height)
    stride = 1 << (max(width, height) + 2 * guard - 1).bit_length()
    left, top = -0.5 * across * (columns - 1), 0.5 * down * (rows - 1)
    return Grid(left, top, across, down, inverse_convergence, width, height, stride, guard)


def many(camera: PerspectiveCamera, grid: Grid) -> ViewsCamera:
    """The camera at each place of a grid."""
    return ViewsCamera(camera.frame, camera.plane, camera.lens, camera.irradiance, grid)


def positions(grid: Grid, rows: int, columns: int) -> NDArray[np.float64]:
    """Places of the views in their plane, right and up from the middle (m): (rows, columns, 2)."""
    right = grid.left + grid.across * np.arange(columns)
    up = grid.top - grid.down * np.arange(rows)
    return np.stack(np.broadcast_arrays(right, up[:, None]), axis=-1)


def mosaic(
    frame: Frame,
    plane: ImagePlane,
    grid: Grid,
    rows: int,
    columns: int,
    cell: tuple[float, float] | None,
    focal_length: float | None = None,
) -> Mosaic:
    """How the picture of a grid of views holds their light field; `cell` and `focal_length` as in `Views`."""
    return Mosaic(
        Views(
            position=positions(grid, rows, columns),
            plane=Plane(*plane),
            width=grid.width,
            height=grid.height,
            inverse_focus=grid.inverse_convergence,
            cell=cell,
            focal_length=focal_length,
            pose=Pose(*frame),
        )
    )


def described(views: Views) -> dict[str, float]:
    """Numbers of a grid of views, by name with unit."""
    steps = spacing(views)
    near, far = refocusable(views)
    numbers = {
        "views": float(views.rows * views.columns),
        "view_columns": float(views.columns),
        "view_rows": float(views.rows),
        "convergence_distance_m": views.focus_distance,
    }
    if views.columns > 1:
        numbers |= {"view_spacing_mm": 1e3 * steps.right, "baseline_mm": 1e3 * steps.right * (views.columns - 1)}
    if views.rows > 1:
        numbers |= {"view_spacing_up_mm": 1e3 * steps.up, "baseline_up_mm": 1e3 * steps.up * (views.rows - 1)}
    if max(steps) > 0.0:
        disparity = views.inverse_focus * max(steps) / views.plane.pixel
        numbers |= {"disparity_at_infinity_px": disparity, "refocus_near_m": near, "refocus_far_m": far}
    return numbers


@film_corner.register(ViewsCamera)
def _(camera, x, y):
    grid = camera.grid
    return x + (x // grid.width) * (grid.stride - grid.width), y + (y // grid.height) * (grid.stride - grid.height)


@kernel
def _number(grid, place):
    """The row or column of the view whose film holds this coordinate of a film position."""
    return math.floor((place + grid.guard) / grid.stride)


@place_in_view.register(ViewsCamera)
def _(camera, x, y):
    grid = camera.grid
    return x - grid.stride * _number(grid, x), y - grid.stride * _number(grid, y)


@camera_ray.register(ViewsCamera)
def _(camera, x, y, time, draws):
    grid, frame = camera.grid, camera.frame
    column, row = _number(grid, x), _number(grid, y)
    right, up = grid.left + grid.across * column, grid.top - grid.down * row
    shift = add(scale(right, frame.right), scale(up, frame.up))

    # What the middle would see at this place of its film, as seen from here where all views converge.
    direction = film_direction(frame, camera.plane, x - grid.stride * column, y - grid.stride * row)
    direction = madd(direction, -grid.inverse_convergence, shift)
    here = Frame(add(frame.origin, shift), frame.right, frame.up, frame.forward)
    return lens_ray(camera.lens, here, camera.irradiance, direction, draws)


@defocus_of.register(ViewsCamera)
def _(camera: Any) -> Defocus:
    found: Defocus = defocus_of(PerspectiveCamera(camera.frame, camera.plane, camera.lens, camera.irradiance))
    return found


@project.register(ViewsCamera)
def _(camera, point, time):
    # As the middle sees it.
    right, up, depth = in_frame(camera.frame, point)
    return place_on_film(camera.plane, right, up, depth)
