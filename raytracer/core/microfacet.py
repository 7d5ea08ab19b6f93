"""Microfacet models of rough boundaries: GGX, Smith's shadowing, and multiple scattering between facets.

Directions are unit vectors in the frame of the surface, whose normal is +z; both point away from it.  alpha, the
square of a material's `roughness`, is the slope at which facets grow rare.

References: Walter et al. 2007, "Microfacet Models for Refraction through Rough Surfaces" (GGX, refraction); Heitz 2014,
"Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs", JCGT 3(2).
"""

import functools
import math
from collections.abc import Hashable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import entry, kernel, routine
from raytracer.core.fresnel import fresnel_dielectric, refract
from raytracer.core.sampling.warp import sin_cos_turn
from raytracer.core.vec import Vec3, add, dot, neg, norm, normalize, scale, sub, to_local

SMOOTH_ALPHA = 1e-3
"""Below this alpha a boundary counts as smooth: its lobe is far narrower than the sun seen from the earth."""


@kernel
def ggx(alpha: float, half: Vec3) -> float:
    """Compute the density of facets with the unit normal `half` per area of the surface and solid angle (1/sr).

    From the sine as well as from the cosine of the facet's slope, since 1 - cos^2 of a narrow lobe has few digits.

    References: Walter et al. 2007, eq. 33.
    """
    spread = half[0] * half[0] + half[1] * half[1] + alpha * alpha * half[2] * half[2]
    return alpha * alpha / (math.pi * spread * spread)


@kernel
def stretched(alpha: float, z: float) -> float:
    """Compute the length of a unit vector of height z whose tangential part is scaled by alpha: (1 + 2 Lambda) |z|.

    References: Heitz 2014, eq. 72 and 86.
    """
    return math.sqrt(z * z + alpha * alpha * (1.0 - z) * (1.0 + z))


@kernel
def masking(alpha: float, z: float) -> float:
    """Compute Smith's G1: the fraction of the facets turned to a direction of height z > 0 that is seen from there."""
    return 2.0 * z / (z + stretched(alpha, z))


@kernel
def shadowing(alpha: float, z_from: float, z_to: float) -> float:
    """Compute G2 / G1: the fraction of light from visible facets that leaves on the side that it came from.

    Heights above 0; both directions' heights of the same facet are taken into account.  It is 1 for light that came
    along the surface.

    References: Heitz 2014, eq. 99.
    """
    s_from, s_to = stretched(alpha, z_from), stretched(alpha, z_to)
    return z_to * (z_from + s_from) / (z_from * s_to + z_to * s_from)


@kernel
def reflection_density(alpha: float, z_from: float, z_to: float, half: Vec3) -> float:
    """Compute the density (1/sr) of light that mirrors of this `half` vector send to the other direction, once.

    D G2 / (4 cos): f cos of a surface of perfect mirrors.

    References: Walter et al. 2007, eq. 20, with G2 as in Heitz 2014, eq. 99.
    """
    s_from, s_to = stretched(alpha, z_from), stretched(alpha, z_to)
    return ggx(alpha, half) * z_to / (2.0 * (z_from * s_to + z_to * s_from))


@kernel
def sample_visible_normal(alpha: float, toward: Vec3, u1: float, u2: float) -> Vec3:
    """Sample a facet's normal, as often as facets are seen from `toward` (which is not below the surface).

    A cap of the unit sphere, at which mirrored light arrives in parallel, takes the place of the stretched facets.

    References: Dupuy, Benyoub 2023, "Sampling Visible GGX Normals with Spherical Caps", CGF 42(8).
    """
    x, y, z = normalize((alpha * toward[0], alpha * toward[1], toward[2]))
    sine, cosine = sin_cos_turn(u1)
    # The height of the mirrored direction, and that plus z, which is the height of the half vector: never below 0.
    rise = (1.0 - u2) * (1.0 + z)
    height = rise - z
    radius = math.sqrt(max(0.0, (1.0 - height) * (1.0 + height)))
    return normalize((alpha * (x + radius * cosine), alpha * (y + radius * sine), rise))


