"""Base of the kinds of warnings about scenes, the sections of the manual that they are in, and their sentences."""

from collections.abc import Iterable

from raytracer.scene.spec import SceneSpec
from raytracer.scene.warnings.base.survey import SceneSurvey, object_label
from raytracer.schema.warning_kind import WarningFamily, WarningKind, WarningRecord
from raytracer.schema.yaml_nodes import KeyPath, path_text
from raytracer.util.errors import SceneError

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


# ---- Sentences

MAX_PER_KIND = 10
"""Most warnings of a kind that are printed one by one."""


def warning_at(spec: SceneSpec, record: WarningRecord) -> WarningRecord:
    """Begin a warning's sentence with file, line and object of the value that it is about."""
    error = spec.error(record.text, *record.keys)
    key = error.key.replace(path_text(record.keys), object_label(spec, record.keys), 1)
    placed = SceneError(record.text, file=error.file, line=error.line, key=key, source=error.source)
    return record._replace(text=str(placed))


def warning_messages(warnings: Iterable[WarningRecord]) -> list[str]:
    """List the sentences, at most `MAX_PER_KIND` of a kind, and for each kind how many more there are."""
    kinds: dict[str, list[str]] = {}
    for item in warnings:
        kinds.setdefault(item.kind, []).append(item.text)
    lines = []
    for kind, sentences in kinds.items():
        lines += sentences[:MAX_PER_KIND]
        if len(sentences) > MAX_PER_KIND:
            lines.append(f"and {len(sentences) - MAX_PER_KIND:,} more {kind}")
    return lines
