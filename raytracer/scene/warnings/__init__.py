"""Warn before a scene is rendered: of probable mistakes, and of what float32 cannot hold."""

from collections.abc import Callable

from raytracer.scene.pack.scene import PackedScene
from raytracer.scene.warnings.camera_position import viewpoint_warnings
from raytracer.scene.warnings.camera_settings import camera_warnings
from raytracer.scene.warnings.coincident_surfaces import coincident_surface_warnings
from raytracer.scene.warnings.lights import light_warnings
from raytracer.scene.warnings.nested_dielectrics import nesting_warnings
from raytracer.scene.warnings.record import WarningRecord, warning_messages
from raytracer.scene.warnings.sizes import size_warnings
from raytracer.scene.warnings.survey import SceneSurvey
from raytracer.util.errors import StrictError

__all__ = ["WarningRecord", "emit_warnings", "find_warnings", "warning_messages"]


def find_warnings(packed: PackedScene) -> list[WarningRecord]:
    """Find the warnings of a packed scene; see docs/warnings.md."""
    survey = SceneSurvey(packed)
    return [
        *size_warnings(survey),
        *coincident_surface_warnings(survey),
        *nesting_warnings(survey),
        *light_warnings(survey),
        *viewpoint_warnings(survey),
        *camera_warnings(survey),
    ]


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
