"""Warn of too few measured tiles for an interval."""

from raytracer.analysis.cost.warnings import MIN_TILES, StudyConditions, StudyWarningKind
from raytracer.schema.warning_kind import Sentence, Warned


class FewTiles(StudyWarningKind):
    """Pictures of which a small part was measured."""

    name = "pictures of which few tiles were measured"
    rank = 80
    one = Sentence(
        "one tile was measured, so intervals are not known",
        when="the picture has one tile, or one was measured",
        remedy="more `--tiles`, or a larger picture",
    )
    few = Sentence(
        "only {measured} of {tiles} tiles were measured: intervals are rough",
        when="fewer than 16 of the tiles were measured",
        remedy="more `--tiles`",
    )

    def find(self, subject: StudyConditions) -> Warned:
        if subject.study.tiles_measured == 1:
            yield self.record(self.one.fill())
        elif subject.study.tiles_measured < min(MIN_TILES, subject.study.tiles):
            yield self.record(self.few.fill(measured=subject.study.tiles_measured, tiles=subject.study.tiles))
