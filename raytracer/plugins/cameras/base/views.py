"""Many views of one scene in one picture, for camera arrays, light slabs and rigs of cameras."""

import math
from typing import Any, NamedTuple

import numpy as np

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.vec import add, madd, scale
from raytracer.film.light_field.focusing import refocusable, view_spacing
from raytracer.film.light_field.layout import Mosaic
from raytracer.film.light_field.views import Plane, Pose, Views
from raytracer.optics.sensor_formats import SensorSpec
from raytracer.plugins.cameras.base import interface
from raytracer.plugins.cameras.base.perspective_camera import (
    ImagePlane,
    PerspectiveCamera,
    film_direction,
    lens_ray,
    project_to_film,
    thin_lens_parts,
)
from raytracer.plugins.cameras.base.placement import CameraFrame, to_camera_space
from raytracer.schema.spec import field_error

MAX_VIEWS = 1024
"""Views in a row, or in a column, at most."""

# Beyond views of a few pixels too the film has to reach as far as any usual filter does.
_MIN_MARGIN = 16


def refuse_bayer(sensor: SensorSpec | None) -> None:
    """Refuse a sensor with a Bayer pattern for many views in one picture; `sensor` is None where none is simulated.

    Raises
    ------
    ValidationError : it has one.
    """
    if sensor is not None and sensor.bayer is not None:
        field_error(
            ("sensor", "bayer"),
            "colours are interpolated over the edges of views: the sensors of many cameras have no Bayer pattern",
        )


class ViewFilms(NamedTuple):
    """Films of views, side by side but apart.

    width, height (px) : size of a view.
    stride (px) : step from one view's film to the next.
    guard (px) : film beyond each edge of a view.
    """

    width: int
    height: int
    stride: int
    guard: int


class ViewGrid(NamedTuple):
    """Packed grid of views.

    left, top (m) : place of the first view, right and up from the middle.
    across, down (m) : steps from one view to the next.
    inverse_convergence (1/m) : one over the distance at which all views see the same at the same place of their films.
    width, height, stride, guard (px) : as in `ViewFilms`.
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
    """Packed perspective camera at each place of a grid, its film shifted so that all views converge."""

    frame: CameraFrame
    plane: ImagePlane
    lens: Any
    irradiance: Any
    grid: ViewGrid


def view_margin(width: int, height: int) -> int:
    """Return how many pixels the film reaches beyond a view of width x height pixels."""
    return max(width, height, _MIN_MARGIN)


def make_view_grid(
    rows: int, columns: int, spacing: tuple[float, float], width: int, height: int, inverse_convergence: float
) -> ViewGrid:
    """Make a grid of views of width x height pixels; `spacing` is the step to the right and that down (m)."""
    across, down = spacing
    left, top = -0.5 * across * (columns - 1), 0.5 * down * (rows - 1)
    return ViewGrid(left, top, across, down, inverse_convergence, *make_view_films(width, height))


def make_view_films(width: int, height: int) -> ViewFilms:
    """Lay out the films of views of width x height pixels."""
    # Strides are powers of two, so that the step back to a view is exact.
    guard = view_margin(width, height)
    return ViewFilms(width, height, 1 << (max(width, height) + 2 * guard - 1).bit_length(), guard)


def replicate_camera(camera: PerspectiveCamera, grid: ViewGrid) -> ViewsCamera:
    """Put a camera at each place of a grid."""
    return ViewsCamera(camera.frame, camera.plane, camera.lens, camera.irradiance, grid)


def make_mosaic(
    frame: CameraFrame,
    plane: ImagePlane,
    grid: ViewGrid,
    rows: int,
    columns: int,
    cell: tuple[float, float] | None,
    focal_length: float | None = None,
) -> Mosaic:
    """Make the light-field layout of a picture of a grid of views; `cell` and `focal_length` as in `Views`."""
    right, up = grid.left + grid.across * np.arange(columns), grid.top - grid.down * np.arange(rows)
    return Mosaic(
        Views(
            position=np.stack(np.broadcast_arrays(right, up[:, None]), axis=-1),
            plane=Plane(*plane),
            width=grid.width,
            height=grid.height,
            inverse_focus=grid.inverse_convergence,
            cell=cell,
            focal_length=focal_length,
            pose=Pose(*frame),
        )
    )


def describe_views(views: Views) -> dict[str, float]:
    """Return derived numbers of a grid of views, by name with unit."""
    steps = view_spacing(views)
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


@kernel
def corner_on_films(films, x, y):
    """Return the film position of the top left corner of a pixel of the picture; `films` as in `ViewFilms`."""
    return x + (x // films.width) * (films.stride - films.width), y + (y // films.height) * (
        films.stride - films.height
    )


@kernel
def view_index(films, place):
    """Return the row or column of the view whose film holds this coordinate of a film position."""
    return math.floor((place + films.guard) / films.stride)


@kernel
def place_in_view(films, x, y):
    """Return a film position in pixels from the top left corner of its view."""
    return x - films.stride * view_index(films, x), y - films.stride * view_index(films, y)


@interface.film_corner.register(ViewsCamera)
def film_corner_views_camera(camera, x, y):
    return corner_on_films(camera.grid, x, y)


@interface.film_to_view.register(ViewsCamera)
def film_to_view_views_camera(camera, x, y):
    return place_in_view(camera.grid, x, y)


@interface.camera_ray.register(ViewsCamera)
def camera_ray_views_camera(camera, x, y, time, draws):
    grid, frame = camera.grid, camera.frame
    column, row = view_index(grid, x), view_index(grid, y)
    right, up = grid.left + grid.across * column, grid.top - grid.down * row
    shift = add(scale(right, frame.right), scale(up, frame.up))

    # What the middle would see at this place of its film, as seen from here where all views converge.
    direction = film_direction(frame, camera.plane, x - grid.stride * column, y - grid.stride * row)
    direction = madd(direction, -grid.inverse_convergence, shift)
    here = CameraFrame(add(frame.origin, shift), frame.right, frame.up, frame.forward)
    return lens_ray(camera.lens, here, camera.irradiance, direction, draws)


@interface.camera_defocus.register(ViewsCamera)
def camera_defocus_views_camera(camera: Any) -> Any:
    return interface.camera_defocus(PerspectiveCamera(camera.frame, camera.plane, camera.lens, camera.irradiance))


@interface.camera_parts.register(ViewsCamera)
def camera_parts_views_camera(camera: Any) -> interface.CameraParts:
    return thin_lens_parts(camera.lens)


@interface.project.register(ViewsCamera)
def project_views_camera(camera, point, time):
    # As the middle sees it.
    right, up, depth = to_camera_space(camera.frame, point)
    return project_to_film(camera.plane, right, up, depth)
