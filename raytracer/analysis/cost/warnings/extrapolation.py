"""Warn of predictions far beyond what was measured."""

from raytracer.analysis.cost.warnings import StudyConditions, StudyWarningKind
from raytracer.schema.warning_kind import Sentence, Warned

_MAX_EXTRAPOLATION = 100.0
"""Ratio of predicted to measured samples from which on a prediction is doubtful."""

_MOST_SAMPLES = 2**31 - 1


class Extrapolation(StudyWarningKind):
    """Targets and budgets that take many more samples than were measured."""

    name = "predictions far beyond what was measured"
    rank = 50
    beyond = Sentence(
        "the {goal} more samples per pixel than a render can have, {most}",
        when="the target takes, or the budget has time for, more than 2^31 - 1 samples per pixel",
        remedy="a larger error for `--target`, or a shorter `--budget`",
    )
    far = Sentence(
        "the {goal} {times:.0f} times as many samples as were measured, {measured}: how error falls so far "
        "beyond is not known",
        when="that is more than 100 times as many samples as were measured",
        remedy="take the prediction as rough",
    )

    def find(self, subject: StudyConditions) -> Warned:
        prediction = subject.study.prediction
        measured = prediction.points[-1].spp
        for goal, spp in (
            ("target takes", prediction.target_spp.value),
            ("budget has time for", 0.0 if prediction.budget_spp is None else prediction.budget_spp),
        ):
            if spp > _MOST_SAMPLES:
                yield self.record(self.beyond.fill(goal=goal, most=_MOST_SAMPLES))
            elif spp > _MAX_EXTRAPOLATION * measured:
                yield self.record(self.far.fill(goal=goal, times=spp / measured, measured=measured))
