"""What disperses in a scene: materials whose index depends on the wavelength, and the camera's lens."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.cameras.interface import Sharing
from raytracer.hues import LensSpectrum, Spectrum, Split
from raytracer.lenses.surfaces import turned
from raytracer.materials.interface import MaterialSpec
from raytracer.shutter import Shutter
from raytracer.spectra import spectra


def parting_of(parts: Sequence[tuple[MaterialSpec, int]]) -> NDArray[np.uint8] | None:
    """How the materials of these references part wavelengths, see hues.Spectrum; None where none does."""
    how = np.zeros(max(reference for _, reference in parts) + 1, np.uint8)
    for material, reference in parts:
        how[reference] = material.parting()
    return how if how.any() else None


def pack_spectrum(
    how: NDArray[np.uint8] | None, camera: Any, edge: float | None, shutter: Shutter | None
) -> Spectrum | LensSpectrum | None:
    """What a scene is told of its colours, None where nothing disperses: by its materials and packed camera.

    edge : see `FilterSpec.edge`; shutter : the packed one.
    """
    # A camera that moves holds one that does not.
    still = getattr(camera, "camera", camera)
    drawn = getattr(still, "wavelengths", None)
    if how is None:
        return None if drawn is None else LensSpectrum(drawn, _sharing(still, edge, shutter))
    return Spectrum(spectra() if drawn is None else drawn, how, None if drawn is None else Split())


def _sharing(camera: Any, edge: float | None, shutter: Shutter | None) -> Sharing | None:
    """How wavelengths share a lens's rays; None where they do not, as behind microlenses, or without glass."""
    if getattr(camera, "pupils", None) is None:
        return None
    if edge is None or camera.flare is not None or (shutter is not None and shutter.scan is not None):
        return None
    return Sharing(edge, turned(camera.surfaces))
