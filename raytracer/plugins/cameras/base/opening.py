"""Declare what shapes the opening of a camera's lens."""

from typing import NamedTuple

from raytracer.plugins.apertures.base.interface import ApertureSpec
from raytracer.plugins.apertures.base.vignetting import Vignetting


class Opening(NamedTuple):
    """Specs that shape a lens's opening, each None where there is none.

    shape : of the opening, which is round without it.
    rim : in front of the lens, which vignettes.
    """

    shape: ApertureSpec | None = None
    rim: Vignetting | None = None
