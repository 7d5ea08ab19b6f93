"""Warn of microlenses that do not suit their main lens, or their film."""

from typing import NamedTuple

from raytracer.film.light_field.lenslets import Lenslets
from raytracer.optics.lens_system.warnings import LensWarningKind
from raytracer.plugins.cameras.base.microlenses import Arrangement, Microlenses
from raytracer.schema.warning_kind import WarningFamily, WarningKind


class MicrolensFit(NamedTuple):
    """Microlenses behind a main lens of this f-number, if it has one."""

    lenses: Microlenses
    array: Arrangement
    layout: Lenslets
    f_number: float | None


class MicrolensWarningKind(WarningKind[MicrolensFit]):
    """Base of the kinds of warnings about microlenses, each a clause about the camera's key for them."""

    name = LensWarningKind.name
    section = LensWarningKind.section


MICROLENS_WARNINGS = WarningFamily[MicrolensFit](__name__)
