"""Fisheye camera: a field of view up to the full sphere, in a circle.

In a scene:

    camera: {type: fisheye, look_from: [0, 1, 3], look_at: [0, 1, 0], projection: equisolid, fov: 180}
"""

import math
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import Field

from raytracer.core.compiler.dispatch import generic
from raytracer.core.vec import norm, normalize, to_world
from raytracer.plugins.cameras.base.interface import NO_ASSETS, Assets, camera_ray, project
from raytracer.plugins.cameras.base.placement import CameraFrame, PlacedSpec, to_camera_space
from raytracer.schema.fields import Quantity
from raytracer.schema.rules import never


class Fisheye(PlacedSpec):
    """A picture in a circle, whose diameter is the shorter side of the film; what lies outside it is black.

    With r the distance from the middle and t the angle from the axis, r is proportional to
    `equidistant`: t, so that angles can be measured; `equisolid`: sin(t / 2), so that areas are solid angles;
    `stereographic`: tan(t / 2), so that small shapes keep theirs; `orthographic`: sin(t), so that areas are what a sky
    counts for on the ground, solid angle times cosine.

    References: Kannala & Brandt 2006, "A Generic Camera Model and Calibration Method for Conventional, Wide-Angle, and
        Fish-Eye Lenses", IEEE TPAMI 28(8), eq. 1-5.
    """

    type: Literal["fisheye"] = "fisheye"
    projection: Literal["equidistant", "equisolid", "stereographic", "orthographic"] = Field(
        default="equidistant", description="how the angle from the axis becomes a distance in the picture"
    )
    fov: Annotated[float, Quantity("angle", low=0.0, low_open=True, high=360.0)] = Field(
        default=180.0, description="angle (deg) of a diameter of the circle, up to 360"
    )

    _is_finite = never(
        "fov",
        where=lambda camera: camera.projection == "stereographic" and camera.fov >= 360.0,
        message="must be less than 360 deg for the stereographic projection, whose picture would be infinite",
    )
    _shows_each_direction_once = never(
        "fov",
        where=lambda camera: camera.projection == "orthographic" and camera.fov > 180.0,
        message="must be at most 180 deg for the orthographic projection, which shows nothing behind the camera",
    )

    def describe(self, width: int, height: int) -> dict[str, float]:
        radius = 0.5 * min(width, height)
        half = math.radians(self.fov) / 2.0
        slope = {
            "equidistant": half,
            "equisolid": 2.0 * math.sin(half / 2.0),
            "stereographic": 2.0 * math.tan(half / 2.0),
            "orthographic": math.sin(half),
        }[self.projection]
        return {
            "fov_deg": self.fov,
            "circle_diameter_px": 2.0 * radius,
            "pixel_at_middle_deg": math.degrees(slope / radius),
        }

    def pack(self, width: int, height: int, assets: Assets = NO_ASSETS) -> "FisheyeCamera":
        half = math.radians(self.fov) / 2.0
        projection: Any = {
            "equidistant": Equidistant(half),
            "equisolid": Equisolid(math.sin(half / 2.0)),
            "stereographic": Stereographic(math.tan(half / 2.0)),
            "orthographic": Orthographic(math.sin(half)),
        }[self.projection]
        return FisheyeCamera(self.frame(), projection, 0.5 * width, 0.5 * height, 0.5 * min(width, height))


class Equidistant(NamedTuple):
    """Projection r = t / edge, where edge is the angle at r = 1."""

    edge: float


class Equisolid(NamedTuple):
    """Projection r = sin(t / 2) / edge."""

    edge: float


class Stereographic(NamedTuple):
    """Projection r = tan(t / 2) / edge."""

    edge: float


class Orthographic(NamedTuple):
    """Projection r = sin(t) / edge."""

    edge: float


class FisheyeCamera(NamedTuple):
    """Packed fisheye.

    projection : from angles to radii in units of the circle's radius, one of the four above.
    x, y (px) : middle of the circle.
    radius (px) : of the circle.
    """

    frame: CameraFrame
    projection: Any
    x: float
    y: float
    radius: float


@generic
def radius_to_angle(projection, radius):
    """Return the angle from the axis (rad) at a distance from the middle, 0 to 1."""


@generic
def angle_to_radius(projection, angle):
    """Return the distance from the middle at an angle (rad) from the axis; NaN where the projection shows none."""


@radius_to_angle.register(Equidistant)
def radius_to_angle_equidistant(projection, radius):
    return projection.edge * radius


@angle_to_radius.register(Equidistant)
def angle_to_radius_equidistant(projection, angle):
    return angle / projection.edge


@radius_to_angle.register(Equisolid)
def radius_to_angle_equisolid(projection, radius):
    return 2.0 * math.asin(projection.edge * radius)


@angle_to_radius.register(Equisolid)
def angle_to_radius_equisolid(projection, angle):
    return math.sin(0.5 * angle) / projection.edge


@radius_to_angle.register(Stereographic)
def radius_to_angle_stereographic(projection, radius):
    return 2.0 * math.atan(projection.edge * radius)


@angle_to_radius.register(Stereographic)
def angle_to_radius_stereographic(projection, angle):
    return math.tan(0.5 * angle) / projection.edge


@radius_to_angle.register(Orthographic)
def radius_to_angle_orthographic(projection, radius):
    return math.asin(projection.edge * radius)


@angle_to_radius.register(Orthographic)
def angle_to_radius_orthographic(projection, angle):
    return math.sin(angle) / projection.edge if angle <= 0.5 * math.pi else math.nan


@camera_ray.register(FisheyeCamera)
def camera_ray_fisheye_camera(camera, x, y, time, draws):
    frame = camera.frame
    right, up = (x - camera.x) / camera.radius, (camera.y - y) / camera.radius
    radius = math.hypot(right, up)
    if radius > 1.0:
        return frame.origin, frame.forward, 0.0
    angle = radius_to_angle(camera.projection, radius)
    # In the middle the sine vanishes with the radius, and the direction across the axis does not matter.
    across = math.sin(angle) / radius if radius > 0.0 else 0.0
    local = (across * right, across * up, math.cos(angle))
    return frame.origin, normalize(to_world(local, frame.right, frame.up, frame.forward)), 1.0


@project.register(FisheyeCamera)
def project_fisheye_camera(camera, point, time):
    local = to_camera_space(camera.frame, point)
    # The camera's own place is in no direction.
    if norm(local) == 0.0:
        return math.nan, math.nan, 0.0
    right, up, forward = local
    across = math.hypot(right, up)
    radius = camera.radius * angle_to_radius(camera.projection, math.atan2(across, forward))
    # Straight ahead is the middle; straight behind is all of a circle, of which this is one point.
    if across == 0.0:
        return camera.x + (radius if forward < 0.0 else 0.0), camera.y, forward
    return camera.x + radius * right / across, camera.y - radius * up / across, forward