@kernel
def view_direction(direction: Vec3, s: Vec3, t: Vec3, normal: Vec3) -> Vec3:
    """Return the view direction of a ray along `direction`, in the surface's frame (s, t, normal).

    A shading normal may be turned away from it: such a direction is taken to be as far above the surface.
    """
    x, y, z = to_local(neg(direction), s, t, normal)
    return (x, y, abs(z))


@kernel
def reflect_about(toward: Vec3, half: Vec3) -> Vec3:
    """Reflect the direction `toward` about a facet with normal `half`."""
    return sub(scale(2.0 * dot(toward, half), half), toward)


@kernel
def half_vector(a: Vec3, b: Vec3) -> Vec3:
    """Compute the normal of the facets that mirror light from one direction to the other, neither below the surface.

    It is the surface's own where they are opposite along the surface, so that their sum has no direction left.
    """
    both = add(a, b)
    size = norm(both)
    return scale(1.0 / size, both) if size > 0.0 else (0.0, 0.0, 1.0)


# ---- Multiple scattering between facets
#
# Smith's model follows light to its first facet and drops what does not leave from there.  The part that is dropped of
# light which came from a height z is the deficit m(z); it is put back by a lobe that is a product of the deficits at
# both ends, which is reciprocal, and which gives back just m(z) of what came from z.
#
# References: Kulla, Conty 2017, "Revisiting Physically Based Shading at Imageworks", SIGGRAPH course.

_FINE, _COARSE = (4181, 2584), (1597, 987)
"""Fibonacci lattices over the facets seen, for one alpha and for each of many: number of points, and of turns.

They leave 6e-4 and 1.5e-3 of error at worst, where edges of lobes cross the square.
"""

_NODES = 128
"""The number of heights in a deficit table: interpolation is wrong by 6e-4 at worst, at 89.9 degrees."""

_GRID = 32
"""The number of values of alpha in a table, where a texture sets it."""


@entry
def _fill(alpha: float, eta: float, points: int, turns: int, cells: NDArray[np.float64]) -> None:
    """Fill the deficits, and the part that Schlick's fifth power keeps, of heights whose squares are in column 0.

    eta is the index behind the surface over the one before it; 0 stands for a surface of perfect mirrors.
    """
    for number in range(len(cells)):
        z = math.sqrt(cells[number, 0])
        toward = (math.sqrt(1.0 - cells[number, 0]), 0.0, z)
        kept = 0.0
        grazing = 0.0
        for point in range(points):
            turn = (point * turns) % points
            half = sample_visible_normal(alpha, toward, (turn + 0.5) / points, (point + 0.5) / points)
            cosine = min(1.0, dot(toward, half))
            mirrored = reflect_about(toward, half)
            leaves = shadowing(alpha, z, mirrored[2]) if mirrored[2] > 0.0 else 0.0
            if eta == 0.0:
                kept += leaves
                grazing += leaves * (1.0 - cosine) ** 5
                continue
            reflectance, cos_t = fresnel_dielectric(cosine, eta)
            kept += reflectance * leaves
            depth = -refract(neg(toward), half, cosine, cos_t, eta)[2]
            if reflectance < 1.0 and depth > 0.0:
                kept += (1.0 - reflectance) * masking(alpha, depth)
        cells[number, 1] = max(0.0, 1.0 - kept / points)
        cells[number, 3] = grazing / points


