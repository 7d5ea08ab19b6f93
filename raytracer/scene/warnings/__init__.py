"""Warn before a scene is rendered: of probable mistakes, and of what float32 cannot hold."""

from collections.abc import Callable

from raytracer.scene.pack.scene import PackedScene
from raytracer.scene.warnings.base.kind import SCENE_WARNINGS, warning_at, warning_messages
from raytracer.scene.warnings.base.survey import SceneSurvey
from raytracer.schema.warning_kind import WarningRecord
from raytracer.util.errors import StrictError

__all__ = ["emit_warnings", "find_warnings", "warning_messages"]


def find_warnings(packed: PackedScene) -> list[WarningRecord]:
    """Find the warnings of a packed scene, and those that its camera has of its settings; see docs/warnings.md."""
    spec, survey = packed.spec, SceneSurvey(packed)
    found = SCENE_WARNINGS.find(survey)
    survey.forget()
    of_camera = spec.camera.warnings(spec.film.width, spec.film.height)
    return found + [warning_at(spec, record._replace(keys=("camera", *record.keys))) for record in of_camera]


def emit_warnings(packed: PackedScene, warn: Callable[[str], object] | None, *, strict: bool = False) -> None:
    """Pass the warnings of a packed scene to `warn`, a sentence each; None looks for none unless `strict`.

    Raises
    ------
    StrictError : there is a warning, and `strict` makes it an error.
    """
    sentences = warning_messages(find_warnings(packed)) if strict or warn is not None else []
    if sentences and strict:
        raise StrictError(sentences)
    for sentence in sentences:
        assert warn is not None
        warn(sentence)
