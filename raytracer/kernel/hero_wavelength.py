"""Hero wavelength sampling: paths of single wavelengths, in scenes where materials disperse.

A path is traced in red, green and blue until it meets such a material.  Its throughput so far is put aside, and from
there on it carries light of three wavelengths: a hero and two companions, which lie in strata of their own.  Where
their directions differ it goes on with the hero; then the path is traced again from the camera, by the same random
numbers, for each of the companions, and counts from where they parted.  Colours of all else are upsampled to the
path's wavelengths, and what is gathered is converted to red, green and blue again.

A camera whose lens disperses sends its rays at the hero's wavelength (`lens_dispersion`).  Such a path stays in red,
green and blue too, and the colour of that wavelength is given to all that it has gathered; materials that disperse are
evaluated at that wavelength.

References: Wilkie et al. 2014, "Hero Wavelength Spectral Sampling", CGF 33(4), sec. 3.1.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import kernel, optional
from raytracer.core.geometry import at_wavelengths
from raytracer.core.sampling import sample_1d
from raytracer.core.spectra import (
    TERMINATE_ON_HIT,
    TERMINATE_ON_REFRACTION,
    PathWavelengths,
    Spectra,
    basis_at,
    companion_number,
    response_at,
    sample_hero_wavelength,
)
from raytracer.core.vec import Vec3, dot, load_vector, madd, mul, scale, store_vector
from raytracer.kernel.path_rows import load3, store3
from raytracer.plugins.cameras.base.interface import WAVELENGTH


class MonochromaticCamera(NamedTuple):
    """A camera whose rays have one wavelength each."""


class DispersiveMaterials(NamedTuple):
    """Spectral data of a scene in which materials disperse.

    Attributes
    ----------
    spectra : tables by wavelength.
    dispersion_mode : uint8 (references,), by reference of a surface's material: 0 if it does not disperse, else
        TERMINATE_ON_REFRACTION or TERMINATE_ON_HIT.
    camera : MonochromaticCamera if the camera's lens disperses too, or None.
    """

    spectra: Spectra
    dispersion_mode: NDArray[np.uint8]
    camera: Any


class DispersiveLens(NamedTuple):
    """Spectral data of a scene in which only the camera's lens disperses.

    Attributes
    ----------
    spectra : tables by wavelength.
    camera : MonochromaticCamera, or the camera's WavelengthSharing, by which companions share the hero's ray.
    """

    spectra: Spectra
    camera: Any = MonochromaticCamera()


LENS_ROW = np.dtype([("u", "f8")])
"""Record of a sample where only a lens disperses: the hero's random number."""

WAVELENGTH_ROW = np.dtype(
    [
        ("u", "f8"),
        ("count", "f8"),
        ("rgb_throughput", "f8", 3),
        ("wavelength", "f8", 3),
        ("response", "f8", (3, 3)),
        ("basis", "f8", (3, 3)),
        ("hero", "i8"),
        ("is_terminated", "i8"),
        ("camera_ray", "f8", (2, 3)),
    ]
)
"""Record of a sample where materials disperse.

The hero's random number; the number of wavelengths that the path carries, 0 while it is traced in red, green and blue;
its throughput until then; the wavelengths (nm); the camera's response to each, and the spectra of the primaries at
each; the wavelength that goes on where they part; 1 if they parted when the path was traced for the first one; origin
and direction of the camera ray.
"""


def wavelength_rows(spectrum: DispersiveMaterials | DispersiveLens | None, samples: int) -> NDArray[Any] | None:
    """Make the rows of so many samples; None where nothing disperses."""
    if spectrum is None:
        return None
    return np.zeros(samples, WAVELENGTH_ROW if isinstance(spectrum, DispersiveMaterials) else LENS_ROW)


@kernel
def wavelengths_of(work, sample):
    """Return the row of a sample."""
    return work.wavelengths[np.uintp(sample)]


# ---- From the camera, once or once a wavelength


@optional
def start_rgb_path(spectrum, work, sample, draws, origin, direction):
    """Start a sample's path in red, green and blue, along a camera ray."""


@start_rgb_path.register(DispersiveLens)
def start_rgb_path_dispersive_lens(spectrum, work, sample, draws, origin, direction):
    wavelengths_of(work, sample).u = sample_1d(draws.sampler, draws.key, draws.index, WAVELENGTH)


@start_rgb_path.register(DispersiveMaterials)
def start_rgb_path_dispersive_materials(spectrum, work, sample, draws, origin, direction):
    waves = wavelengths_of(work, sample)
    waves.u = sample_1d(draws.sampler, draws.key, draws.index, WAVELENGTH)
    waves.count = 0.0
    waves.hero = 0
    waves.is_terminated = 0
    store3(waves.camera_ray, 0, 0, origin)
    store3(waves.camera_ray, 1, 0, direction)