@functools.lru_cache(maxsize=4096)
def _deficit(alpha: float, eta: float, points: int, turns: int) -> NDArray[np.float64]:
    """Compute one row of `Deficits.cells`.

    Heights are dense where the deficit bends: near grazing, and, for narrow lobes, evenly in the angle of the stretched
    direction.
    """
    angle = np.linspace(0.0, 0.5 * np.pi, _NODES // 3)
    stretched_heights = alpha * np.sin(angle) / np.hypot(np.cos(angle), alpha * np.sin(angle))
    heights = np.unique(np.concatenate([stretched_heights, np.linspace(0.0, 1.0, 2 * _NODES // 3) ** 2]))
    while len(heights) < _NODES:
        widest = int(np.argmax(np.diff(heights)))
        heights = np.insert(heights, widest + 1, 0.5 * (heights[widest] + heights[widest + 1]))
    cells = np.zeros((_NODES, 4))
    cells[:, 0] = heights * heights
    _fill(alpha, eta, points, turns, cells)
    widths = np.diff(cells[:, 0])
    cells[1:, 2] = np.cumsum(0.5 * widths * (cells[:-1, 1] + cells[1:, 1]))
    cells.flags.writeable = False
    return cells


class Deficits(NamedTuple):
    """The deficits of the materials of a table.

    Attributes
    ----------
    cells : float64 (m, k, 4), a row an alpha: squared heights from 0 to 1; the deficit there, linear between them; its
        integral over the squared height from 0 on; of mirrors, the albedo of one reflection with the Fresnel term
        (1 - cos)^5.
    first, count : int32 (n,), the rows of each material: one, or `_GRID` of them evenly in log(alpha) from SMOOTH_ALPHA
        to 1; of materials with two sides, that many again for the back.
    """

    cells: NDArray[np.float64]
    first: NDArray[np.int32]
    count: NDArray[np.int32]  # type: ignore[assignment]  # takes the place of tuple.count


_LOSSLESS = np.pad(np.linspace(0.0, 1.0, _NODES)[:, None], ((0, 0), (0, 3)))
"""A row of `Deficits.cells` that loses nothing."""


def deficits(roughness: Sequence[float | None], etas: Sequence[tuple[float, ...] | None]) -> Deficits:
    """Compute the deficits of materials of these roughnesses; None stands for any that a texture may set.

    etas : by material, and for each side, the index behind it over the one before it, or 0 for a mirror; None where
        multiple scattering shall be lost: the deficit is then set to 0.
    """
    rows: list[NDArray[np.float64]] = []
    starts: dict[Hashable, int] = {}
    first, count = [], []
    for value, sides in zip(roughness, etas, strict=True):
        grid = np.geomspace(SMOOTH_ALPHA, 1.0, _GRID).tolist() if value is None else [max(SMOOTH_ALPHA, value * value)]
        if sides is None:
            grid = [1.0]
        key = (tuple(grid), sides)
        if key not in starts:
            starts[key] = len(rows)
            lattice = _FINE if len(grid) == 1 else _COARSE
            if sides is None:
                rows += [_LOSSLESS, _LOSSLESS]
            else:
                rows += [_deficit(alpha, eta, *lattice) for eta in sides for alpha in grid]
        first.append(starts[key])
        count.append(len(grid))
    return Deficits(np.array(rows), np.array(first, np.int32), np.array(count, np.int32))


class CellBlend(NamedTuple):
    """Two rows of cells between which an alpha lies, and the weight of the second."""

    low: np.int64
    high: np.int64
    blend: float


@kernel
def find_cells(table: Deficits, index: int, alpha: float, side: int) -> CellBlend:
    """Find the deficits of material `index`, on its front (side 0) or back (1), for an alpha."""
    count = table.count[index]
    first = table.first[index] + side * count
    if count == 1:
        return CellBlend(np.int64(first), np.int64(first), 0.0)
    place = (count - 1) * min(1.0, max(0.0, 1.0 - math.log(alpha) / math.log(SMOOTH_ALPHA)))
    low = min(np.int64(place), count - 2)
    return CellBlend(np.int64(first + low), np.int64(first + low + 1), place - low)


@kernel
def _cell(cells: NDArray[np.float64], row: np.int64, column: int, value: float) -> int:
    """Find the last cell at whose beginning the column is at most `value`."""
    low, high = 0, cells.shape[1] - 1
    while high - low > 1:
        middle = (low + high) // 2
        if cells[row, middle, column] <= value:
            low = middle
        else:
            high = middle
    return low


@routine
def _interpolated(cells: NDArray[np.float64], row: np.int64, column: int, square: float) -> float:
    at = _cell(cells, row, 0, square)
    part = (square - cells[row, at, 0]) / (cells[row, at + 1, 0] - cells[row, at, 0])
    value: float = cells[row, at, column] + part * (cells[row, at + 1, column] - cells[row, at, column])
    return value


@kernel
def _blended(cells: NDArray[np.float64], rows: CellBlend, column: int, z: float) -> float:
    square = min(1.0, z * z)
    value = _interpolated(cells, rows.low, column, square)
    if rows.blend == 0.0:
        return value
    return value + rows.blend * (_interpolated(cells, rows.high, column, square) - value)


@kernel
def deficit(cells: NDArray[np.float64], rows: CellBlend, z: float) -> float:
    """Return the fraction of light from a height z, in 0..1, that does not leave after its first facet.

    1 minus it is the directional albedo of one reflection (for a mirror), or of that and one refraction.
    """
    return _blended(cells, rows, 1, z)


@kernel
def grazing_albedo(cells: NDArray[np.float64], rows: CellBlend, z: float) -> float:
    """Return the directional albedo of mirrors that reflect the part (1 - cos)^5 of light: Schlick's second term.

    The albedo of facets with Schlick's Fresnel term is f0 (1 - deficit) + (1 - f0) times this.
    """
    return _blended(cells, rows, 3, z)


@kernel
def mean_deficit(cells: NDArray[np.float64], rows: CellBlend) -> float:
    """Return the deficit of light that comes evenly from all sides: its integral over the squared height."""
    last = cells.shape[1] - 1
    value: float = cells[rows.low, last, 2] + rows.blend * (cells[rows.high, last, 2] - cells[rows.low, last, 2])
    return value


@routine
def sample_deficit(cells: NDArray[np.float64], rows: CellBlend, u: float) -> float:
    """Sample a height z with a density of 2 z deficit(z) / mean_deficit: in solid angle that over 2 pi."""
    # Choose a row by its share.
    last = cells.shape[1] - 1
    low = (1.0 - rows.blend) * cells[rows.low, last, 2]
    target = u * (low + rows.blend * cells[rows.high, last, 2])
    row, rest = rows.low, target / (1.0 - rows.blend)
    if target >= low and rows.blend > 0.0:
        row, rest = rows.high, (target - low) / rows.blend

    # Within a cell the integral is a parabola; its root in the form that does not cancel.
    at = _cell(cells, row, 2, rest)
    rest -= cells[row, at, 2]
    start, width = cells[row, at, 1], cells[row, at + 1, 0] - cells[row, at, 0]
    slope = (cells[row, at + 1, 1] - start) / width
    root = start + math.sqrt(max(0.0, start * start + 2.0 * slope * rest))
    step = 2.0 * rest / root if root > 0.0 else 0.0
    return math.sqrt(cells[row, at, 0] + min(step, width))


@kernel
def multiple_albedo(mean_fresnel: Vec3, lost: float) -> Vec3:
    """Compute the fraction that metal facets reflect more than once, from mean Fresnel reflectance and `mean_deficit`.

    Light that is held back has been reflected once; then at each facet the part F is reflected, of which 1 - lost
    leaves: F^2 (1 - lost) (1 + F lost + ...).  It is 1 for perfect mirrors.

    References: Kulla, Conty 2017, with the reflection before the first escape counted too.
    """
    r, g, b = mean_fresnel
    keep = 1.0 - lost
    return (r * r * keep / (1.0 - r * lost), g * g * keep / (1.0 - g * lost), b * b * keep / (1.0 - b * lost))


@kernel
def sample_multiple_scattering(cells: NDArray[np.float64], rows: CellBlend, u: float, v: float) -> Vec3:
    """Sample a direction above the surface with a density of z deficit(z) / (pi mean_deficit) (1/sr)."""
    z = sample_deficit(cells, rows, u)
    radius = math.sqrt((1.0 - z) * (1.0 + z))
    sine, cosine = sin_cos_turn(v)
    return (radius * cosine, radius * sine, z)
