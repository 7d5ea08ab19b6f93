"""Warn photographers where the picture differs from that of a real camera, or from what may be meant."""

from collections.abc import Mapping
from typing import NamedTuple

from raytracer.analysis.explain.camera_numbers import CameraView
from raytracer.schema.warning_kind import WarningFamily, WarningKind


class Photograph(NamedTuple):
    """View of a scene's camera, and its numbers."""

    view: CameraView
    numbers: Mapping[str, float]


class PhotographicWarningKind(WarningKind[Photograph]):
    """Base of the kinds of warnings about photographs."""

    section = "Photographs"


PHOTOGRAPHIC_WARNINGS = WarningFamily[Photograph](__name__)
