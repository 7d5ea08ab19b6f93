"""Axonometric camera: the parallel projections of technical drawing, isometric, cabinet and cavalier.

As an example of a new kind of camera this is its whole code: put the file into raytracer/plugins/cameras/.  In a scene:

    camera: {type: axonometric, look_from: [3, 3, 3], look_at: [0, 0, 0], height: 4}
    camera: {type: axonometric, look_from: [0, 0, 5], look_at: [0, 0, 0], height: 4, depth_scale: 0.5, depth_angle: 45}
"""

import math
from typing import Literal, NamedTuple

from pydantic import Field

from raytracer.core.vec import add, madd, normalize, scale, to_world
from raytracer.plugins.cameras.base.interface import NO_ASSETS, Assets, camera_ray, project
from raytracer.plugins.cameras.base.placement import CameraFrame, PlacedSpec, to_camera_space
from raytracer.schema.fields import Angle, NonNegativeNumber, PositiveLength


class Axonometric(PlacedSpec):
    """Parallel rays through a rectangle around `look_from`, which may meet it at an angle.

    Edges along the view are drawn `depth_scale` times as long as those across it, at `depth_angle`: with (x, y, z) to
    the right, up, and along the view, a point is drawn at x + s z cos a, y + s z sin a.  A scale of 0 is orthographic,
    and isometric along a diagonal of a cube, as from [1, 1, 1]; 1 is the cavalier projection, 1/2 the cabinet one.

    References: Carlbom, Paciorek 1978, "Planar Geometric Projections and Viewing Transformations", ACM Computing
    Surveys 10(4), sec. 1.2.
    """

    type: Literal["axonometric"] = "axonometric"
    height: PositiveLength = Field(description="height of what is seen (m)")
    depth_scale: NonNegativeNumber = Field(default=0.0, description="length of edges along the view, over their own")
    depth_angle: Angle = Field(default=45.0, description="direction of these edges, anticlockwise from the right")

    def describe(self, width: int, height: int) -> dict[str, float]:
        return {"view_width_m": self.height * width / height, "view_height_m": self.height}

    def pack(self, width: int, height: int, assets: Assets = NO_ASSETS) -> "AxonometricCamera":
        angle, pixel = math.radians(self.depth_angle), self.height / height
        shear = self.depth_scale * math.cos(angle), self.depth_scale * math.sin(angle)
        return AxonometricCamera(self.frame(), pixel, 0.5 * width, 0.5 * height, *shear)


class AxonometricCamera(NamedTuple):
    """Packed axonometric camera.

    pixel (m) : width of a pixel.
    x, y (px) : middle of the film.
    right, up : shift in the picture by the depth.
    """

    frame: CameraFrame
    pixel: float
    x: float
    y: float
    right: float
    up: float


@camera_ray.register(AxonometricCamera)
def camera_ray_axonometric_camera(camera, x, y, time, draws):
    frame = camera.frame
    across = scale(camera.pixel * (x - camera.x), frame.right)
    origin = add(frame.origin, madd(across, camera.pixel * (camera.y - y), frame.up))
    # All points of the ray have the same place in the picture: what depth shifts, the ray takes back.
    direction = to_world((-camera.right, -camera.up, 1.0), frame.right, frame.up, frame.forward)
    return origin, normalize(direction), 1.0


@project.register(AxonometricCamera)
def project_axonometric_camera(camera, point, time):
    right, up, depth = to_camera_space(camera.frame, point)
    if depth < 0.0:
        return math.nan, math.nan, depth
    right, up = right + camera.right * depth, up + camera.up * depth
    return camera.x + right / camera.pixel, camera.y - up / camera.pixel, depth
