"""Warn of budgets of time that are used up before the first sample."""

from raytracer.analysis.cost.warnings import StudyConditions, StudyWarningKind
from raytracer.schema.warning_kind import Sentence, Warned


class ShortBudget(StudyWarningKind):
    """Budgets shorter than what does not depend on samples."""

    name = "budgets that are too short"
    rank = 40
    short = Sentence(
        "the budget of {budget:.3g} s does not reach for one sample per pixel after the {fixed:.3g} s that do "
        "not depend on samples",
        when="loading, packing and building leave no time for samples",
        remedy="a larger `--budget`",
    )

    def find(self, subject: StudyConditions) -> Warned:
        prediction = subject.study.prediction
        if prediction.budget is not None and not prediction.budget_spp:
            yield self.record(self.short.fill(budget=prediction.budget, fixed=prediction.fixed.value))