@optional
def max_traces(camera):
    """Return the largest number of times that a path is traced: once for each wavelength that it carries."""
    return 3


@max_traces.register(MonochromaticCamera)
def max_traces_monochromatic_camera(camera):
    return 1


@kernel
def needs_retrace(work, sample):
    """Return True if a sample's secondary wavelengths were terminated, so that its path is traced for each of them."""
    return wavelengths_of(work, sample).is_terminated != 0


@kernel
def restart_rgb_path(work, sample, number):
    """Restart a sample's path for wavelength `number`; returns the camera ray."""
    waves = wavelengths_of(work, sample)
    waves.count = 0.0
    waves.hero = number
    return load3(waves.camera_ray, 0, 0), load3(waves.camera_ray, 1, 0)


# ---- Where a path meets a material that disperses


@optional(DispersiveLens)
def enter_dispersion(spectrum, work, path, surface):
    """Continue a path in single wavelengths where it meets a material that disperses.

    Returns its throughput, and the Interaction with the path's wavelengths, by which such materials are evaluated.
    """
    return path.throughput, surface


@enter_dispersion.register(DispersiveMaterials)
def enter_dispersion_dispersive_materials(spectrum, work, path, surface):
    waves = wavelengths_of(work, path.sample)
    throughput = _enter(spectrum, waves, surface.material, path.throughput)
    return throughput, at_wavelengths(surface, _carried_wavelengths(waves))


@kernel
def _enter(spectrum, waves, material, throughput):
    """Convert the throughput of a path to one by wavelength if the material disperses."""
    mode = spectrum.dispersion_mode[material]
    if mode == 0:
        return throughput
    if waves.count == 0.0:
        store_vector(waves.rgb_throughput, throughput)
        throughput = _sample_wavelengths(spectrum.camera, spectrum.spectra, waves)
    if mode == TERMINATE_ON_HIT and waves.count > 1.0:
        return _terminate_secondary(waves, throughput)
    return throughput


@optional
def _sample_wavelengths(camera, spectra, waves):
    """Sample the wavelengths of a path; returns its throughput by wavelength."""
    for number in range(3):
        wavelength, pdf = sample_hero_wavelength(spectra, companion_number(waves.u, number, 3))
        waves.wavelength[number] = wavelength
        store3(waves.response, number, 0, scale(1.0 / (3.0 * pdf), response_at(spectra, wavelength)))
        store3(waves.basis, number, 0, basis_at(spectra, wavelength))
    waves.count = 3.0
    return (1.0, 1.0, 1.0)


@_sample_wavelengths.register(MonochromaticCamera)
def _sample_wavelengths_monochromatic_camera(camera, spectra, waves):
    # Grey, which the camera multiplies by the colour of its wavelength in the end.
    wavelength, _ = sample_hero_wavelength(spectra, waves.u)
    for number in range(3):
        waves.wavelength[number] = wavelength
        store3(waves.response, number, 0, (1.0, 1.0, 1.0))
        store3(waves.basis, number, 0, basis_at(spectra, wavelength))
    waves.count = 1.0
    return (1.0, 0.0, 0.0)


@kernel
def _carried_wavelengths(waves):
    """Return the PathWavelengths of a path."""
    count = waves.count
    return PathWavelengths(
        count,
        waves.hero if count > 1.0 else np.int64(0),
        load_vector(waves.wavelength),
        load3(waves.basis, 0, 0),
        load3(waves.basis, 1, 0),
        load3(waves.basis, 2, 0),
    )


@kernel
def _terminate_secondary(waves, throughput):
    """Continue a path with one of its wavelengths, as its first; returns the throughput."""
    number = waves.hero
    waves.wavelength[0] = waves.wavelength[number]
    store3(waves.response, 0, 0, load3(waves.response, number, 0))
    store3(waves.basis, 0, 0, load3(waves.basis, number, 0))
    waves.count = 1.0
    waves.is_terminated = 1
    return (throughput[number], 0.0, 0.0)


@optional(DispersiveLens)
def terminate_secondary_wavelengths(spectrum, work, path, surface, outgoing, throughput):
    """Continue a path that a surface refracts to `outgoing` with one wavelength; returns the throughput."""
    return throughput


@terminate_secondary_wavelengths.register(DispersiveMaterials)
def terminate_secondary_wavelengths_dispersive_materials(spectrum, work, path, surface, outgoing, throughput):
    is_refracted = (
        spectrum.dispersion_mode[surface.material] == TERMINATE_ON_REFRACTION and dot(outgoing, surface.normal) < 0.0
    )
    waves = wavelengths_of(work, path.sample)
    if is_refracted and waves.count > 1.0:
        return _terminate_secondary(waves, throughput)
    return throughput


