"""What every camera kind gives to packing and to kernels."""

from typing import Any

from raytracer.jit import generic
from raytracer.spec import Spec

# Slots of random numbers of a camera sample, each a dimension of its own; a slot not drawn costs nothing.
FILTER, LENS, SLOTS = 0, 1, 8


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
def camera_ray(camera, x, y, draws):
    """The ray (origin, unit direction) of film position (x, y), in pixels from the top left corner."""
    raise NotImplementedError
