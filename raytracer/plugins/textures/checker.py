"""Checker: cells of two colours.

In a scene:

    squares: {type: checker, scale: 0.32, even: [0.2, 0.3, 0.1], odd: [0.9, 0.9, 0.9]}
"""

import math
from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from raytracer.core.vec import Vec3
from raytracer.plugins.textures.base.interface import TextureSpec, ValueRange, texture, texture_gradient
from raytracer.schema.fields import Color, PositiveLength

_EVEN, _ODD, _SCALE, _SOLID = 0, 3, 6, 7


class Checker(TextureSpec):
    """Cubes of space in two colours by turns, or rectangles of a surface's parameters.

    A cell's colour is told by whether floor(x / scale) + floor(y / scale) + floor(z / scale) is even.

    References: Shirley et al. 2024, "Ray Tracing: The Next Week", sec. 4.3.
    """

    type: Literal["checker"] = "checker"
    scale: PositiveLength = Field(default=1.0, description="edge of a cell (m); in `space: uv`, of u and v")
    even: Color = Field(default=(0.2, 0.2, 0.2), description="colour of the cell from the origin on")
    odd: Color = Field(default=(0.9, 0.9, 0.9), description="colour of its neighbours")
    space: Literal["solid", "uv"] = Field(
        default="solid", description="`solid`: cubes of space; `uv`: squares of the surface's parameters"
    )

    @staticmethod
    def pack(specs: Sequence["Checker"], assets: Any) -> "CheckerTable":
        rows = [(*spec.even, *spec.odd, spec.scale, spec.space == "solid") for spec in specs]
        return CheckerTable(np.array(rows, np.float64))

    def mean(self, assets: Any) -> Vec3:
        r, g, b = (0.5 * (even + odd) for even, odd in zip(self.even, self.odd, strict=True))
        return r, g, b

    def range(self, assets: Any) -> ValueRange:
        values = (*self.even, *self.odd)
        return ValueRange(min(values), max(values))


class CheckerTable(NamedTuple):
    """Packed checkers: rows (n, 8) float64 of the even cells' colour, that of the odd ones, scale, and 1 if solid.

    One array and not four: a scene is handed on by value, and each array in it costs every function of the path loop.
    """

    rows: NDArray[np.float64]


@texture.register(CheckerTable)
def texture_checker_table(table, index, site):
    rows = table.rows
    size = rows[index, _SCALE]
    if rows[index, _SOLID] != 0.0:
        cells = math.floor(site.point[0] / size) + math.floor(site.point[1] / size) + math.floor(site.point[2] / size)
    else:
        cells = math.floor(site.u / size) + math.floor(site.v / size)
    first = _EVEN if cells % 2 == 0 else _ODD
    return (rows[index, first], rows[index, first + 1], rows[index, first + 2])


@texture_gradient.register(CheckerTable)
def texture_gradient_checker_table(table, index, site, tangent, bitangent):
    # Cells are level; the steps between them have no slope that a surface could have.
    return 0.0, 0.0
