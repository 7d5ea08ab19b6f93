"""What the perspective cameras share: a frame, an image plane, and a lens or None."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from raytracer.cameras.interface import CameraSpec, camera_ray
from raytracer.jit import generic, kernel
from raytracer.spec import Direction, FieldOfView, Point
from raytracer.vec import Vec3, add, madd, normalize, scale


class Frame(NamedTuple):
    """A camera's place and frame: origin, and the unit vectors right, up, forward."""

    origin: Vec3
    right: Vec3
    up: Vec3
    forward: Vec3


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


def _vec3(vector: NDArray[np.float64]) -> Vec3:
    return float(vector[0]), float(vector[1]), float(vector[2])


class PerspectiveSpec(CameraSpec):
    """Where a camera stands, what it looks at, and how much of it."""

    look_from: Point = Field(default=(0.0, 0.0, 0.0), description="position of the pinhole or lens (m)")
    look_at: Point = Field(default=(0.0, 0.0, -1.0), description="point in the centre of the picture (m)")
    up: Direction = Field(default=(0.0, 1.0, 0.0), description="direction that is up in the picture")
    vfov: FieldOfView = Field(default=90.0, description="vertical field of view (deg), between 0 and 180")

    @model_validator(mode="after")
    def _looks_somewhere(self) -> Any:
        self.frame()
        return self

    def frame(self) -> Frame:
        """The camera's frame, orthonormal to a few ulps however close `up` is to the view.

        Raises
        ------
        ValueError : look_from and look_at are the same point, or `up` is parallel to the view.
        """
        forward = np.subtract(self.look_at, self.look_from)
        if not forward.any():
            raise ValueError("look_from and look_at are the same point, so the camera looks nowhere")
        forward = forward / np.linalg.norm(forward)
        up = np.asarray(self.up) / np.linalg.norm(self.up)
        right = np.cross(forward, up)
        # The sine between two unit vectors is wrong by a few ulps, so less than that is parallel.
        if np.linalg.norm(right) < 4.0 * np.finfo(np.float64).eps:
            raise ValueError("up is parallel to the view from look_from to look_at, so no direction is up")
        # A second round takes out what cancellation left along the view.
        right = right / np.linalg.norm(right)
        right = right - forward * np.dot(right, forward)
        right = right / np.linalg.norm(right)
        return Frame(self.look_from, _vec3(right), _vec3(np.cross(right, forward)), _vec3(forward))

    def distance(self) -> float:
        """|look_at - look_from| (m)."""
        return float(np.linalg.norm(np.subtract(self.look_at, self.look_from)))

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
