"""Rigs: equal cameras that each stand and look as a table says, round an object or looking out from its place."""

import math
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.vec import add, dot, sub
from raytracer.film.light_field.posed_field import PosedMosaic
from raytracer.film.light_field.posed_views import PosedViews
from raytracer.plugins.cameras.base import interface, views
from raytracer.plugins.cameras.base.ideal import IdealLensSpec
from raytracer.plugins.cameras.base.interface import NO_ASSETS, Assets
from raytracer.plugins.cameras.base.perspective_camera import (
    ImagePlane,
    PerspectiveCamera,
    film_direction,
    lens_ray,
    project_to_film,
    thin_lens_parts,
)
from raytracer.plugins.cameras.base.placement import CameraFrame, to_camera_space

# Columns of a rig's table: position from the middle frame's, axes, and left and top edge of the image plane.
_OFFSET, _RIGHT, _UP, _FORWARD, _LEFT, _TOP, _COLUMNS = 0, 3, 6, 9, 12, 13, 14


class RigCamera(NamedTuple):
    """Packed perspective camera at each pose of a table.

    middle : frame that stands for all where one is asked for.
    plane : image plane of the middle frame.
    lens, irradiance : as in `PerspectiveCamera`.
    films : a ViewFilms.
    columns : views in a row of the picture.
    poses : float64 (views, 14), by rows: position less that of the middle frame (m), right, up, forward, and the left
        and top edge of the view's own image plane.
    """

    middle: CameraFrame
    plane: ImagePlane
    lens: Any
    irradiance: Any
    films: views.ViewFilms
    columns: int
    poses: NDArray[np.float64]


class RigViews(NamedTuple):
    """Poses of a rig's views.

    pose : float64 (rows, columns, 4, 3), as in `PosedViews`.
    shear : float64 (rows, columns, 2), tangents right and up by which the image plane of each is shifted.
    """

    pose: NDArray[np.float64]
    shear: NDArray[np.float64]


class RigSpec(IdealLensSpec):
    """Base of the rigs of cameras that look at one place, or away from it."""

    facing: Literal["inward", "outward"] = Field(
        default="inward",
        description="`inward`: the cameras stand round `look_at` and look there; `outward`: round `look_from`, looking "
        "away from it",
    )

    @model_validator(mode="after")
    def _is_developed_view_by_view(self) -> Any:
        views.refuse_bayer(self.simulated_sensor())
        return self

    def rig(self) -> RigViews:
        """Return the poses of all views."""
        raise NotImplementedError

    def reach(self) -> float:
        """Return the distance (m) of the middle frame from the place that the cameras stand round."""
        raise NotImplementedError

    def sight(self) -> CameraFrame:
        """Return the frame at `look_from` that looks at `look_at`."""
        return super().frame()

    def center(self) -> NDArray[np.float64]:
        """Return the place that the cameras stand round (m)."""
        return np.array(self.look_at if self.facing == "inward" else self.look_from)

    def outward_sign(self) -> float:
        """Return 1 where the cameras look away from the center, and -1 where they look at it."""
        return 1.0 if self.facing == "outward" else -1.0

    def frame(self) -> CameraFrame:
        """Return the frame of the camera that looks along the line from `look_from` to `look_at`."""
        sight = self.sight()
        x, y, z = self.center() + self.outward_sign() * self.reach() * np.array(sight.forward)
        return sight._replace(origin=(float(x), float(y), float(z)))

    def plane_of_focus(self) -> float:
        if self.focus_distance is not None or self.facing == "outward":
            return super().plane_of_focus()
        return self.reach()

    def picture(self, width: int, height: int) -> tuple[int, int]:
        rows, columns = self.rig().pose.shape[:2]
        return columns * width, rows * height

    def film_margin(self, width: int, height: int) -> float:
        return views.view_margin(width, height)

    def layout(self, width: int, height: int) -> PosedMosaic:
        pose, shear = self.rig()
        planes = np.broadcast_to(np.array(self.pack_with_lens(width, height, None).plane), (*pose.shape[:2], 3)).copy()
        planes[..., 1:] += shear
        return PosedMosaic(PosedViews(pose, planes, width, height))

    def describe(self, width: int, height: int) -> dict[str, float]:
        from scipy.spatial import KDTree

        pose = self.rig().pose
        rows, columns = pose.shape[:2]
        numbers = {"views": float(rows * columns), "view_columns": float(columns), "view_rows": float(rows)}
        places = pose[..., 0, :].reshape(-1, 3)
        if len(places) > 1:
            near, index = KDTree(places).query(places, k=2)
            to = places - self.center()
            # Not of unit length: places that rounding puts into the middle have no direction.
            apart = np.linalg.norm(np.cross(to, to[index[:, 1]]), axis=1), (to * to[index[:, 1]]).sum(axis=1)
            numbers["view_spacing_mm"] = 1e3 * float(np.median(near[:, 1]))
            numbers["view_angle_deg"] = math.degrees(float(np.median(np.arctan2(*apart))))
        return super().describe(width, height) | numbers

    def pack(self, width: int, height: int, assets: Assets = NO_ASSETS) -> RigCamera:
        camera = self.pack_with_lens(width, height, self.pack_lens(width, height, assets))
        pose, shear = self.rig()
        rows, columns = pose.shape[:2]
        table = np.empty((rows * columns, _COLUMNS))
        table[:, :_LEFT] = pose.reshape(rows * columns, -1)
        table[:, _OFFSET:_RIGHT] -= camera.frame.origin
        table[:, _LEFT:] = shear.reshape(-1, 2) + np.array(camera.plane[1:])
        films = views.make_view_films(width, height)
        return RigCamera(camera.frame, camera.plane, camera.lens, camera.irradiance, films, columns, table)


