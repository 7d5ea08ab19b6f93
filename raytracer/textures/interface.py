"""What every texture kind gives to packing and to kernels, and the parameters of materials that a texture may set.

A kind's file holds its YAML spec, its packed table (one row a texture) and its case of `texture`.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.geometry import row3
from raytracer.jit import generic, kernel, switch
from raytracer.spec import Spec
from raytracer.vec import Vec3


class TextureSpec(Spec):
    """Base of the textures: what packing asks of each."""

    type: str

    @staticmethod
    def pack(specs: Any, assets: Any) -> Any:
        """The table of textures of this kind, one row a spec; `assets` holds, by spec, what its files held."""
        raise NotImplementedError

    def mean(self, assets: Any) -> Vec3:
        """The mean colour, by which lights are chosen; not zero unless the texture is black all over."""
        raise NotImplementedError


@generic
def texture(table, index, site):
    """The colour of texture `index` at a geometry.Site, in linear light."""
    raise NotImplementedError


_texture_any = switch(texture)


@kernel
def texture_at(textures, reference, site):
    """`texture` of the one that a parameter refers to by row * kinds + kind."""
    kinds = len(textures)
    return _texture_any(textures, reference % kinds, reference // kinds, site)


class Colors(NamedTuple):
    """A colour for each row of a table: values (n, 3) float64."""

    values: NDArray[np.float64]


class TexturedColors(NamedTuple):
    """As Colors, or a texture: reference (n,) int32, -1 for the plain value."""

    values: NDArray[np.float64]
    reference: NDArray[np.int32]


class Numbers(NamedTuple):
    """A number for each row of a table: values (n,) float64."""

    values: NDArray[np.float64]


class TexturedNumbers(NamedTuple):
    """As Numbers, or a texture: reference (n,) int32, -1 for the plain value."""

    values: NDArray[np.float64]
    reference: NDArray[np.int32]


@generic
def color(parameter, index, textures, site):
    """A material's colour at a site."""
    raise NotImplementedError


@color.register(Colors)
def _(parameter, index, textures, site):
    return row3(parameter.values, index)


@color.register(TexturedColors)
def _(parameter, index, textures, site):
    reference = parameter.reference[index]
    return row3(parameter.values, index) if reference < 0 else texture_at(textures, reference, site)


@generic
def number(parameter, index, textures, site):
    """A material's number at a site; of a texture it is the luminance."""
    raise NotImplementedError


@number.register(Numbers)
def _(parameter, index, textures, site):
    return parameter.values[index]


@number.register(TexturedNumbers)
def _(parameter, index, textures, site):
    reference = parameter.reference[index]
    return parameter.values[index] if reference < 0 else luminance(texture_at(textures, reference, site))


@kernel
def luminance(rgb: Vec3) -> float:
    """Relative luminance of a colour with the primaries of Rec. 709.

    References: ITU-R BT.709-6, table 3.
    """
    return 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]


class Book:
    """What materials are packed with: it turns their plain values into parameters."""

    def colors(self, values: Sequence[Any]) -> Colors | TexturedColors:
        """The parameter of a table whose rows have these colours."""
        return Colors(np.array(values, np.float64).reshape(-1, 3))

    def numbers(self, values: Sequence[Any]) -> Numbers | TexturedNumbers:
        """The parameter of a table whose rows have these numbers."""
        return Numbers(np.array(values, np.float64))

    def mean(self, value: Any) -> Vec3:
        """The mean of a colour."""
        return (float(value[0]), float(value[1]), float(value[2]))
