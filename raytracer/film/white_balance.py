"""White balance: the gains by which some light becomes white.

In a scene:

    film: {width: 1200, height: 800, white_balance: 3200 K}
    film: {width: 1200, height: 800, white_balance: auto}
    film: {width: 1200, height: 800, white_balance: [0.6, 1.0, 2.4]}

Each channel is multiplied by a gain of its own, as cameras do (von Kries).  The gains for a temperature, and those that
`auto` finds, keep the luminance of that light.
"""

from typing import Annotated, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic.json_schema import JsonSchemaValue

from raytracer.film.exposure import luminance
from raytracer.schema.fields import Check, Quantity, Triple, Vector
from raytracer.util.errors import format_value

FloatArray = NDArray[np.float64]

AUTO = "auto"

_COOLEST, _HOTTEST = 2000.0, 25000.0
_DAYLIGHT_FROM_K = 4000.0

# Linear Rec. 709 of CIE XYZ: the inverse of what its primaries and white, D65, have (IEC 61966-2-1:1999, sec. 5.2).
_TO_REC709 = np.array(
    [
        [3.2404542, -1.5371385, -0.4985314],
        [-0.9692660, 1.8760108, 0.0415560],
        [0.0556434, -0.2040259, 1.0572252],
    ]
)


class _WhiteBalanceCheck(Check):
    """A temperature, three gains, or `auto`."""

    _temperature = Quantity("temperature", low=_COOLEST, high=_HOTTEST)
    _gains = Triple(Quantity(low=0.0, low_open=True), "gains")

    def __call__(self, value: Any) -> float | Vector | str:
        """Check a value; a ValueError says that it is none of the three."""
        if value == AUTO:
            return AUTO
        if isinstance(value, list | tuple):
            return self._gains(value)
        if isinstance(value, str) and value.isalpha():
            raise ValueError(
                f"must be auto, a colour temperature such as 3200 K, or three gains, got {format_value(value)}"
            )
        return self._temperature(value)

    def json_schema(self) -> JsonSchemaValue:
        """Describe any of the three."""
        temperature = self._temperature.json_schema()
        temperature.pop("x-unit", None)
        return {"anyOf": [{"const": AUTO}, *temperature["anyOf"], self._gains.json_schema()]}


WhiteBalance: TypeAlias = float | Vector | str
"""A temperature (K), gains of red, green and blue, or `auto`."""

WhiteBalanceField: TypeAlias = Annotated[WhiteBalance, _WhiteBalanceCheck()]


def chromaticity(temperature: float) -> tuple[float, float]:
    """Compute CIE 1931 x and y of a colour temperature (K): a black body below 4000 K, daylight from there on.

    References: Kim et al. 2002, "Design of Advanced Color Temperature Control System for HDTV Applications", J. Korean
        Phys. Soc. 41(6), 865-871 (black body, from 1667 K on); CIE 15:2018, "Colorimetry", sec. 4.1.2 (daylight,
        up to 25000 K).
    """
    t = 1e3 / temperature
    if temperature < _DAYLIGHT_FROM_K:
        x = -0.2661239 * t**3 - 0.2343589 * t**2 + 0.8776956 * t + 0.179910
        if temperature < 2222.0:
            return x, -1.1063814 * x**3 - 1.34811020 * x**2 + 2.18555832 * x - 0.20219683
        return x, -0.9549476 * x**3 - 1.37418593 * x**2 + 2.09137015 * x - 0.16748867
    if temperature <= 7000.0:
        x = -4.6070 * t**3 + 2.9678 * t**2 + 0.09911 * t + 0.244063
    else:
        x = -2.0064 * t**3 + 1.9018 * t**2 + 0.24748 * t + 0.237040
    return x, -3.000 * x * x + 2.870 * x - 0.275


def illuminant_rgb(temperature: float) -> FloatArray:
    """Compute light of a colour temperature (K) from 2000 to 25000: linear Rec. 709 (3,) of luminance 1."""
    x, y = chromaticity(temperature)
    color = _TO_REC709 @ np.array([x / y, 1.0, (1.0 - x - y) / y])
    return np.asarray(color / luminance(color))


def balance_gains(balance: WhiteBalance, values: FloatArray) -> FloatArray:
    """Compute gains (3,) of red, green and blue for a picture of linear `values` (height, width, 3).

    `auto` makes the mean of the picture grey; a channel without light has the gain 1.

    References: Buchsbaum 1980, "A spatial processor model for object colour perception", J. Franklin Institute 310(1)
        (the world is grey on average).
    """
    if isinstance(balance, tuple):
        return np.array(balance)
    # A negative mean, of colours outside of Rec. 709, counts as no light.
    white = np.maximum(values.mean(axis=(0, 1)), 0.0) if isinstance(balance, str) else illuminant_rgb(balance)
    return np.divide(luminance(white), white, out=np.ones(3), where=white > 0.0)
