"""Antireflection coatings: one thin layer on a surface of a lens, and the reflectance with and without it.

In a lens file:

    - {type: spherical, radius: 29.475, thickness: 3.76, material: 1.67, aperture: 25.2, coating: mgf2}

The layer is a quarter of a wave thick at the wavelength it is made for, so that there what its two sides reflect
cancels as far as it can, head on.  Away from that wavelength more is left, at both ends of the spectrum: coated lenses
look purple.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import kernel, optional
from raytracer.core.fresnel import fresnel_dielectric


class Coating(NamedTuple):
    """A quarter-wave layer.

    wavelength (nm) : in air, of which it is a quarter thick.
    ior : its index of refraction.

    The default is magnesium fluoride, for the green to which eyes are most sensitive; its index (of the ordinary ray)
    is within 0.005 of 1.38 from 400 to 700 nm.

    References: Dodge 1984, "Refractive properties of magnesium fluoride", Applied Optics 23(12).
    """

    wavelength: float = 550.0
    ior: float = 1.38


class Coatings(NamedTuple):
    """Packed coatings of all surfaces.

    wavelength (nm) : float64 (n,), of which the layer is a quarter thick; 0 for a bare surface.
    ior : float64 (n,), index of refraction of the layer.
    """

    wavelength: NDArray[np.float64]
    ior: NDArray[np.float64]


def pack_coatings(coatings: Sequence[Coating | None], ior: Sequence[float]) -> Coatings | None:
    """Pack the coatings of a lens's surfaces, from the front to the film; None if all are bare.

    ior : indices of refraction (n + 1,), before the first surface and behind each.

    Raises
    ------
    ValueError : a surface cannot be coated so, by its number from 1.
    """
    if not any(coatings):
        return None
    for number, coating in enumerate(coatings, start=1):
        if coating is not None:
            _check(f"surface {number}", coating, ior[number - 1], ior[number])
    rows = [coating or Coating(0.0, 1.0) for coating in coatings]
    return Coatings(*(np.array([float(row[column]) for row in rows]) for column in (0, 1)))


def _check(name: str, coating: Coating, near: float, far: float) -> None:
    """Check a layer: its numbers, and that it lies where no light could tunnel through it."""
    if not (math.isfinite(coating.wavelength) and coating.wavelength > 0.0):
        raise ValueError(f"{name} has a coating for the wavelength {coating.wavelength:g} nm, which is none")
    if not (math.isfinite(coating.ior) and coating.ior >= 1.0):
        raise ValueError(f"{name} has a coating of the index {coating.ior:g}, which is less than that of nothing")
    if near == far:
        raise ValueError(f"{name} has a coating, but no glass: the index is {near:g} on both sides")
    if min(near, far) > coating.ior:
        raise ValueError(f"{name} is between two glasses: a coating of the index {coating.ior:g} is one towards air")


@kernel
def _layer_reflectance(front: float, back: float, echo: float) -> float:
    """Compute the reflectance of a layer from the amplitudes of its sides, and the cosine of their phase difference."""
    both = 2.0 * front * back * echo
    return (front * front + back * back + both) / (1.0 + front * front * back * back + both)


@optional
def reflectance(coatings, surface, cos_i, near, far, wavelength):
    """Compute the unpolarised reflectance of a surface, and the cosine of refraction, for light at |cos_i| <= 1.

    Parameters
    ----------
    coatings : Coatings of the lens, or None if it has none.
    surface : which one it is.
    cos_i : cosine between the ray and the normal on its side, in [0, 1].
    near, far : indices of refraction before and behind the surface, as the light meets it.
    wavelength : in air (nm).

    Returns
    -------
    (reflectance, cosine of refraction); (1, 0) at total internal reflection.

    References: Born, Wolf 1999, "Principles of Optics", 7th ed., sec. 1.6.4, eq. 55-59.
    """
    return fresnel_dielectric(cos_i, far / near)


@reflectance.register(Coatings)
def reflectance_coatings(coatings, surface, cos_i, near, far, wavelength):
    bare, cos_t = fresnel_dielectric(cos_i, far / near)
    if coatings.wavelength[surface] == 0.0 or cos_t == 0.0:
        return bare, cos_t

    # Either side of the layer reflects; the light from its far side comes back later by twice its thickness.
    ior = coatings.ior[surface]
    cos_l = math.sqrt(1.0 - (1.0 - cos_i) * (1.0 + cos_i) * (near / ior) * (near / ior))
    echo = math.cos(math.pi * (coatings.wavelength[surface] / wavelength) * cos_l)
    parallel = _layer_reflectance(
        (ior * cos_i - near * cos_l) / (ior * cos_i + near * cos_l),
        (far * cos_l - ior * cos_t) / (far * cos_l + ior * cos_t),
        echo,
    )
    perpendicular = _layer_reflectance(
        (near * cos_i - ior * cos_l) / (near * cos_i + ior * cos_l),
        (ior * cos_l - far * cos_t) / (ior * cos_l + far * cos_t),
        echo,
    )
    return 0.5 * (parallel + perpendicular), cos_t
