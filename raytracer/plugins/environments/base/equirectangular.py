"""Radiance by direction as a latitude-longitude map, and directions drawn in proportion to it.

Texel (row i, column j) of a map of H rows and W columns is centred at v = (i + 1/2) / H, u = (j + 1/2) / W, where
theta = pi v is the angle from +y and phi = 2 pi u goes from -z over +x, as the direction
(sin theta sin phi, cos theta, -sin theta cos phi).  Between centres the map is bilinear; it closes at u = 0 = 1, and is
constant from the outermost rows to the poles.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.sampling.warp import guide_table, sample_guided_bin, sin_cos_turn
from raytracer.core.vec import Vec3
from raytracer.plugins.environments.base.interface import background, background_with_pdf, sample_background


class Equirectangular(NamedTuple):
    """Packed map of radiance; the importance of a texel is the sum of its channels times sin theta.

    texels (H, W, 3) float32 : radiance, which no file holds more precisely.
    sines (H,) float64 : sin theta of the rows.
    rows (H,) float64 : probability of a row or one above it.
    columns (H * W,) float64 : probability of a texel or one to its left, given the row.
    row_guide (H,), column_guide (H * W,) int32 : guide tables of both.
    turn : turns about +y.
    density : density in solid angle of a texel of importance 1, times its sin theta.
    """

    texels: NDArray[np.float32]
    sines: NDArray[np.float64]
    rows: NDArray[np.float64]
    columns: NDArray[np.float64]
    row_guide: NDArray[np.int32]
    column_guide: NDArray[np.int32]
    turn: float
    density: float


def equirectangular(radiance: NDArray[np.float64], rotation: float = 0.0) -> Equirectangular | None:
    """Pack a map of `radiance` (H, W, 3), turned by `rotation` degrees about +y; None if it is black.

    Raises
    ------
    ValueError : the map holds what is negative, not a number, or too large; a predicate of the map.
    """
    if np.isnan(radiance).any():
        raise ValueError("holds NaN")
    if (radiance < 0.0).any():
        raise ValueError("holds negative radiance")
    with np.errstate(over="ignore"):
        texels = np.ascontiguousarray(radiance, np.float32)
    if not np.isfinite(texels).all():
        raise ValueError("holds radiance that is infinite, or beyond 3.4e38")
    if not texels.any():
        return None

    height, width, _ = texels.shape
    sines = np.sin(math.pi * (np.arange(height) + 0.5) / height)
    columns = np.cumsum(texels.sum(axis=2, dtype=np.float64) * sines[:, None], axis=1)
    by_row = columns[:, -1].copy()
    columns /= np.where(by_row > 0.0, by_row, 1.0)[:, None]
    rows = np.cumsum(by_row)
    total = float(rows[-1])
    rows /= total
    return Equirectangular(
        texels=texels,
        sines=sines,
        rows=rows,
        columns=columns.ravel(),
        row_guide=guide_table(rows[None])[0],
        column_guide=guide_table(columns).ravel(),
        turn=math.fmod(rotation, 360.0) / 360.0,
        density=height * width / (2.0 * math.pi**2 * total),
    )


@kernel
def _direction_to_uv(environment, direction):
    """Return (u, v) of a unit direction, and sin theta."""
    sine = math.sqrt(direction[0] * direction[0] + direction[2] * direction[2])
    u = math.atan2(direction[0], -direction[2]) / (2.0 * math.pi) + environment.turn
    return u - math.floor(u), math.atan2(sine, direction[1]) / math.pi, sine


@kernel
def _lookup(environment, u, v):
    """Interpolate radiance and importance at (u, v), 0 <= u, v <= 1, bilinearly."""
    height, width = environment.texels.shape[0], environment.texels.shape[1]
    x, y = u * width - 0.5, v * height - 0.5
    left, above = math.floor(x), math.floor(y)
    s, t = x - left, y - above
    red = green = blue = importance = 0.0
    for down in range(2):
        row = min(max(above + down, 0), height - 1)
        across = t if down == 1 else 1.0 - t
        for right in range(2):
            column = left + right
            column += width if column < 0 else (-width if column >= width else 0)
            weight = across * (s if right == 1 else 1.0 - s)
            r = weight * environment.texels[row, column, 0]
            g = weight * environment.texels[row, column, 1]
            b = weight * environment.texels[row, column, 2]
            red, green, blue = red + r, green + g, blue + b
            importance += (r + g + b) * environment.sines[row]
    return (red, green, blue), importance


@kernel
def _pdf(environment, importance, sine):
    """Return the density in solid angle (1/sr); 0 at a pole itself, which is never drawn."""
    return importance * environment.density / sine if sine > 0.0 else 0.0


@background.register(Equirectangular)
def background_equirectangular(environment, direction):
    u, v, _ = _direction_to_uv(environment, direction)
    radiance, _ = _lookup(environment, u, v)
    return radiance


@background_with_pdf.register(Equirectangular)
def background_with_pdf_equirectangular(environment, direction):
    u, v, sine = _direction_to_uv(environment, direction)
    radiance, importance = _lookup(environment, u, v)
    return radiance, _pdf(environment, importance, sine)


@kernel
def _tent(u: float) -> float:
    """Draw a number in [-1, 1] of density 1 - |x|.

    References: Pharr et al. 2023, "Physically Based Rendering", 4th ed., A.4.1.
    """
    return math.sqrt(2.0 * u) - 1.0 if u < 0.5 else 1.0 - math.sqrt(2.0 * (1.0 - u))


@sample_background.register(Equirectangular)
def sample_background_equirectangular(environment, u1, u2):
    # A bilinear map is a sum of tents, one a texel: draw a texel, and a point under its tent.  The density of all
    # together is the bilinear importance itself.  Rows come first and by their cumulative sums, so that well spread
    # numbers stay well spread.
    height, width = environment.texels.shape[0], environment.texels.shape[1]
    row, rest1 = sample_guided_bin(environment.rows, environment.row_guide, 0, height, u1)
    begin = row * width
    column, rest2 = sample_guided_bin(environment.columns, environment.column_guide, begin, begin + width, u2)
    u = (column - begin + 0.5 + _tent(rest2)) / width
    u -= math.floor(u)

    # What falls beyond a pole is folded back, which makes the outermost tents flat there.
    v = abs((row + 0.5 + _tent(rest1)) / height)
    v = min(v, 2.0 - v)
    radiance, importance = _lookup(environment, u, v)
    turn = u - environment.turn
    across, ahead = sin_cos_turn(turn - math.floor(turn))
    sine, cosine = sin_cos_turn(0.5 * v)
    direction: Vec3 = (sine * across, cosine, -sine * ahead)
    return direction, radiance, _pdf(environment, importance, sine)
