"""Warn of samples that were not finite."""

from raytracer.analysis.cost.warnings import StudyConditions, StudyWarningKind
from raytracer.schema.warning_kind import Sentence, Warned


class DroppedSamples(StudyWarningKind):
    """Samples that count nowhere."""

    name = "samples that were not finite"
    rank = 10
    dropped = Sentence(
        "{count} samples were not finite and were dropped: times and errors leave them out",
        when="samples are infinite or NaN",
        remedy="[find them](debugging.md#samples-that-are-not-finite)",
    )

    def find(self, subject: StudyConditions) -> Warned:
        if subject.bad:
            yield self.record(self.dropped.fill(count=subject.bad))