@optional(DispersiveLens)
def path_wavelengths(spectrum, work, sample):
    """Return the three wavelengths (nm) that a path carries, NaN in place of those that it does not."""
    return (math.nan, math.nan, math.nan)


@path_wavelengths.register(DispersiveMaterials)
def path_wavelengths_dispersive_materials(spectrum, work, sample):
    waves = wavelengths_of(work, sample)
    first, second, third = load_vector(waves.wavelength)
    return (
        first if waves.count > 0.0 else math.nan,
        second if waves.count > 1.0 else math.nan,
        third if waves.count > 1.0 else math.nan,
    )


# ---- Upsampling, and back to red, green and blue


@optional(DispersiveLens)
def upsample_rgb(spectrum, work, sample, rgb):
    """Convert an RGB colour to values at the path's wavelengths; leave it while the path is traced in RGB."""
    return rgb


@upsample_rgb.register(DispersiveMaterials)
def upsample_rgb_dispersive_materials(spectrum, work, sample, rgb):
    waves = wavelengths_of(work, sample)
    if waves.count == 0.0:
        return rgb
    return (dot(load3(waves.basis, 0, 0), rgb), dot(load3(waves.basis, 1, 0), rgb), dot(load3(waves.basis, 2, 0), rgb))


@optional(DispersiveLens)
def upsample_bsdf(spectrum, work, sample, material, value):
    """Convert the value of a BSDF as `upsample_rgb` does; materials that disperse give it by wavelength already."""
    return value


@upsample_bsdf.register(DispersiveMaterials)
def upsample_bsdf_dispersive_materials(spectrum, work, sample, material, value):
    return upsample_rgb(spectrum, work, sample, value) if spectrum.dispersion_mode[material] == 0 else value


@optional(DispersiveLens)
def add_radiance(spectrum, work, sample, throughput, radiance):
    """Add to a sample the radiance that reaches the camera with this throughput."""
    for channel in range(3):
        work.radiance[np.uintp(sample), channel] += throughput[channel] * radiance[channel]


@add_radiance.register(DispersiveMaterials)
def add_radiance_dispersive_materials(spectrum, work, sample, throughput, radiance):
    waves = wavelengths_of(work, sample)
    # Until a retraced path parts from the first trace, that has gathered its light.
    if not (waves.hero == 0 or waves.count == 1.0):
        return
    light = _to_camera_rgb(waves, mul(throughput, radiance))
    for channel in range(3):
        work.radiance[sample, channel] += light[channel]


@kernel
def _to_camera_rgb(waves: Any, light: Vec3) -> Vec3:
    """Convert radiance at a path's wavelengths, with its throughput, to camera RGB."""
    if waves.count == 0.0:
        return light
    rgb = scale(light[0], load3(waves.response, 0, 0))
    rgb = madd(rgb, light[1], load3(waves.response, 1, 0))
    rgb = madd(rgb, light[2], load3(waves.response, 2, 0))
    return mul(load_vector(waves.rgb_throughput), rgb)


@optional(DispersiveLens)
def estimate_contribution(spectrum, work, sample, throughput):
    """Estimate the RGB throughput of a path to the camera, by which Russian roulette decides."""
    return throughput


@estimate_contribution.register(DispersiveMaterials)
def estimate_contribution_dispersive_materials(spectrum, work, sample, throughput):
    waves = wavelengths_of(work, sample)
    if waves.count == 0.0:
        return throughput
    total = throughput[0] + throughput[1] + throughput[2]
    return scale(_wavelength_weight(spectrum.camera) * total, load_vector(waves.rgb_throughput))


@optional
def _wavelength_weight(camera):
    """Return the mean weight of one of a path's wavelengths."""
    return 1.0 / 3.0


@_wavelength_weight.register(MonochromaticCamera)
def _wavelength_weight_monochromatic_camera(camera):
    return 1.0


@optional(DispersiveLens)
def channel_importance(spectrum, work, sample, throughput):
    """Weigh the RGB channels by what they contribute to the path's wavelengths: how distances in media are sampled."""
    return throughput


@channel_importance.register(DispersiveMaterials)
def channel_importance_dispersive_materials(spectrum, work, sample, throughput):
    waves = wavelengths_of(work, sample)
    if waves.count == 0.0:
        return throughput
    # The spectrum of each primary reaches over all wavelengths, so none of the three is 0.
    importance = scale(throughput[0], load3(waves.basis, 0, 0))
    importance = madd(importance, throughput[1], load3(waves.basis, 1, 0))
    return madd(importance, throughput[2], load3(waves.basis, 2, 0))
