"""What every environment kind gives to packing and to kernels."""

from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

from raytracer.jit import generic
from raytracer.spec import Spec
from raytracer.vec import Vec3

Assets = Mapping[str, Any]
"""What an environment's files held, by the key that names the file."""


class SunDisc(NamedTuple):
    """A sun that belongs to an environment.

    direction, in which its light travels; irradiance (W/m2) of a plane that faces it; angle, its diameter (degrees).
    """

    direction: Vec3
    irradiance: Vec3
    angle: float


class EnvironmentSpec(Spec):
    """Base of the environments."""

    type: str

    can_be_drawn: ClassVar[bool] = False
    """Whether `sample_background` draws directions by radiance, so that surfaces aim at the environment."""

    def pack(self, assets: Assets) -> Any:
        """The packed environment, or None if it is black.

        Raises
        ------
        ValueError : an asset does not suit the environment; a sentence that says why.
        """
        raise NotImplementedError

    def disc(self) -> SunDisc | None:
        """The sun that is packed as a light of the scene's, on top of what `pack` gives."""
        return None


@generic
def background(environment, direction):
    """Radiance that arrives along a ray of unit `direction` from far away."""
    raise NotImplementedError


@background.register(type(None))
def _(environment, direction):
    return (0.0, 0.0, 0.0)


@generic
def sample_background(environment, u1, u2):
    """Draw a unit direction about in proportion to its radiance: (direction, radiance, pdf in 1/sr)."""
    raise NotImplementedError


@generic
def background_with_pdf(environment, direction):
    """`background`, and the density in solid angle (1/sr) with which `sample_background` draws the direction."""
    raise NotImplementedError