def place_cells(low: float, high: float, count: int) -> NDArray[np.float64]:
    """Return the middles of equal parts of an interval."""
    return low + (high - low) * (np.arange(count) + 0.5) / count


@kernel
def _frame_of(camera, view):
    """Return the frame of a view."""
    row = camera.poses[view]
    offset = (row[_OFFSET], row[_OFFSET + 1], row[_OFFSET + 2])
    right = (row[_RIGHT], row[_RIGHT + 1], row[_RIGHT + 2])
    up = (row[_UP], row[_UP + 1], row[_UP + 2])
    forward = (row[_FORWARD], row[_FORWARD + 1], row[_FORWARD + 2])
    return CameraFrame(add(camera.middle.origin, offset), right, up, forward)


@interface.film_corner.register(RigCamera)
def film_corner_rig_camera(camera, x, y):
    return views.corner_on_films(camera.films, x, y)


@interface.film_to_view.register(RigCamera)
def film_to_view_rig_camera(camera, x, y):
    return views.place_in_view(camera.films, x, y)


@interface.camera_ray.register(RigCamera)
def camera_ray_rig_camera(camera, x, y, time, draws):
    films = camera.films
    view = int(views.view_index(films, y)) * camera.columns + int(views.view_index(films, x))
    frame = _frame_of(camera, view)
    plane = ImagePlane(camera.plane.pixel, camera.poses[view, _LEFT], camera.poses[view, _TOP])
    view_x, view_y = views.place_in_view(films, x, y)
    direction = film_direction(frame, plane, view_x, view_y)
    return lens_ray(camera.lens, frame, camera.irradiance, direction, draws)


@interface.axial_depth.register(RigCamera)
def axial_depth_rig_camera(camera, point, start, time):
    # A ray starts within its view's opening, nearer to that view than to any other.
    to = sub(start, camera.middle.origin)
    nearest, view = math.inf, 0
    for i in range(len(camera.poses)):
        row = camera.poses[i]
        away = sub(to, (row[_OFFSET], row[_OFFSET + 1], row[_OFFSET + 2]))
        square = dot(away, away)
        if square < nearest:
            nearest, view = square, i
    return to_camera_space(_frame_of(camera, view), point)[2]


@interface.camera_defocus.register(RigCamera)
def camera_defocus_rig_camera(camera: Any) -> Any:
    return interface.camera_defocus(PerspectiveCamera(camera.middle, camera.plane, camera.lens, camera.irradiance))


@interface.camera_parts.register(RigCamera)
def camera_parts_rig_camera(camera: Any) -> interface.CameraParts:
    return thin_lens_parts(camera.lens)


@interface.translate_camera.register(RigCamera)
def translate_camera_rig_camera(camera: Any, by: Any) -> Any:
    return camera._replace(middle=camera.middle._replace(origin=add(camera.middle.origin, by)))


@interface.project.register(RigCamera)
def project_rig_camera(camera, point, time):
    # As the middle frame sees it.
    right, up, depth = to_camera_space(camera.middle, point)
    return project_to_film(camera.plane, right, up, depth)
