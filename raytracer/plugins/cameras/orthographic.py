"""Orthographic camera: parallel rays, so that nothing gets smaller with distance.

In a scene:

    camera: {type: orthographic, look_from: [0, 0, 5], look_at: [0, 0, 0], height: 3}
"""

import math
from typing import Literal, NamedTuple

from pydantic import Field

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.vec import add, madd, scale
from raytracer.plugins.cameras.base.interface import NO_ASSETS, Assets, camera_ray, project
from raytracer.plugins.cameras.base.placement import CameraFrame, PlacedSpec, to_camera_space
from raytracer.schema.fields import PositiveLength
from raytracer.schema.rules import some_of


class Orthographic(PlacedSpec):
    """Parallel rays from a rectangle around `look_from`, along the view; what lies behind the rectangle is not seen.

    Give the height or the width of the rectangle; pixels are square, so the film's shape gives the other.

    References: Pharr et al. 2023, "Physically Based Rendering", 4th ed., sec. 5.2.1.
    """

    type: Literal["orthographic"] = "orthographic"
    height: PositiveLength | None = Field(default=None, description="height of what is seen (m)")
    width: PositiveLength | None = Field(default=None, description="width of what is seen (m), in place of `height`")

    _one_size = some_of(
        "height", "width", most=1, message="needs a size of what is seen: give either height or width (m)"
    )

    def _pixel(self, width: int, height: int) -> float:
        """Return the edge of a pixel (m)."""
        if self.height is not None:
            return self.height / height
        assert self.width is not None
        return self.width / width

    def describe(self, width: int, height: int) -> dict[str, float]:
        pixel = self._pixel(width, height)
        return {"view_width_m": pixel * width, "view_height_m": pixel * height, "pixel_mm": 1e3 * pixel}

    def pack(self, width: int, height: int, assets: Assets = NO_ASSETS) -> "OrthographicCamera":
        pixel = self._pixel(width, height)
        return OrthographicCamera(self.frame(), pixel, -0.5 * pixel * width, 0.5 * pixel * height)


class OrthographicCamera(NamedTuple):
    """Packed orthographic camera.

    pixel (m) : width of a pixel.
    left, top (m) : edges of the film, right and up from the axis.
    """

    frame: CameraFrame
    pixel: float
    left: float
    top: float


@kernel
def _origin(camera, x, y):
    across = madd(camera.frame.origin, camera.left + camera.pixel * x, camera.frame.right)
    return add(across, scale(camera.top - camera.pixel * y, camera.frame.up))


@camera_ray.register(OrthographicCamera)
def camera_ray_orthographic_camera(camera, x, y, time, draws):
    return _origin(camera, x, y), camera.frame.forward, 1.0


@project.register(OrthographicCamera)
def project_orthographic_camera(camera, point, time):
    right, up, depth = to_camera_space(camera.frame, point)
    if depth < 0.0:
        return math.nan, math.nan, depth
    return (right - camera.left) / camera.pixel, (camera.top - up) / camera.pixel, depth
