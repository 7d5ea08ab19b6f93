"""Position and orientation of a camera, which every kind of camera has."""

from typing import Annotated, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.spectra import FIRST, LAST
from raytracer.core.vec import Vec3, dot, sub
from raytracer.plugins.cameras.base.interface import CameraSpec
from raytracer.schema.fields import MAX_MAGNITUDE, Direction, Point, Quantity

WavelengthField: TypeAlias = Annotated[
    Annotated[float, Quantity("wavelength", low=FIRST, high=LAST)] | None,
    Field(
        description=f"the one wavelength (nm) that is seen, {FIRST:g} to {LAST:g}: pixels are its spectral radiance, "
        "relative to the light of D65, so that what is white has 1 at every wavelength; without it they are red, green "
        "and blue"
    ),
]
"""The key of cameras that can see light of one wavelength alone."""


class CameraFrame(NamedTuple):
    """Position of a camera, and the axes of its coordinate system.

    origin (m) : position of the camera.
    right, up, forward : orthogonal unit vectors; the camera looks along `forward`.
    """

    origin: Vec3
    right: Vec3
    up: Vec3
    forward: Vec3


def _vec3(vector: NDArray[np.float64]) -> Vec3:
    return float(vector[0]), float(vector[1]), float(vector[2])


class PlacedSpec(CameraSpec):
    """Position and orientation of a camera."""

    look_from: Point = Field(default=(0.0, 0.0, 0.0), description="position of the camera (m)")
    look_at: Point = Field(default=(0.0, 0.0, -1.0), description="point in the centre of the picture (m)")
    up: Direction = Field(default=(0.0, 1.0, 0.0), description="direction that is up in the picture")

    @model_validator(mode="after")
    def _looks_somewhere(self) -> Any:
        self.frame()
        return self

    def frame(self) -> CameraFrame:
        """Return the camera's frame, orthonormal to a few ulps however close `up` is to the view.

        Raises
        ------
        ValueError : look_from and look_at are the same point, or `up` is parallel to the view.
        """
        forward = np.subtract(self.look_at, self.look_from)
        # As near as no two numbers of a scene but 0 are to it, squares of what lies between would vanish.
        if np.abs(forward).max() * MAX_MAGNITUDE < 1.0:
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
        return CameraFrame(self.look_from, _vec3(right), _vec3(np.cross(right, forward)), _vec3(forward))

    def distance(self) -> float:
        """Return |look_at - look_from| (m)."""
        return float(np.linalg.norm(np.subtract(self.look_at, self.look_from)))


@kernel
def to_camera_space(frame, point):
    """Transform a point to the camera's frame: coordinates (m) to the right, up, and along the axis."""
    to = sub(point, frame.origin)
    return dot(to, frame.right), dot(to, frame.up), dot(to, frame.forward)
