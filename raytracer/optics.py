"""What light does at a smooth boundary: Snell's law and Fresnel's equations."""

import math

from raytracer.jit import kernel
from raytracer.vec import Vec3, madd, scale


@kernel
def fresnel_dielectric(cos_i: float, eta: float) -> tuple[float, float]:
    """Unpolarised reflectance of a boundary and the cosine of refraction, for light that arrives at |cos_i| <= 1.

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
    """Direction of travel behind a boundary, for a unit `normal` against `direction`.

    References: Pharr et al. 2023, eq. 9.4.
    """
    return madd(scale(1.0 / eta, direction), cos_i / eta - cos_t, normal)
