"""Dispersion of a scene: materials whose index depends on the wavelength, and the camera's lens."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.core.shutter.table import Shutter
from raytracer.core.spectra import spectra
from raytracer.kernel.hero_wavelength import DispersiveLens, DispersiveMaterials, MonochromaticCamera
from raytracer.optics.lens_system.surfaces import reverse_lens
from raytracer.plugins.cameras.base.interface import CameraParts, WavelengthSharing, camera_parts
from raytracer.plugins.materials.base.interface import MaterialSpec


def dispersion_modes(parts: Sequence[tuple[MaterialSpec, int]]) -> NDArray[np.uint8] | None:
    """Return the dispersion mode by reference, see `DispersiveMaterials`; None where no material disperses."""
    modes = np.zeros(max(reference for _, reference in parts) + 1, np.uint8)
    for material, reference in parts:
        modes[reference] = material.dispersion_mode()
    return modes if modes.any() else None


def pack_spectrum(
    modes: NDArray[np.uint8] | None, camera: Any, edge: float | None, shutter: Shutter | None
) -> DispersiveMaterials | DispersiveLens | None:
    """Pack the dispersion of a scene; None where nothing disperses.

    Parameters
    ----------
    modes : of the materials, as `dispersion_modes` gives them.
    camera : the packed one.
    edge : see `FilterSpec.box_width`.
    shutter : the packed one.
    """
    parts: CameraParts = camera_parts(camera)
    if modes is None:
        return None if parts.spectra is None else DispersiveLens(parts.spectra, _share_lens(parts, edge, shutter))
    if parts.spectra is None:
        return DispersiveMaterials(spectra(), modes, None)
    return DispersiveMaterials(parts.spectra, modes, MonochromaticCamera())


def _share_lens(
    parts: CameraParts, edge: float | None, shutter: Shutter | None
) -> WavelengthSharing | MonochromaticCamera:
    """Pack the lens by which wavelengths share rays; MonochromaticCamera where they do not."""
    if not parts.shares_wavelengths or parts.glass is None or edge is None:
        return MonochromaticCamera()
    if shutter is not None and shutter.scan is not None:
        return MonochromaticCamera()
    return WavelengthSharing(edge, reverse_lens(parts.glass))
