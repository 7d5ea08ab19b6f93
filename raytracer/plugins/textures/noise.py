"""Noise: clouds, turbulence and marble, through space.

In a scene:

    marble: {type: noise, pattern: marble, scale: 4, high: [0.9, 0.88, 0.85]}
"""

import math
from collections.abc import Sequence
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from raytracer.core.compiler.dispatch import kernel, routine
from raytracer.core.sampling.hashing import mix32
from raytracer.core.vec import Vec3, madd, norm, scale
from raytracer.plugins.textures.base.interface import TextureSpec, ValueRange, luminance, texture, texture_gradient
from raytracer.schema.fields import Color, Count, NonNegativeNumber, PositiveNumber

_UINT32_MAX = 2**32 - 1
_MOST_OCTAVES = 16

_PATTERNS = ("perlin", "turbulence", "marble")
_PERLIN, _TURBULENCE, _MARBLE = range(3)

# Columns of the table.
_LOW, _HIGH, _PATTERN, _SCALE, _OCTAVES, _SEED, _BEND, _BEND_SCALE = 0, 3, 6, 7, 8, 9, 10, 11

# Central differences are best where their truncation error, step^2, meets the rounding error, 2^-52 / step.
_STEP = 2.0 ** (-52.0 / 3.0)


class Noise(TextureSpec):
    """Perlin's gradient noise, which blends from the colour `low` to `high`.

    With n the sum of octaves, each of twice the frequency and half the size of the one before, `perlin` blends by
    (1 + n) / 2 with n scaled to -1..1, `turbulence` by |n|, and `marble` by (1 + sin(scale z + turbulence |n|)) / 2.

    References: Perlin 1985, "An Image Synthesizer"; Perlin 2002, "Improving Noise"; Shirley et al. 2024, "Ray Tracing:
    The Next Week", sec. 5.
    """

    type: Literal["noise"] = "noise"
    pattern: Literal["perlin", "turbulence", "marble"] = Field(
        default="perlin", description="clouds, their folded sum, or bands along z that turbulence bends"
    )
    scale: PositiveNumber = Field(
        default=1.0, description="cells of the noise a metre; for `marble`, radians of the bands a metre along z"
    )
    octaves: Annotated[int, Count(1, _MOST_OCTAVES)] | None = Field(
        default=None, description="how many octaves are summed; 1 for `perlin` and 7 for the others if not given"
    )
    seed: Annotated[int, Count(0, _UINT32_MAX)] = Field(default=0, description="another seed is another noise")
    low: Color = Field(default=(0.0, 0.0, 0.0), description="colour where the pattern is lowest")
    high: Color = Field(default=(1.0, 1.0, 1.0), description="colour where the pattern is highest")
    turbulence: NonNegativeNumber = Field(default=10.0, description="how far turbulence moves marble's bands (rad)")
    turbulence_scale: PositiveNumber = Field(default=1.0, description="cells of marble's turbulence a metre")

    @staticmethod
    def pack(specs: Sequence["Noise"], assets: Any) -> "NoiseTable":
        rows = []
        for spec in specs:
            octaves = spec.octaves or (1 if spec.pattern == "perlin" else 7)
            bend = (spec.turbulence, spec.turbulence_scale)
            rows.append((*spec.low, *spec.high, _PATTERNS.index(spec.pattern), spec.scale, octaves, spec.seed, *bend))
        return NoiseTable(np.array(rows, np.float64))

    def mean(self, assets: Any) -> Vec3:
        r, g, b = (0.5 * (low + high) for low, high in zip(self.low, self.high, strict=True))
        return r, g, b

    def range(self, assets: Any) -> ValueRange:
        values = (*self.low, *self.high)
        return ValueRange(min(values), max(values))


class NoiseTable(NamedTuple):
    """Packed noises, one row each.

    rows (n, 12) float64 : low and high colour, pattern, scale, octaves, seed, turbulence and its scale.
    """

    rows: NDArray[np.float64]


@kernel
def _gradient_dot(word: int, x: float, y: float, z: float) -> float:
    """Multiply an offset from a lattice point with its gradient, one of the twelve to the edges of a cube.

    All are equally likely; four of them twice, so that bits of the hash could choose, would favour y by a tenth.
    """
    chosen = (np.int64(word) * 12) >> 32
    first = x if chosen < 8 else y
    second = y if chosen < 4 else z
    return (first if chosen & 1 == 0 else -first) + (second if chosen & 2 == 0 else -second)


@kernel
def _fade(t: float) -> float:
    return t * t * t * (t * (t * 6.0 - 15.0) + 10.0)


@kernel
def _hash_coordinate(word: int, cell: int) -> int:
    """Hash a lattice coordinate on top of the hash of those before it."""
    hashed: int = mix32(np.uint64(word) ^ np.uint64(cell & 0xFFFFFFFF))
    return hashed


