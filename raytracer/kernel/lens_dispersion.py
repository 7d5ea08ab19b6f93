"""Dispersion in the camera's lens: wavelengths that share a camera ray, and the colour that rays of one have.

A camera whose lens disperses sends its rays at the hero's wavelength.  Where nothing else disperses, companions share
the ray on which the hero leaves the lens.  Each is traced back along it through the lens; if it comes to the same
pixel, the ray might have been made with it as the hero, which any of them is equally often.  So by the balance
heuristic a ray counts sum_i f_i / sum_j p_j, of those wavelengths alone: f_i, what it brings of one, over the density
of that wavelength; p_j, the density of such rays for the hero j, one over the area of the lens that is sampled from
its film position times cos^4 there.  Where the lens separates colours by more than a pixel the hero is alone, and
nothing is lost but time.

References: Wilkie et al. 2014, "Hero Wavelength Spectral Sampling", CGF 33(4), sec. 3.1; Veach 1997, thesis, sec. 9.2.2
(the balance heuristic).
"""

import math

from raytracer.core.compiler.dispatch import kernel, optional
from raytracer.core.simd import load, select, store
from raytracer.core.spectra import Spectra, basis_at, companion_number, response_at, sample_hero_wavelength
from raytracer.core.vec import Vec3, dot, madd, scale
from raytracer.kernel.hero_wavelength import DispersiveLens, DispersiveMaterials, MonochromaticCamera, wavelengths_of
from raytracer.optics.lens_system import packets
from raytracer.optics.lens_system.packets import ROWS
from raytracer.plugins.cameras.base.interface import WavelengthSharing, share_wavelengths

# The largest number of wavelengths that share a camera ray; and rows of Workspace.lens: a packet of each, the weight of
# each, and the film positions.
WAVELENGTHS_PER_RAY = 3
_WEIGHT_ROWS = WAVELENGTHS_PER_RAY * ROWS
FILM_POSITION_ROW = _WEIGHT_ROWS + WAVELENGTHS_PER_RAY

LENS_ROWS = FILM_POSITION_ROW + 3


@optional(DispersiveMaterials)
def share_lens_rays(spectrum, camera, work, x, y, first, count):
    """Let other wavelengths share the camera rays of `count` samples of pixel (x, y), where they reach it too.

    first : number of the first of these samples in the batch.
    """


@share_lens_rays.register(DispersiveLens)
def share_lens_rays_dispersive_lens(spectrum, camera, work, x, y, first, count):
    _share_with_companions(spectrum.camera, spectrum.spectra, camera, work, x, y, first, count)


@optional(MonochromaticCamera)
def _share_with_companions(sharing, spectra, camera, work, x, y, first, count):
    """Let companions share the rays of the heroes, where the camera has WavelengthSharing."""


@_share_with_companions.register(WavelengthSharing)
def _share_with_companions_wavelength_sharing(sharing, spectra, camera, work, x, y, first, count):
    rows = work.lens
    extent = load(rows, packets.EXTENT)
    # By the balance heuristic: any of the wavelengths might have been the hero.
    density = 1.0 + 0.0 * extent
    for number in range(1, WAVELENGTHS_PER_RAY):
        others = rows[ROWS * number : ROWS * (number + 1)]
        for lane in range(count):
            others[packets.WAVELENGTH, lane], _ = sample_hero_wavelength(
                spectra, companion_number(rows[packets.DRAWN, lane], number, WAVELENGTHS_PER_RAY)
            )
        share_wavelengths(camera, sharing, rows, others, x, y)
        is_shared = load(others, packets.WEIGHT) > 0.0
        density = density + select(is_shared, extent / load(others, packets.EXTENT), 0.0)
    share = 1.0 / density
    store(rows, _WEIGHT_ROWS, share)
    for number in range(1, WAVELENGTHS_PER_RAY):
        store(rows, _WEIGHT_ROWS + number, share * load(rows, ROWS * number + packets.WEIGHT))
    for lane in range(count):
        for number in range(WAVELENGTHS_PER_RAY):
            work.lens_weights[first + lane, number] = rows[_WEIGHT_ROWS + number, lane]


@optional
def apply_lens_color(spectrum, work, sample, radiance):
    """Multiply the radiance of a path by the colour of its camera ray's wavelength."""
    return radiance


@apply_lens_color.register(DispersiveLens | DispersiveMaterials)
def apply_lens_color_dispersion(spectrum, work, sample, radiance):
    return _apply_camera_color(spectrum.camera, spectrum.spectra, work, sample, radiance)


@optional
def _apply_camera_color(camera, spectra, work, sample, radiance):
    return radiance


@_apply_camera_color.register(MonochromaticCamera)
def _apply_camera_color_monochromatic_camera(camera, spectra, work, sample, radiance):
    return _wavelength_to_rgb(spectra, wavelengths_of(work, sample).u, radiance)


@_apply_camera_color.register(WavelengthSharing)
def _apply_camera_color_wavelength_sharing(sharing, spectra, work, sample, radiance):
    u = wavelengths_of(work, sample).u
    value = scale(work.lens_weights[sample, 0], _wavelength_to_rgb(spectra, u, radiance))
    for number in range(1, WAVELENGTHS_PER_RAY):
        share = work.lens_weights[sample, number]
        if share > 0.0:
            companion = companion_number(u, number, WAVELENGTHS_PER_RAY)
            value = madd(value, share, _wavelength_to_rgb(spectra, companion, radiance))
    return value


@kernel
def _wavelength_to_rgb(spectra: Spectra, u: float, radiance: Vec3) -> Vec3:
    """Convert radiance at the wavelength of random number `u` to camera RGB, over the density of the wavelength."""
    wavelength, pdf = sample_hero_wavelength(spectra, u)
    return scale(dot(basis_at(spectra, wavelength), radiance) / pdf, response_at(spectra, wavelength))


@optional
def ray_wavelength(spectrum, work, sample):
    """Return the wavelength (nm) of a sample's camera ray, NaN where the camera does not disperse."""
    return math.nan


@ray_wavelength.register(DispersiveLens | DispersiveMaterials)
def ray_wavelength_dispersion(spectrum, work, sample):
    return _ray_wavelength(spectrum.camera, spectrum.spectra, work, sample)


@optional
def _ray_wavelength(camera, spectra, work, sample):
    return math.nan


@_ray_wavelength.register(MonochromaticCamera | WavelengthSharing)
def _ray_wavelength_dispersive_camera(camera, spectra, work, sample):
    return sample_hero_wavelength(spectra, wavelengths_of(work, sample).u)[0]
