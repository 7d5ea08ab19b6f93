"""Warn of comparisons of too few rounds for an interval."""

from raytracer.analysis.cost.warnings import MIN_ROUNDS, StudyConditions, StudyWarningKind
from raytracer.schema.warning_kind import Sentence, Warned


class FewRounds(StudyWarningKind):
    """Medians of which no interval of 95 % is known."""

    name = "comparisons of few rounds"
    rank = 70
    few = Sentence(
        "{rounds} rounds are few: intervals of medians take {least}",
        when="the comparison ended before 9 rounds",
        remedy="let it run to its end",
    )

    def find(self, subject: StudyConditions) -> Warned:
        if 0 < subject.study.rounds < MIN_ROUNDS:
            yield self.record(self.few.fill(rounds=subject.study.rounds, least=MIN_ROUNDS))
