"""Warn of camera settings that are possible but probably not meant."""

from collections.abc import Iterator

from raytracer.scene.warnings.record import WarningRecord, warning_at
from raytracer.scene.warnings.survey import SceneSurvey

_KIND = "cameras that are used for what they are not made for"


def camera_warnings(survey: SceneSurvey) -> Iterator[WarningRecord]:
    """Find the warnings that the camera's own spec has of its settings."""
    spec = survey.spec
    for key, message in spec.camera.warnings(spec.film.width, spec.film.height):
        yield warning_at(spec, _KIND, ("camera", key), message)
