"""Tone curves: from the linear values of a picture to those that a display shows.

In a scene:

    film: {width: 1200, height: 800, tone_curve: filmic}
    film: {width: 1200, height: 800, tone_curve: {type: filmic, white: 8}}

A tone curve changes display values only, in .png and .jpg files and notebooks; linear files are the same without it.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, core_schema

from raytracer.optics.thin_lens import MEAN_EXPOSURE, SATURATION_EXPOSURE
from raytracer.schema.fields import Quantity
from raytracer.schema.rules import never
from raytracer.schema.spec import Spec

GREY_IN = MEAN_EXPOSURE / SATURATION_EXPOSURE
"""Linear value of middle grey, 10 / 78 of saturation: ISO 12232:2019."""

GREY_OUT = 0.18
"""Display value of it: 0.461 of its range in sRGB, to which ISO 12232:2019 ties the exposure 10 / S_SOS."""

# Shoulder strength, linear strength and angle, toe strength, numerator and denominator: Hable 2010.
_A, _B, _C, _D, _E, _F = 0.15, 0.50, 0.10, 0.20, 0.02, 0.30

# The curve U(x) = (x (A x + C B) + D E) / (x (A x + B) + D F) - E / F as one fraction.
_ABOVE = Polynomial([0.0, _B * (_C - _E / _F), _A * (1.0 - _E / _F)])
_BELOW = Polynomial([_D * _F, _B, _A])


@dataclass(frozen=True)
class Filmic:
    """The response of film: a toe, and a shoulder that bends highlights towards white.

    It is Hable's curve U(b x) / U(b white), for each channel, with the b that maps middle grey, 10 / 78 of saturation,
    to 0.18.

    white : the value, at least 1, that becomes white; larger values are clipped.

    References: Hable 2010, "Uncharted 2: HDR Lighting", Game Developers Conference.
    """

    white: float

    @cached_property
    def _scale(self) -> float:
        # U(b grey) = 0.18 U(b white), times both denominators, is a cubic in b with one positive root.
        def of_b(curve: Polynomial, x: float) -> Polynomial:
            return curve(Polynomial([0.0, x]))

        grey = of_b(_ABOVE, GREY_IN) * of_b(_BELOW, self.white)
        white = of_b(_ABOVE, self.white) * of_b(_BELOW, GREY_IN)
        roots = (grey - GREY_OUT * white).roots()
        positive = roots[roots.real > 0.0]
        return float(positive[np.argmin(np.abs(positive.imag))].real)

    def __call__(self, linear: ArrayLike) -> NDArray[np.float64]:
        """Map linear values of any shape to linear display values in 0..1; NaN stays."""
        x = self._scale * np.clip(np.asarray(linear, dtype=np.float64), 0.0, self.white)
        white = self._scale * self.white
        return np.asarray(_ABOVE(x) / _BELOW(x) * (_BELOW(white) / _ABOVE(white)))


class ToneCurveSpec(Spec):
    """A tone curve for display: linear values as they are, clipped at 1, or as film would show them."""

    type: Literal["linear", "filmic"] = Field(
        default="linear", description="`linear`, clipped at 1; or `filmic`, with a toe and a shoulder"
    )
    white: Annotated[float, Quantity(low=1.0, high=1e6)] | None = Field(
        default=None,
        description="value that `filmic` shows as white, the sensor's saturation being 1; default: 1 where the sensor "
        "is simulated, else 4",
    )

    _white_of_film = never(
        "white", where={"type": "linear"}, message="only the tone curve filmic has a white: a linear one clips at 1"
    )

    def curve(self, *, saturates: bool) -> Filmic | None:
        """Make the curve; None if it is linear.  `saturates` : whether no value is beyond 1."""
        if self.type == "linear":
            return None
        return Filmic(self.white if self.white is not None else 1.0 if saturates else 4.0)


class _Shorthand:
    """Annotation of a tone curve: a bare name stands for a mapping of that type."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_before_validator_function(
            lambda value: {"type": value} if isinstance(value, str) else value, handler(source)
        )

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        return {"anyOf": [{"enum": ["linear", "filmic"]}, handler(schema)]}


ToneCurveField: TypeAlias = Annotated[ToneCurveSpec, _Shorthand()]
