"""What every environment kind gives to packing and to kernels."""

from typing import Any

from raytracer.jit import generic
from raytracer.spec import Spec


class EnvironmentSpec(Spec):
    """Base of the environments."""

    type: str

    def pack(self) -> Any:
        """The packed environment, or None if it is black."""
        raise NotImplementedError


@generic
def background(environment, direction):
    """Radiance that arrives along a ray of unit `direction` from far away."""
    raise NotImplementedError


@background.register(type(None))
def _(environment, direction):
    return (0.0, 0.0, 0.0)
