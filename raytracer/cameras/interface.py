"""What every camera kind gives to packing and to kernels."""

from typing import Any

import numpy as np
from pydantic import Field, model_validator

from raytracer.jit import generic
from raytracer.motion import Motion, Shutter, ShutterField, shutter_of
from raytracer.spec import Name, Spec, Time, at, matrix_of

# Slots of random numbers of a camera sample, each a dimension of its own; a slot not drawn costs nothing.
FILTER, LENS, TIME, SLOTS = 0, 1, 2, 8


class CameraSpec(Spec):
    """Base of the cameras: what packing and `rt explain` ask of each."""

    type: str
    medium: Name | None = Field(
        default=None, description="name of the medium that the camera stands in; the scene's `medium` by default"
    )
    shutter: ShutterField | None = Field(
        default=None,
        description="when light is gathered: {open: 0, close: 1} in seconds of scene time, or for how long from `time` "
        "on, such as 1/125 s; without it the picture is of one moment",
    )
    time: Time | None = Field(
        default=None, description="time of the scene (s) at which a shutter given by its duration opens; default 0"
    )
    motion: Motion | None = Field(
        default=None, description="how the camera moves: velocity (m/s), spin {axis, rate, center} or keyframes"
    )

    @model_validator(mode="after")
    def _opens_once(self) -> Any:
        try:
            self.opening()
        except ValueError as error:
            at("time", str(error))
        return self

    @model_validator(mode="after")
    def _moves_rigidly(self) -> Any:
        for number, key in enumerate((self.motion and self.motion.keyframes) or ()):
            turn = matrix_of(key.transform)[:3, :3]
            if np.linalg.det(turn) < 0.0 or not np.allclose(turn @ turn.T, np.eye(3), rtol=0.0, atol=1e-12):
                at(("motion", "keyframes", number, "transform"), "a camera can be moved and turned, but not scaled")
        return self

    def opening(self) -> Shutter:
        """When the shutter opens and closes."""
        return shutter_of(self.shutter, self.time)

    def pack(self, width: int, height: int) -> Any:
        """The packed camera for a film of width x height pixels."""
        raise NotImplementedError

    def describe(self, width: int, height: int) -> dict[str, float]:
        """Derived numbers, by name with unit."""
        raise NotImplementedError


@generic
def camera_ray(camera, x, y, time, draws):
    """The ray (origin, unit direction, weight) of film position (x, y), in pixels from the top left corner.

    The weight multiplies what the ray brings; 0 where the film position sees nothing.

    `time` is None if nothing moves, else the fraction of the shutter's opening that has passed, 0 to 1.
    """
    raise NotImplementedError


@generic
def project(camera, point, time):
    """Where a point is seen: film position (x, y) in pixels, and its depth along the axis (m); NaN if nowhere."""
    raise NotImplementedError
