"""Warn of focused microlenses too few of which see each place."""

from raytracer.plugins.cameras.base.warnings import MicrolensFit, MicrolensWarningKind
from raytracer.schema.warning_kind import Sentence, Warned

_MIN_SEEN_BY = 2.0
"""Microlenses across that should see each place: Georgiev, Lumsdaine 2010, "Reducing Plenoptic Camera Artifacts"."""


class UnseenPlaces(MicrolensWarningKind):
    """Places that no microlens sees, or of which no depth can be told."""

    rank = 30
    few = Sentence(
        "each place is seen by {overlap:.3g} of them across, and it takes {least:g} to leave none out and to tell its "
        "depth: {remedy}",
        when="microlenses with `arrangement: focused` see parts of the picture that hardly overlap",
        remedy="give a focal_length that is nearer to what shows the main lens",
    )

    def find(self, subject: MicrolensFit) -> Warned:
        overlap = subject.layout.overlap
        if subject.lenses.arrangement == "focused" and overlap < _MIN_SEEN_BY:
            yield self.record(self.few.fill(overlap=overlap, least=_MIN_SEEN_BY), "microlenses")
