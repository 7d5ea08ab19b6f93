"""Warps of uniform numbers to distributions, each with its density beside it."""

import math

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.vec import Vec3


@kernel
def sin_cos_octant(angle: float) -> tuple[float, float]:
    """Compute sine and cosine of an angle within +-pi/4, to a rounding each.

    The library's functions, which reduce any angle first and are not inlined, took 9 % of the cover's time.

    References: the minimax polynomials of fdlibm (Sun Microsystems 1993), k_sin.c and k_cos.c.
    """
    z = angle * angle
    sine = -2.50507602534068634195e-08 + z * 1.58969099521155010221e-10
    sine = 8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04 + z * (2.75573137070700676789e-06 + z * sine))
    cosine = -2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)
    cosine = -1.38888888888741095749e-03 + z * (2.48015872894767294178e-05 + z * cosine)
    cosine = 4.16666666666666019037e-02 + z * cosine
    sine = angle + angle * z * (-1.66666666666666324348e-01 + z * sine)
    # 1 - z / 2 loses digits that the next terms are added to.
    half = 0.5 * z
    rest = 1.0 - half
    return sine, rest + (((1.0 - rest) - half) + z * z * cosine)


@kernel
def sin_cos_turn(turn: float) -> tuple[float, float]:
    """Compute sine and cosine of a number of turns, from 0 to 1."""
    quarter = int(4.0 * turn + 0.5)
    sine, cosine = sin_cos_octant(2.0 * math.pi * (turn - 0.25 * quarter))
    # A quarter turn takes (sine, cosine) to (cosine, -sine).
    if quarter % 2 == 1:
        sine, cosine = cosine, -sine
    return (-sine, -cosine) if (quarter // 2) % 2 == 1 else (sine, cosine)


@kernel
def sample_disc(u1: float, u2: float) -> tuple[float, float]:
    """Sample a point of the unit disc, uniform by area: squares round (0.5, 0.5) become circles round (0, 0).

    References: Shirley, Chiu 1997, "A Low Distortion Map Between Disk and Square", JGT 2(3).
    """
    a, b = 2.0 * u1 - 1.0, 2.0 * u2 - 1.0
    if a == 0.0 and b == 0.0:
        return 0.0, 0.0
    # In the other two quarters x and y change places; selected, not branched on, since half of all samples are there.
    is_wide = abs(a) > abs(b)
    radius, less = (a, b) if is_wide else (b, a)
    sine, cosine = sin_cos_octant(math.pi / 4.0 * (less / radius))
    return (radius * cosine, radius * sine) if is_wide else (radius * sine, radius * cosine)


@kernel
def first_above(values, begin, end, value):
    """Find the first of the rising values begin .. end - 1 that is greater than `value`; `end` if none is."""
    while begin < end:
        middle = (begin + end) // 2
        if values[middle] > value:
            end = middle
        else:
            begin = middle + 1
    return begin


@kernel
def sample_bin(cumulative, begin, end, u):
    """Sample one of the bins begin .. end - 1 by a number in [0, 1); returns it and the position in it, 0 to 1.

    cumulative, probabilities (n,) of a bin or one before it from `begin` on; bins of no probability are never drawn.
    """
    low = first_above(cumulative, begin, end - 1, u)
    before = cumulative[low - 1] if low > begin else 0.0
    return low, (u - before) / (cumulative[low] - before)


def guide_table(cumulative: NDArray[np.float64]) -> NDArray[np.int32]:
    """Tabulate where `sample_guided_bin` begins its search: the first bin that ends above k / n, for k = 0 .. n - 1.

    cumulative (m, n) : probabilities of a bin or one before it, by row; so is the table, int32.

    References: Chen, Asau 1974, "On Generating Random Variates from an Empirical Distribution"; Devroye 1986,
    "Non-Uniform Random Variate Generation", sec. III.2.4 (method of guide tables).
    """
    n = cumulative.shape[1]
    starts = np.arange(n) / n
    rows = [np.searchsorted(row, starts, side="right") for row in cumulative]
    return np.asarray(np.minimum(np.array(rows), n - 1), np.int32)


@kernel
def sample_guided_bin(cumulative, guide, begin, end, u):
    """Sample the bin that `sample_bin` does, in constant time on average.

    guide : begin .. end - 1 are the row of a `guide_table`.
    """
    count = end - begin
    low = begin + np.int64(guide[begin + min(int(u * count), count - 1)])
    # Rounded, u n may be the next integer.
    while low > begin and cumulative[low - 1] > u:
        low -= 1
    while low < end - 1 and cumulative[low] <= u:
        low += 1
    before = cumulative[low - 1] if low > begin else 0.0
    return low, (u - before) / (cumulative[low] - before)


@kernel
def sample_sphere(u1: float, u2: float) -> Vec3:
    """Sample a point of the unit sphere, uniform by area.

    References: Archimedes, "On the Sphere and Cylinder": zones of equal height have equal areas.
    """
    z = 1.0 - 2.0 * u1
    radius = 2.0 * math.sqrt(u1 * (1.0 - u1))
    sine, cosine = sin_cos_turn(u2)
    return radius * cosine, radius * sine, z


@kernel
def sample_cosine_hemisphere(u1: float, u2: float) -> Vec3:
    """Sample a direction round +z, with a density in proportion to its cosine.

    References: Malley's method: Pharr et al. 2023, "Physically Based Rendering", 4th ed., A.5.3.
    """
    x, y = sample_disc(u1, u2)
    return x, y, math.sqrt(max(0.0, 1.0 - x * x - y * y))


@kernel
def pdf_cosine_hemisphere(cosine: float) -> float:
    """Return the density in solid angle, 0 below the horizon."""
    return max(0.0, cosine) / math.pi


@kernel
def sample_triangle(u1: float, u2: float) -> tuple[float, float]:
    """Sample barycentric (u, v) of a triangle, uniform by area: corner + u edge_1 + v edge_2, u + v <= 1.

    References: Heitz 2019, "A Low-Distortion Map Between Triangle and Square".
    """
    if u2 > u1:
        u1 *= 0.5
        u2 -= u1
    else:
        u2 *= 0.5
        u1 -= u2
    return u1, u2


@kernel
def one_minus_cosine(sin2: float) -> float:
    """Compute 1 - cos of an angle up to 90 degrees from its sin^2, without cancellation for small ones."""
    return sin2 / (1.0 + math.sqrt(1.0 - sin2))


@kernel
def sample_cone(u1: float, u2: float, sin2_max: float) -> Vec3:
    """Sample a direction in the cone round +z whose edge has the squared sine `sin2_max`, uniform by solid angle.

    The sine comes from 1 - cos, not from the cosine, which is 1 to the last bit in a narrow cone.

    References: Pharr et al. 2023, "Physically Based Rendering", 4th ed., A.5.4.
    """
    height = u1 * one_minus_cosine(sin2_max)
    radius = math.sqrt(height * (2.0 - height))
    sine, cosine = sin_cos_turn(u2)
    return radius * cosine, radius * sine, 1.0 - height


@kernel
def pdf_cone(sin2_max: float) -> float:
    """Return the density in solid angle of a direction in the cone; infinite for a cone of no width."""
    return 1.0 / (2.0 * math.pi * one_minus_cosine(sin2_max))
