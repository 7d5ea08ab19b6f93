"""Refraction and reflectance of smooth boundaries: Snell's law and Fresnel's equations; and luminance."""

import math

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.vec import Vec3, madd, renormalize, scale

REC709_LUMINANCE = (0.2126, 0.7152, 0.0722)
"""Luminance of the primaries of linear Rec. 709: ITU-R BT.709-6, item 3.2."""


@kernel
def fresnel_dielectric(cos_i: float, eta: float) -> tuple[float, float]:
    """Compute the unpolarised reflectance of a boundary, and the cosine of refraction, at |cos_i| <= 1.

    Parameters
    ----------
    cos_i : cosine between the ray and the normal on its side, in [0, 1].
    eta : index on the far side over the index on the near side.

    Returns
    -------
    (reflectance, cosine of refraction); (1, 0) at total internal reflection, (0, cos_i) where eta is 1.

    References: Pharr et al. 2023, "Physically Based Rendering", 4th ed., eq. 9.5-9.6.
    """
    # No boundary at all: the formula below is 0/0 at grazing incidence.
    if eta == 1.0:
        return 0.0, cos_i
    sin2_t = (1.0 - cos_i) * (1.0 + cos_i) / (eta * eta)
    if sin2_t >= 1.0:
        return 1.0, 0.0
    cos_t = math.sqrt(1.0 - sin2_t)
    parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t)
    perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t)
    return 0.5 * (parallel * parallel + perpendicular * perpendicular), cos_t


@kernel
def refract(direction: Vec3, normal: Vec3, cos_i: float, cos_t: float, eta: float) -> Vec3:
    """Refract a direction of travel at a boundary, for a unit `normal` against `direction`.

    References: Pharr et al. 2023, eq. 9.4.
    """
    # An error e of the length of `direction` comes out as e / eta^2 at normal incidence: through 40 surfaces out of
    # glass in glass, rounding alone would grow to a length of 0.
    return renormalize(madd(scale(1.0 / eta, direction), cos_i / eta - cos_t, normal))


@kernel
def _fresnel_metal(cos_i: float, eta: float, k: float) -> float:
    # (n - ik)^2 - sin^2 = (a - ib)^2; the smaller of a and b from the larger, lest it cancel.
    sin2 = (1.0 - cos_i) * (1.0 + cos_i)
    real, product = eta * eta - k * k - sin2, eta * k
    larger2 = 0.5 * (math.hypot(real, 2.0 * product) + abs(real))
    smaller2 = product * product / larger2 if larger2 > 0.0 else 0.0
    a2, b2 = (larger2, smaller2) if real > 0.0 else (smaller2, larger2)
    a = math.sqrt(a2)
    # No boundary at all: the formula is 0/0 at grazing incidence.
    if a + b2 + cos_i == 0.0:
        return 0.0
    perpendicular = ((a - cos_i) ** 2 + b2) / ((a + cos_i) ** 2 + b2)
    above, below = (a * cos_i - sin2) ** 2 + b2 * cos_i * cos_i, (a * cos_i + sin2) ** 2 + b2 * cos_i * cos_i
    # Head on, no plane of incidence tells parallel from perpendicular.
    return 0.5 * perpendicular * (1.0 + above / below) if below > 0.0 else perpendicular


@kernel
def fresnel_conductor(cos_i: float, eta: Vec3, k: Vec3) -> Vec3:
    """Compute the unpolarised reflectance of a metal in air with indices n - ik by channel, at a cosine in [0, 1].

    References: Born, Wolf 1999, "Principles of Optics", 7th ed., sec. 14.2.
    """
    return (
        _fresnel_metal(cos_i, eta[0], k[0]),
        _fresnel_metal(cos_i, eta[1], k[1]),
        _fresnel_metal(cos_i, eta[2], k[2]),
    )


SCHLICK_MEAN = 1.0 / 21.0
"""The cosine-weighted mean of `schlick_weight` over a hemisphere."""


@kernel
def schlick_weight(cos_i: float) -> float:
    """Compute (1 - cos)^5: the rise of reflectance, in Schlick's fit, from normal incidence (0) to grazing (1).

    A cosine of vectors that rounding has left above 1 counts as 1.
    """
    rest = 1.0 - min(1.0, cos_i)
    return rest * rest * rest * rest * rest


@kernel
def fresnel_schlick_mean(normal_reflectance: Vec3) -> Vec3:
    """Compute the cosine-weighted mean over a hemisphere of `fresnel_schlick`, by channel."""
    r, g, b = normal_reflectance
    return (r + (1.0 - r) * SCHLICK_MEAN, g + (1.0 - g) * SCHLICK_MEAN, b + (1.0 - b) * SCHLICK_MEAN)


@kernel
def fresnel_schlick(cos_i: float, normal_reflectance: Vec3) -> Vec3:
    """Approximate the unpolarised reflectance at an angle, by channel, from that at normal incidence.

    References: Schlick 1994, "An Inexpensive BRDF Model for Physically-based Rendering", CGF 13(3), eq. 15.
    """
    part = schlick_weight(cos_i)
    r, g, b = normal_reflectance
    return (r + (1.0 - r) * part, g + (1.0 - g) * part, b + (1.0 - b) * part)
