"""Warn of errors that few pixels decide."""

from raytracer.analysis.cost.warnings import StudyConditions, StudyWarningKind
from raytracer.schema.warning_kind import Sentence, Warned

_LARGE_SHARE = 0.2
"""Share of the error in the worst 0.1 % of the pixels from which on means are doubtful."""


class RareSamples(StudyWarningKind):
    """Pictures whose error is in a thousandth of the pixels."""

    name = "errors that few pixels decide"
    rank = 30
    rare = Sentence(
        "the worst 0.1 % of the pixels carry {percent:.0f} % of the squared error: rare bright samples "
        "decide, so errors are less certain than their intervals say",
        when="a thousandth of the pixels has more than a fifth of the squared error",
        remedy="take away what makes fireflies, or use `render.clamp`",
    )

    def find(self, subject: StudyConditions) -> Warned:
        if subject.study.top_share > _LARGE_SHARE:
            yield self.record(self.rare.fill(percent=100.0 * subject.study.top_share))
