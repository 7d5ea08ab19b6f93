"""What clear materials do to light of each wavelength: their index of refraction.

In a lens file, or as the `ior` of a material:

    1.5168                                    # the same for all wavelengths
    N-BK7                                     # a glass of the catalogue
    {index: 1.5168, abbe: 64.17}              # at the d line, and the Abbe number V = (n_d - 1) / (n_F - n_C)
    {cauchy: [1.5046, 0.0042]}                # n = A + B / l^2 + C / l^4, with l in micrometres
    {sellmeier: {b: [1.03961212, 0.231792344, 1.01046945], c: [0.00600069867, 0.0200179144, 103.560653]}}

Wavelengths are nanometres, in air.

References: Born, Wolf 1999, "Principles of Optics", 7th ed., sec. 2.3.4; Sellmeier 1871; Cauchy 1836.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

LINE_D = 587.5618
"""The yellow line of helium (nm), at which glasses are told by one index."""

LINE_F = 486.1327
"""The blue line of hydrogen (nm)."""

LINE_C = 656.2725
"""The red line of hydrogen (nm)."""


class Glass(NamedTuple):
    """A clear material: n^2 = base + sum of b l^2 / (l^2 - c), or n = base + sum of a_k / l^2k; l in micrometres.

    name : as messages and reports call it.
    base : the constant term.
    b, c : of Sellmeier's formula, c in square micrometres; empty for Cauchy's.
    a : of Cauchy's formula, a_k in micrometres^2k; empty for Sellmeier's.
    """

    name: str
    base: float
    b: tuple[float, ...] = ()
    c: tuple[float, ...] = ()
    a: tuple[float, ...] = ()

    def disperses(self) -> bool:
        """Whether the index depends on the wavelength."""
        return any(self.b) or any(self.a)

    def ior(self, wavelength: ArrayLike = LINE_D) -> NDArray[np.float64]:
        """Index of refraction at wavelengths (nm), of their shape."""
        square = (1e-3 * np.asarray(wavelength, np.float64)) ** 2
        if self.b:
            terms = sum((b * square / (square - c) for b, c in zip(self.b, self.c, strict=True)), np.zeros_like(square))
            return np.asarray(np.sqrt(self.base + terms))
        terms = sum((a / square**power for power, a in enumerate(self.a, start=1)), np.zeros_like(square))
        return np.asarray(self.base + terms)

    def abbe(self) -> float:
        """The Abbe number V_d; infinite for what does not disperse."""
        d, f, c = (float(self.ior(line)) for line in (LINE_D, LINE_F, LINE_C))
        return (d - 1.0) / (f - c) if f != c else float("inf")


AIR = Glass("air", 1.0)


def constant(ior: float) -> Glass:
    """What has the same index for all wavelengths."""
    return AIR if ior == 1.0 else Glass(f"{ior:g}", ior)


def of_abbe(index: float, abbe: float) -> Glass:
    """Cauchy's formula with two terms, through n_d and V_d."""
    d, f, c = (1e-3 * line for line in (LINE_D, LINE_F, LINE_C))
    b = (index - 1.0) / abbe / (f**-2 - c**-2)
    return Glass(f"{index:g}/{abbe:g}", index - b / d**2, a=(b,))


CATALOGUE: Mapping[str, Glass] = {
    "N-BK7": Glass(
        "N-BK7",
        1.0,
        (1.03961212, 0.231792344, 1.01046945),
        (0.00600069867, 0.0200179144, 103.560653),
    ),
}
"""Common glasses by name."""


def glass_of(value: Any) -> Glass:
    """The glass that a scene or a lens file means by a number, a name or a mapping.

    Raises
    ------
    ValueError : what is wrong with it; a name that is not known comes with the nearest one that is.
    """
    if isinstance(value, Glass):
        return value
    if isinstance(value, str):
        return CATALOGUE[value]
    return constant(float(value))
