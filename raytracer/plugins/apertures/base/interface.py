"""Interface of apertures: the spec's methods for packing, and the generic functions for kernels.

An aperture lies in the plane of the lens, x to the right and y up in the picture, seen from behind the camera.  Lights
beyond the plane of focus blur to its image, those before it to its image upside down.

Its unit of length is the radius of the round aperture, and its area, weighted by what it lets through, is always that
of the round one, pi: a lens of a given f-number gathers as much light whatever the shape.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple, TypeAlias

from pydantic import Field

from raytracer.core.compiler.dispatch import optional
from raytracer.core.sampling.warp import sample_disc
from raytracer.optics.lens_system.surfaces import aperture_extent, aperture_transmission
from raytracer.schema.fields import PositiveNumber
from raytracer.schema.spec import Spec

Assets: TypeAlias = Mapping[str, Any]
"""Contents of an aperture's files, by the key that names the file."""


class ApertureSpec(Spec):
    """Base of the apertures."""

    type: str
    anamorphic: PositiveNumber = Field(
        default=1.0,
        description="height of the shape over its width, once stretched without a change of area; 2 for the upright "
        "ovals of an anamorphic lens",
    )

    def shape(self, assets: Assets) -> Any:
        """Pack the shape before it is stretched; None for the unit disc.

        Raises
        ------
        ValueError : an asset does not suit the aperture; a sentence that says why.
        """
        raise NotImplementedError

    def pack(self, assets: Assets) -> Any:
        """Pack the aperture; None for the unit disc.

        Raises
        ------
        ValueError : as `shape` does.
        """
        return stretch_aperture(self.shape(assets), self.anamorphic)


class AnamorphicAperture(NamedTuple):
    """Packed shape that is stretched by the factors `width` along x and `height` along y, whose product is 1."""

    shape: Any
    width: float
    height: float


def stretch_aperture(shape: Any, anamorphic: float) -> Any:
    """Stretch a packed shape to a height of `anamorphic` times its width, without a change of area."""
    if anamorphic == 1.0:
        return shape
    height = math.sqrt(anamorphic)
    return AnamorphicAperture(shape, 1.0 / height, height)


@optional
def sample_aperture(aperture, u1, u2):
    """Draw a point (x, y) of the aperture, with a density in proportion to its transmission there.

    For an aperture without partly transparent places the density is uniform, 1 / pi.
    """
    return sample_disc(u1, u2)


@sample_aperture.register(AnamorphicAperture)
def sample_aperture_anamorphic_aperture(aperture, u1, u2):
    x, y = sample_aperture(aperture.shape, u1, u2)
    return aperture.width * x, aperture.height * y


@aperture_transmission.register(AnamorphicAperture)
def aperture_transmission_anamorphic_aperture(diaphragm, x, y):
    return aperture_transmission(diaphragm.shape, x / diaphragm.width, y / diaphragm.height)


@aperture_extent.register
def aperture_extent_anamorphic_aperture(diaphragm: AnamorphicAperture) -> float:
    return max(diaphragm.width, diaphragm.height) * aperture_extent(diaphragm.shape)


@optional
def rim_visibility(rim, x, y, right, up):
    """Return 1 if a ray passes the rim in front of the aperture, else 0.

    x, y : place at which the ray leaves the aperture (m).
    right, up : slopes of the ray there, metres to the side per metre along the axis.
    """
    return 1.0
