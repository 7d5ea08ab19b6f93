"""What every camera kind gives to packing and to kernels."""

from typing import Any, NamedTuple

from raytracer.jit import generic
from raytracer.spec import Spec

# Slots of random numbers of a camera sample, each a dimension of its own; a slot not drawn costs nothing.
FILTER, LENS, TIME, SLOTS = 0, 1, 2, 8


class Shutter(NamedTuple):
    """Packed, if anything moves while the shutter is open: each ray then has a time of its own."""


class CameraSpec(Spec):
    """Base of the cameras: what packing and `rt explain` ask of each."""

    type: str

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
