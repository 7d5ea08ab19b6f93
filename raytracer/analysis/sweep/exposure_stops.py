"""Exposure stops: steps that halve or double the light, and the rounded numbers that are engraved for them.

References: ISO 517:2008, "Photography - Apertures and related properties pertaining to photographic lenses"; ISO
516:2019, "Camera shutters - Timing"; ISO 12232:2019 (speeds).
"""

import math
from collections.abc import Mapping
from fractions import Fraction
from typing import NamedTuple

# Distance from an integer number of steps that two ends may have, as a part of a step, if one is no engraved number.
_TOLERANCE = 0.1

_PARTS = {1: "full stops", 2: "half stops", 3: "thirds of a stop"}


class StopScale(NamedTuple):
    """Scale of stops of a quantity.

    power : log2 of the factor between values that are a stop apart.
    base : the value at 0 stops.
    unit : of plain numbers.
    marks : by parts of a stop, the place of the first mark in those parts, and the engraved numbers from there on.
    """

    power: Fraction
    base: float = 1.0
    unit: str = ""
    marks: Mapping[int, tuple[int, str]] = {}

    def value(self, place: Fraction | float) -> float:
        """Compute the value so many stops from the base."""
        return self.base * math.exp2(self.power * place)

    def places(self, number: float, parts: int) -> list[Fraction]:
        """List the places (stops from the base) at which a number is engraved, the likeliest first."""
        engraved = self._engraved(parts)
        return list(dict.fromkeys(place for place, mark in engraved if float(Fraction(mark)) == number))

    def mark(self, place: Fraction, parts: int) -> str:
        """Return the number that is engraved at so many stops; "" if none is."""
        return next((mark for there, mark in self._engraved(parts) if there == place), "")

    def _engraved(self, parts: int) -> list[tuple[Fraction, str]]:
        """List places and numbers of each series, that of `parts` first."""
        order = sorted(self.marks, key=lambda part: (part != parts, part))
        return [
            (Fraction(self.marks[part][0] + i, part), mark)
            for part in order
            for i, mark in enumerate(self.marks[part][1].split())
        ]


_F_NUMBERS = StopScale(
    Fraction(1, 2),
    marks={
        1: (-2, "0.5 0.7 1 1.4 2 2.8 4 5.6 8 11 16 22 32 45 64 90 128"),
        2: (-4, "0.5 0.6 0.7 0.8 1 1.2 1.4 1.7 2 2.4 2.8 3.3 4 4.8 5.6 6.7 8 9.5 11 13 16 19 22 27 32 38 45 54 64"),
        3: (
            -6,
            """0.5 0.56 0.63 0.7 0.8 0.9 1 1.1 1.2 1.4 1.6 1.8 2 2.2 2.5 2.8 3.2 3.5 4 4.5 5 5.6 6.3 7.1 8 9 10 11 13
            14 16 18 20 22 25 29 32 36 40 45 51 57 64""",
        ),
    },
)
_TIMES = StopScale(
    Fraction(1),
    unit="s",
    marks={
        1: (-13, "1/8000 1/4000 1/2000 1/1000 1/500 1/250 1/125 1/60 1/30 1/15 1/8 1/4 1/2 1 2 4 8 15 30 60"),
        2: (
            -26,
            """1/8000 1/6000 1/4000 1/3000 1/2000 1/1500 1/1000 1/750 1/500 1/350 1/250 1/180 1/125 1/90 1/60 1/45 1/30
            1/20 1/15 1/10 1/8 1/6 1/4 0.3 1/2 0.7 1 1.5 2 3 4 6 8 10 15 20 30""",
        ),
        3: (
            -39,
            """1/8000 1/6400 1/5000 1/4000 1/3200 1/2500 1/2000 1/1600 1/1250 1/1000 1/800 1/640 1/500 1/400 1/320 1/250
            1/200 1/160 1/125 1/100 1/80 1/60 1/50 1/40 1/30 1/25 1/20 1/15 1/13 1/10 1/8 1/6 1/5 1/4 0.3 0.4 1/2 0.6
            0.8 1 1.3 1.6 2 2.5 3.2 4 5 6 8 10 13 15 20 25 30""",
        ),
    },
)
_SPEEDS = StopScale(
    Fraction(1),
    base=100.0,
    marks={
        1: (-2, "25 50 100 200 400 800 1600 3200 6400 12800 25600 51200 102400"),
        2: (
            -4,
            """25 35 50 70 100 140 200 280 400 560 800 1100 1600 2200 3200 4500 6400 9000 12800 18000 25600 36000
            51200""",
        ),
        3: (
            -6,
            """25 32 40 50 64 80 100 125 160 200 250 320 400 500 640 800 1000 1250 1600 2000 2500 3200 4000 5000 6400
            8000 10000 12800 16000 20000 25600 32000 40000 51200 64000 80000 102400""",
        ),
    },
)
STOP_SCALES = {
    "f_number": _F_NUMBERS,
    "aperture": StopScale(Fraction(1, 2)),
    "shutter": _TIMES,
    "duration": _TIMES,
    "iso": _SPEEDS,
    "intensity": StopScale(Fraction(1)),
    "irradiance": StopScale(Fraction(1)),
    "radiance": StopScale(Fraction(1)),
}
"""Scales of stops, by the last step of a key."""


class StopSeries(NamedTuple):
    """Values that are a stop, or a part of one, apart.

    marks : engraved number of each value; "" for none.
    """

    values: list[float]
    marks: list[str]


def stops(scale: StopScale, start: float, stop: float, parts: int) -> StopSeries:
    """Compute the values from `start` to `stop`, both included, `parts` to a stop.

    An engraved end stands for its exact value; where neither is engraved, steps are counted from the start.

    Raises
    ------
    ValueError : `parts` is not 1, 2 or 3, or the ends are not an integer number of steps apart.
    """
    if parts not in _PARTS:
        raise ValueError(f"divides stops by {parts}; they can be divided into halves or thirds: /2 or /3")
    sign = 1 if stop > start else -1
    begins, ends = scale.places(start, parts), scale.places(stop, parts)
    apart = [(begin, (end - begin) * parts * sign) for begin in begins for end in ends]
    for begin, count in apart:
        if count >= 1 and count.denominator == 1:
            places = [begin + Fraction(sign * i, parts) for i in range(int(count) + 1)]
            return StopSeries([scale.value(place) for place in places], [scale.mark(place, parts) for place in places])
    if not apart:
        ratio = math.log2(stop / start) / float(scale.power) * parts * sign
        if round(ratio) >= 1 and abs(ratio - round(ratio)) <= _TOLERANCE:
            steps = [Fraction(sign * i, parts) for i in range(round(ratio) + 1)]
            return StopSeries([start * math.exp2(scale.power * step) for step in steps], [""] * len(steps))
        scale = scale if begins else scale._replace(base=start, marks={})
        apart = [(begins[0] if begins else Fraction(0), Fraction(ratio))]

    # Say where it could end.
    begin, count = apart[0]
    near = [begin + Fraction(sign * end, parts) for end in (math.floor(count), math.ceil(count)) if end]
    raise ValueError(
        f"is {float(count) / parts:.3g} stops, which is not an integer number of {_PARTS[parts]}; end at "
        + " or ".join(scale.mark(place, parts) or f"{scale.value(place):.3g}" for place in near)
    )
