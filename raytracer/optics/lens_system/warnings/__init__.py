"""Warn of implausible lenses: surfaces that intersect, stops that are hidden or too small."""

from typing import NamedTuple

from raytracer.optics.lens_system.lens import Lens
from raytracer.schema.warning_kind import WarningFamily, WarningKind

THIRD_OF_A_STOP = 2.0 ** (1.0 / 6.0)
"""The finest step of a diaphragm's ring, as a factor of the f-number: numbers of lenses are rounded by less."""


class MountedLens(NamedTuple):
    """Lens, wide open, and the film behind it.

    lens : focused at infinity, as published numbers are; a group that focuses changes the focal length as it moves.
    shift (mm) : movement of that group towards the scene when surfaces are tested for intersection.
    diagonal (mm) : of the picture; 0 where there is none.
    film_key : of the camera, that sets the diagonal.
    """

    lens: Lens
    shift: float = 0.0
    diagonal: float = 0.0
    film_key: str = "lens"


class LensWarningKind(WarningKind[MountedLens]):
    """Base of the kinds of warnings about lenses, each a clause about the value of a camera's key."""

    name = "cameras that are used for what they are not made for"
    section = "Lights and cameras"


LENS_WARNINGS = WarningFamily[MountedLens](__name__)


def lens_warnings(lens: Lens) -> list[str]:
    """List what is implausible in a lens by itself, a clause each."""
    return [record.text for record in LENS_WARNINGS.find(MountedLens(lens))]
