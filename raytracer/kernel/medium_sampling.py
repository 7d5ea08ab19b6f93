"""The step through a medium: how far a path gets, and how it scatters there."""

import math

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.vec import is_black, madd, mul, scale
from raytracer.kernel.direct_light import sample_direct_light_in_medium
from raytracer.kernel.hero_wavelength import channel_importance, estimate_contribution, path_wavelengths, upsample_rgb
from raytracer.kernel.nested_dielectrics import beer_transmittance
from raytracer.kernel.path_log import MediumFlight, Scattering, record
from raytracer.kernel.path_state import scattered_path, store_path, with_throughput
from raytracer.kernel.russian_roulette import LEAST_THROUGHPUT_IN_MEDIA, russian_roulette
from raytracer.plugins.materials.base.interface import BLACK, WHITE
from raytracer.plugins.media.base.interface import NO_MEDIUM, sample_distance_at, sample_phase_at


@kernel
def _absorb(scene, work, path, distance):
    """Return a path after the absorption of the solid that it goes through, over a distance (m)."""
    rest = beer_transmittance(scene.nested_dielectrics, work.paths.inside_counts, path.sample, distance)
    return with_throughput(path, mul(path.throughput, upsample_rgb(scene.spectrum, work, path.sample, rest)))


@kernel
def sample_medium(media, scene, work, path, distance, draws):
    """Sample the medium that a path is in, up to the next surface at a distance (m).

    Returns the path as it comes to the surface, and True if it does not, but ends or scatters in the medium.  Where it
    scatters, a light is sampled, and the path goes on from there.
    """
    if media is None:
        return _absorb(scene, work, path, distance), False
    if path.medium == NO_MEDIUM:
        return _absorb(scene, work, path, distance), False
    channels = channel_importance(scene.spectrum, work, path.sample, path.throughput)
    flight = sample_distance_at(media, path.medium, path.origin, path.direction, distance, channels, draws, 0)
    weight = upsample_rgb(scene.spectrum, work, path.sample, flight.weight)
    path = with_throughput(path, mul(path.throughput, weight))
    path = _absorb(scene, work, path, min(distance, flight.distance))
    event = MediumFlight(path.medium, distance, flight.distance, flight.weight, path.throughput)
    record(work.log, work, path.sample, event)
    if is_black(path.throughput):
        return path, True
    if math.isinf(flight.distance):
        return path, False
    if path.depth < scene.depth:
        _scatter_in_medium(scene, work, path, flight.distance, draws)
    return path, True


@kernel
def _scatter_in_medium(scene, work, path, distance, draws):
    """Scatter a path at a distance (m) from its origin: sample a light there, and the direction in which it goes on."""
    point = madd(path.origin, distance, path.direction)
    sample_direct_light_in_medium(scene.lights, scene, work, path, point, draws)
    contribution = estimate_contribution(scene.spectrum, work, path.sample, path.throughput)
    survival = russian_roulette(scene, contribution, LEAST_THROUGHPUT_IN_MEDIA, path.depth, draws)
    outgoing, pdf = path.direction, math.nan
    if survival != 0.0:
        outgoing, pdf = sample_phase_at(scene.media, path.medium, path.direction, draws)
    waves = path_wavelengths(scene.spectrum, work, path.sample)
    record(work.log, work, path.sample, Scattering(BLACK, outgoing, WHITE, pdf, path.throughput, survival, waves))
    if survival == 0.0:
        return
    throughput = scale(1.0 / survival, path.throughput)
    store_path(work, scattered_path(path, point, point, outgoing, throughput, pdf, path.medium))
