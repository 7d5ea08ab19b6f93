"""Cameras whose keys do not go together as they should, though they can."""

from collections.abc import Iterator

from raytracer.scene.concerns.interface import Concern, concern
from raytracer.scene.concerns.survey import Survey

_KIND = "cameras that are used for what they are not made for"


def picture(survey: Survey) -> Iterator[Concern]:
    """Concerns about what the camera itself doubts."""
    spec = survey.spec
    for key, message in spec.camera.doubts(spec.film.width, spec.film.height):
        yield concern(spec, _KIND, ("camera", key), message)
