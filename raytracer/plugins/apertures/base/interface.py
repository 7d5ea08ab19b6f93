"""What every kind of aperture gives to packing and to kernels.

An aperture lies in the plane of the lens, x to the right and y up in the picture, seen from behind the camera.  Lights
beyond the plane of focus blur to its image, those before it to its image upside down.

Its unit of length is the radius of the round aperture, and its area, weighted by what it lets through, is always that
of the round one, pi: a lens of a given f-number gathers as much light whatever the shape.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple, TypeAlias

from pydantic import Field

from raytracer.jit import generic
from raytracer.lenses.diaphragm import covers, reach
from raytracer.sampling.warp import sample_disc
from raytracer.spec import PositiveNumber, Spec

Assets: TypeAlias = Mapping[str, Any]
"""What an aperture's files held, by the key that names the file."""


class ApertureSpec(Spec):
    """Base of the apertures: what packing asks of each."""

    type: str
    anamorphic: PositiveNumber = Field(
        default=1.0,
        description="height of the shape over its width, once stretched without a change of area; 2 for the upright "
        "ovals of an anamorphic lens",
    )

    def shape(self, assets: Assets) -> Any:
        """The packed shape before it is stretched; None if it is the unit disc.

        Raises
        ------
        ValueError : an asset does not suit the aperture; a sentence that says why.
        """
        raise NotImplementedError

    def pack(self, assets: Assets) -> Any:
        """The packed aperture; None if it is the unit disc.

        Raises
        ------
        ValueError : as `shape` does.
        """
        shape = self.shape(assets)
        if self.anamorphic == 1.0:
            return shape
        height = math.sqrt(self.anamorphic)
        return Stretched(shape, 1.0 / height, height)


class Stretched(NamedTuple):
    """Packed: a shape, and the factors along x and y, whose product is 1."""

    shape: Any
    width: float
    height: float


@generic
def sample_aperture(aperture, u1, u2):
    """A point (x, y) of the aperture, with a density in proportion to what it lets through there.

    Of an aperture without partly transparent places that is evenly by area, 1 / pi.
    """
    raise NotImplementedError


@sample_aperture.register(type(None))
def _(aperture, u1, u2):
    return sample_disc(u1, u2)


@sample_aperture.register(Stretched)
def _(aperture, u1, u2):
    x, y = sample_aperture(aperture.shape, u1, u2)
    return aperture.width * x, aperture.height * y


@covers.register(Stretched)
def _(diaphragm, x, y):
    return covers(diaphragm.shape, x / diaphragm.width, y / diaphragm.height)


@reach.register
def _(diaphragm: Stretched) -> float:
    return max(diaphragm.width, diaphragm.height) * reach(diaphragm.shape)


@generic
def unvignetted(rim, x, y, right, up):
    """1 if a ray passes the rim in front of the aperture, else 0.

    (x, y), where it leaves the aperture (m); (right, up), by how much it goes there per metre along the axis.
    """
    raise NotImplementedError


@unvignetted.register(type(None))
def _(rim, x, y, right, up):
    return 1.0
