"""Warn of studies that were interrupted."""

from raytracer.analysis.cost.warnings import StudyConditions, StudyWarningKind
from raytracer.schema.warning_kind import Sentence, Warned


class Interruption(StudyWarningKind):
    """Studies with fewer rounds than were asked for."""

    name = "interruptions"
    rank = 60
    after = Sentence(
        "interrupted after {rounds} of {asked} rounds",
        when="an interrupt ends the comparison of variants",
        remedy="let it run to its end",
    )
    before = Sentence(
        "interrupted before the comparison",
        when="the same, before its first round",
        remedy="let it run to its end",
    )

    def find(self, subject: StudyConditions) -> Warned:
        if subject.study.interrupted and subject.study.rounds:
            yield self.record(self.after.fill(rounds=subject.study.rounds, asked=subject.rounds_asked))
        elif subject.study.interrupted:
            yield self.record(self.before.fill())
