"""Warn of triangles without an area in files."""

from raytracer.scene.warnings.base.kind import FLOAT32, SceneWarningKind
from raytracer.scene.warnings.base.survey import SceneSurvey
from raytracer.schema.warning_kind import Sentence, Warned


class EmptyTriangles(SceneWarningKind):
    """Triangles of files that no ray can hit."""

    name = "triangles without an area"
    section = FLOAT32
    rank = 10
    empty = Sentence(
        "its file has {count:,} triangle{plural} without an area (the first is number {first}, counted from 0), which "
        "no ray can hit and which are left out",
        when="triangles of a file are points or lines",
        remedy="nothing, if there are few; else look at what wrote the file",
    )

    def find(self, survey: SceneSurvey) -> Warned:
        for item, (count, first) in survey.packed.empty.items():
            text = self.empty.fill(count=count, plural="s" if count > 1 else "", first=first)
            yield self.of_keys(survey, survey.packed.items[item].keys, text)
