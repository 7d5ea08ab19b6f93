"""Warn of pictures without light, or without noise."""

from raytracer.analysis.cost.warnings import StudyConditions, StudyWarningKind
from raytracer.schema.warning_kind import Sentence, Warned


class FlatError(StudyWarningKind):
    """Pictures that samples do not change."""

    name = "pictures that take no samples"
    rank = 20
    black = Sentence(
        "what was rendered is black: no error is relative to it, so what accuracy costs cannot be said",
        when="the mean of the picture is 0",
        remedy="give the scene light",
    )
    noiseless = Sentence(
        "what was rendered has no noise: one sample per pixel is enough",
        when="the error of the picture is 0 however many samples it has",
        remedy="render one sample per pixel",
    )

    def find(self, subject: StudyConditions) -> Warned:
        if subject.scale == 0.0:
            yield self.record(self.black.fill())
        elif subject.study.prediction.points[-1].error.value == 0.0:
            yield self.record(self.noiseless.fill())
