"""Phase function of Henyey and Greenstein, the distribution of scattered light over directions.

Cosines are between the directions of travel before and after, so g > 0 scatters forwards, and g is the mean cosine.

References: Henyey, Greenstein 1941, "Diffuse Radiation in the Galaxy", Astrophysical Journal 93, eq. 2.
"""

import math

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.sampling.warp import sin_cos_turn
from raytracer.core.vec import Vec3, add, basis, dot, neg, sub, to_world


@kernel
def pdf_henyey_greenstein(direction: Vec3, outgoing: Vec3, g: float) -> float:
    """Evaluate the phase function (1/sr), which integrates to 1 and is the density of its samples; 0 for g = +-1.

    All light goes one way then, without a density.  The denominator 1 + g^2 - 2 g cos is taken from the difference of
    the directions, which cancels nothing where the lobe is narrow.
    """
    if abs(g) == 1.0:
        return 0.0
    # 1 - |g| cos, measured from the direction that most light goes to.
    across = sub(direction, outgoing) if g > 0.0 else add(direction, outgoing)
    narrow = 1.0 - abs(g)
    squared = narrow * narrow + abs(g) * dot(across, across)
    return (1.0 - g * g) / (4.0 * math.pi * squared * math.sqrt(squared))


@kernel
def sample_henyey_greenstein(direction: Vec3, g: float, u1: float, u2: float) -> tuple[Vec3, float]:
    """Sample (direction, pdf) of light that travelled along `direction`; the pdf is infinite for g = +-1.

    1 + cos and 1 - cos come as products, so that neither a narrow lobe nor g near 0 cancels: with the usual
    cos = (1 + g^2 - q^2) / 2g and q = (1 - g^2) / r, r = 1 - g + 2 g u, they are

        1 + cos = 2 u (1 + g)^2 (1 - g + g u) / r^2,    1 - cos = 2 (1 - u) (1 - g)^2 (1 + g u) / r^2.

    References: Pharr et al. 2023, "Physically Based Rendering", 4th ed., sec. 11.3.1, for the usual form.
    """
    if g == 1.0:
        return direction, math.inf
    if g == -1.0:
        return neg(direction), math.inf
    r = 1.0 - g + 2.0 * g * u1
    above = 2.0 * u1 * (1.0 - g + g * u1) * ((1.0 + g) / r) ** 2
    below = 2.0 * (1.0 - u1) * (1.0 + g * u1) * ((1.0 - g) / r) ** 2
    radius, (sine, cosine) = math.sqrt(above * below), sin_cos_turn(u2)
    s, t = basis(direction)
    outgoing = to_world((radius * cosine, radius * sine, 0.5 * (above - below)), s, t, direction)
    spread = (1.0 - g) * (1.0 + g)
    return outgoing, r * r * r / (4.0 * math.pi * spread * spread)
