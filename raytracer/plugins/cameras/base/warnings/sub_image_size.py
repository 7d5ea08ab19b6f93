"""Warn of sub-images that overlap, or leave pixels dark."""

from raytracer.plugins.cameras.base.warnings import MicrolensFit, MicrolensWarningKind
from raytracer.schema.warning_kind import Sentence, Warned

_MISMATCH = 0.05
"""Part of their width by which sub-images may miss each other unremarked: engraved f-numbers are rounded by as much."""


class SubImageSize(MicrolensWarningKind):
    """Main lenses of another relative aperture than the microlenses."""

    rank = 20
    overlap = Sentence(
        "the main lens is {part:.3g} times as wide as they have room for, so that sub-images would overlap; what is "
        "beyond their own pixels is cut off here{match}",
        when="the f-number of the main lens is smaller than that of the microlenses, by more than 5 %",
        remedy="the f-number that is named",
    )
    gaps = Sentence(
        "sub-images are {part:.3g} times as wide as there is room for, and the pixels between them stay dark{match}",
        when="the f-number of the main lens is larger than that of the microlenses, by more than 5 %",
        remedy="the f-number that is named",
    )

    def find(self, subject: MicrolensFit) -> Warned:
        part, given = subject.array.distance / subject.array.matched, subject.f_number
        if part > 1.0 + _MISMATCH or part < 1.0 - _MISMATCH:
            match = "" if given is None else f": f/{part * given:.3g} in place of f/{given:.3g} would fill them"
            sentence = self.overlap if part > 1.0 else self.gaps
            yield self.record(sentence.fill(part=part, match=match), "microlenses")
