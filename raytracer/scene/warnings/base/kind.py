"""Base of the kinds of warnings about scenes, and the sections of the manual that they are in."""

from raytracer.scene.warnings.base.record import warning_at
from raytracer.scene.warnings.base.survey import SceneSurvey
from raytracer.schema.warning_kind import WarningFamily, WarningKind, WarningRecord
from raytracer.schema.yaml_nodes import KeyPath

FLOAT32 = "What float32 cannot hold"
COINCIDENCE = "Surfaces that coincide"
NESTING = "Clear things in one another"
LIGHTS_AND_CAMERAS = "Lights and cameras"


class SceneWarningKind(WarningKind[SceneSurvey]):
    """Base of the kinds of warnings about packed scenes."""

    def of_piece(self, survey: SceneSurvey, piece: int, text: str) -> WarningRecord:
        """Make a warning about a piece's object."""
        return self.of_keys(survey, survey.keys_of(piece), text)

    def of_keys(self, survey: SceneSurvey, keys: KeyPath, text: str) -> WarningRecord:
        """Make a warning about the value at a path of the scene."""
        return warning_at(survey.spec, self.record(text, *keys))


SCENE_WARNINGS = WarningFamily[SceneSurvey]("raytracer.scene.warnings")