@kernel
def _edge(word: int, cell: int, x: float, y: float, z: float, blend: float) -> float:
    """Blend the noise of the two lattice points of an edge along x."""
    a = _gradient_dot(_hash_coordinate(word, cell), x, y, z)
    b = _gradient_dot(_hash_coordinate(word, cell + 1), x - 1.0, y, z)
    return a + blend * (b - a)


@kernel
def _face(word: int, cell_x: int, cell_y: int, x: float, y: float, z: float, blend_x: float, blend_y: float) -> float:
    a = _edge(_hash_coordinate(word, cell_y), cell_x, x, y, z, blend_x)
    b = _edge(_hash_coordinate(word, cell_y + 1), cell_x, x, y - 1.0, z, blend_x)
    return a + blend_y * (b - a)


@kernel
def perlin(point: Vec3, seed: int) -> float:
    """Evaluate gradient noise in -1..1 with cells of size 1: zero at lattice points, twice continuously differentiable.

    References: Perlin 2002, "Improving Noise", SIGGRAPH 2002, with a hash for the table of permutations.
    """
    cell_x, cell_y, cell_z = math.floor(point[0]), math.floor(point[1]), math.floor(point[2])
    x, y, z = point[0] - cell_x, point[1] - cell_y, point[2] - cell_z
    blend_x, blend_y, blend_z = _fade(x), _fade(y), _fade(z)
    start = mix32(np.uint64(seed))
    a = _face(_hash_coordinate(start, cell_z), cell_x, cell_y, x, y, z, blend_x, blend_y)
    b = _face(_hash_coordinate(start, cell_z + 1), cell_x, cell_y, x, y, z - 1.0, blend_x, blend_y)
    return a + blend_z * (b - a)


@routine
def fractal_noise(point: Vec3, seed: int, count: int) -> float:
    """Sum `count` octaves of noise, the first with the weight 1."""
    total, weight, frequency = 0.0, 1.0, 1.0
    for octave in range(count):
        total += weight * perlin(scale(frequency, point), seed + octave)
        weight *= 0.5
        frequency *= 2.0
    return total


@kernel
def pattern_at(rows: NDArray[np.float64], index: int, point: Vec3) -> float:
    """Evaluate the pattern in 0..1 by which the two colours are blended."""
    pattern, size = rows[index, _PATTERN], rows[index, _SCALE]
    count, seed = int(rows[index, _OCTAVES]), int(rows[index, _SEED])
    frequency = rows[index, _BEND_SCALE] if pattern == _MARBLE else size
    value = fractal_noise(scale(frequency, point), seed, count)
    if pattern == _MARBLE:
        value = 0.5 + 0.5 * math.sin(size * point[2] + rows[index, _BEND] * abs(value))
    elif pattern == _TURBULENCE:
        value = abs(value)
    else:
        # The weights 1, 1/2, 1/4 .. add up to 2 - 2 / 2^count.
        value = 0.5 + 0.5 * value / (2.0 - 2.0 ** (1 - count))
    return max(0.0, min(1.0, value))


@kernel
def _color(rows: NDArray[np.float64], index: int, first: int) -> Vec3:
    return (rows[index, first], rows[index, first + 1], rows[index, first + 2])


@texture.register(NoiseTable)
def texture_noise_table(table, index, site):
    low, high = _color(table.rows, index, _LOW), _color(table.rows, index, _HIGH)
    t = pattern_at(table.rows, index, site.point)
    return (low[0] + t * (high[0] - low[0]), low[1] + t * (high[1] - low[1]), low[2] + t * (high[2] - low[2]))


@kernel
def _directional_difference(rows: NDArray[np.float64], index: int, point: Vec3, along: Vec3, size: float) -> float:
    """Return the change of the pattern over `along`, by a central difference over twice the distance `size`."""
    length = norm(along)
    if length == 0.0:
        return 0.0
    step = size / length
    ahead = pattern_at(rows, index, madd(point, step, along))
    return (ahead - pattern_at(rows, index, madd(point, -step, along))) / (2.0 * step)


@texture_gradient.register(NoiseTable)
def texture_gradient_noise_table(table, index, site, tangent, bitangent):
    # The finest octave's cell is what the step has to be small against.
    rows = table.rows
    frequency = max(rows[index, _SCALE], rows[index, _BEND_SCALE]) * 2.0 ** (rows[index, _OCTAVES] - 1.0)
    size = _STEP / frequency
    height = luminance(_color(rows, index, _HIGH)) - luminance(_color(rows, index, _LOW))
    along_u = _directional_difference(rows, index, site.point, tangent, size)
    return height * along_u, height * _directional_difference(rows, index, site.point, bitangent, size)
