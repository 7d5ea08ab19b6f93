"""Interface of environments: the spec's methods for packing, and the generic functions for kernels."""

from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

from raytracer.core.compiler.dispatch import generic, optional
from raytracer.core.vec import Vec3
from raytracer.schema.spec import Spec

Assets = Mapping[str, Any]
"""Contents of an environment's files, by the key that names the file."""


class SunDisc(NamedTuple):
    """Sun that belongs to an environment.

    direction : in which its light travels.
    irradiance (W/m2) : of a plane that faces it.
    angle (deg) : its diameter.
    """

    direction: Vec3
    irradiance: Vec3
    angle: float


class EnvironmentSpec(Spec):
    """Base of the environments."""

    type: str

    has_importance_sampling: ClassVar[bool] = False
    """True if `sample_background` draws directions by radiance, for next-event estimation."""

    def pack(self, assets: Assets) -> Any:
        """Pack the environment; None if it is black.

        Raises
        ------
        ValueError : an asset does not suit the environment; a sentence that says why.
        """
        raise NotImplementedError

    def sun_disc(self) -> SunDisc | None:
        """Return the sun to be packed as a light of the scene, besides the packed environment; None without one."""
        return None


@optional
def background(environment, direction):
    """Return the radiance that arrives along a ray of unit `direction` from far away."""
    return (0.0, 0.0, 0.0)


@generic
def sample_background(environment, u1, u2):
    """Draw a unit direction about in proportion to its radiance: (direction, radiance, pdf in 1/sr)."""


@generic
def background_with_pdf(environment, direction):
    """Return `background`, and the density in solid angle (1/sr) with which `sample_background` draws the direction."""
