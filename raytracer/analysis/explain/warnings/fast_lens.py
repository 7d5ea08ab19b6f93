"""Warn of f-numbers that no lens can have."""

import math

from raytracer.analysis.explain.warnings import Photograph, PhotographicWarningKind
from raytracer.report.wording import compact_number
from raytracer.schema.warning_kind import Sentence, Warned

_FASTEST_F_NUMBER = 0.5
"""Least f-number of a lens in air that is free of coma: Born, Wolf 1999, "Principles of Optics", 7th ed., 4.8.2."""


class FastLens(PhotographicWarningKind):
    """Ideal lenses faster than real ones can be."""

    name = "lenses faster than lenses can be"
    rank = 20
    fast = Sentence(
        "f/{f_number} is faster than f/{limit:g}, which no lens in air can be: the ideal lens has no such limit",
        when="the f-number is below that of a lens that is free of coma, 1 / (2 sin 90 deg)",
        remedy="a larger `f_number`",
    )

    def find(self, subject: Photograph) -> Warned:
        f_number = subject.numbers.get("f_number", math.nan)
        if f_number < _FASTEST_F_NUMBER:
            yield self.record(self.fast.fill(f_number=compact_number(f_number), limit=_FASTEST_F_NUMBER))
