"""Orthographic camera: parallel rays, so that nothing gets smaller with distance.

In a scene:

    camera: {type: orthographic, look_from: [0, 0, 5], look_at: [0, 0, 0], height: 3}
"""

import math
from typing import Literal, NamedTuple

from pydantic import Field, model_validator

from raytracer.cameras.interface import NO_ASSETS, Assets, camera_ray, project
from raytracer.cameras.placement import Frame, PlacedSpec, in_frame
from raytracer.jit import kernel
from raytracer.spec import PositiveLength
from raytracer.vec import add, madd, scale


class Orthographic(PlacedSpec):
    """Parallel rays from a rectangle around `look_from`, along the view; what lies behind the rectangle is not seen.

    Give the height or the width of the rectangle; pixels are square, so the film's shape gives the other.

    References: Pharr et al. 2023, "Physically Based Rendering", 4th ed., sec. 5.2.1.
    """

    type: Literal["orthographic"] = "orthographic"
    height: PositiveLength | None = Field(default=None, description="height of what is seen (m)")
    width: PositiveLength | None = Field(default=None, description="width of what is seen (m), in place of `height`")

    @model_validator(mode="after")
    def _one_size(self) -> "Orthographic":
        if (self.height is None) == (self.width is None):
            raise ValueError("needs a size of what is seen: give either height or width (m)")
        return self

    def _pixel(self, width: int, height: int) -> float:
        """Edge of a pixel (m)."""
        if self.height is not None:
            return self.height / height
        assert self.width is not None
        return self.width / width

    def describe(self, width: int, height: int) -> dict[str, float]:
        """Derived numbers: what is seen, and a pixel of it."""
        pixel = self._pixel(width, height)
        return {"view_width_m": pixel * width, "view_height_m": pixel * height, "pixel_mm": 1e3 * pixel}

    def pack(self, width: int, height: int, assets: Assets = NO_ASSETS) -> "OrthographicCamera":
        """The camera for a film of width x height pixels."""
        pixel = self._pixel(width, height)
        return OrthographicCamera(self.frame(), pixel, -0.5 * pixel * width, 0.5 * pixel * height)


class OrthographicCamera(NamedTuple):
    """Packed: width of a pixel, and the film's left and top edges, right and up from the axis (m)."""

    frame: Frame
    pixel: float
    left: float
    top: float


@kernel
def _origin(camera, x, y):
    across = madd(camera.frame.origin, camera.left + camera.pixel * x, camera.frame.right)
    return add(across, scale(camera.top - camera.pixel * y, camera.frame.up))


@camera_ray.register(OrthographicCamera)
def _(camera, x, y, time, draws):
    return _origin(camera, x, y), camera.frame.forward, 1.0


@project.register(OrthographicCamera)
def _(camera, point, time):
    right, up, depth = in_frame(camera.frame, point)
    if depth < 0.0:
        return math.nan, math.nan, depth
    return (right - camera.left) / camera.pixel, (camera.top - up) / camera.pixel, depth
