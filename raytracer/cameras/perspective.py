"""What the perspective cameras share: a frame, an image plane, and a lens or None."""

import math
from typing import Any, NamedTuple

from pydantic import Field

from raytracer.cameras.interface import camera_ray, project
from raytracer.cameras.placement import Frame, PlacedSpec, in_frame
from raytracer.jit import generic, kernel
from raytracer.spec import FieldOfView
from raytracer.vec import add, madd, normalize, scale


class ImagePlane(NamedTuple):
    """The film's image at distance 1: width of a pixel, and its left and top edges, right and up from the axis."""

    pixel: float
    left: float
    top: float


class PerspectiveCamera(NamedTuple):
    """Packed; `lens` is None for a pinhole."""

    frame: Frame
    plane: ImagePlane
    lens: Any


class PerspectiveSpec(PlacedSpec):
    """Where a camera stands, what it looks at, and how much of it."""

    vfov: FieldOfView = Field(default=90.0, description="vertical field of view (deg), between 0 and 180")

    def describe(self, width: int, height: int) -> dict[str, float]:
        """Derived numbers for `rt explain`, by name with unit."""
        top = math.tan(math.radians(self.vfov) / 2.0)
        right = top * width / height
        return {
            "vfov_deg": self.vfov,
            "hfov_deg": math.degrees(2.0 * math.atan(right)),
            "dfov_deg": math.degrees(2.0 * math.atan(math.hypot(right, top))),
            "pixel_at_1m_mm": 1e3 * 2.0 * top / height,
        }

    def camera(self, width: int, height: int, lens: Any) -> PerspectiveCamera:
        """The packed camera for a film of width x height square pixels."""
        top = math.tan(math.radians(self.vfov) / 2.0)
        pixel = 2.0 * top / height
        return PerspectiveCamera(self.frame(), ImagePlane(pixel, -0.5 * pixel * width, top), lens)


@generic
def lens_ray(lens, frame, direction, draws):
    """The ray (origin, unit direction, weight) into the scene of the ray through the lens's centre along `direction`.

    `direction` is not a unit vector: its component along the axis is 1.
    """
    raise NotImplementedError


@lens_ray.register(type(None))
def _(lens, frame, direction, draws):
    return frame.origin, normalize(direction), 1.0


@kernel
def film_direction(frame, plane, x, y):
    """From the lens's centre to the image of film position (x, y) in the plane at distance 1."""
    across = scale(plane.left + plane.pixel * x, frame.right)
    return add(madd(across, plane.top - plane.pixel * y, frame.up), frame.forward)


@camera_ray.register(PerspectiveCamera)
def _(camera, x, y, time, draws):
    return lens_ray(camera.lens, camera.frame, film_direction(camera.frame, camera.plane, x, y), draws)


@project.register(PerspectiveCamera)
def _(camera, point, time):
    right, up, depth = in_frame(camera.frame, point)
    if depth <= 0.0:
        return math.nan, math.nan, depth
    plane = camera.plane
    return (right / depth - plane.left) / plane.pixel, (plane.top - up / depth) / plane.pixel, depth
