"""The first step: camera rays, from a place on the film to the start of a path."""

import math

from raytracer.core.compiler.dispatch import kernel, optional
from raytracer.core.sampling import pixel_key, sample_1d, sample_2d
from raytracer.core.shutter.table import Shutter, sample_shutter_time
from raytracer.kernel.aovs.base.layers import start_aovs
from raytracer.kernel.hero_wavelength import start_rgb_path
from raytracer.kernel.lens_dispersion import FILM_POSITION_ROW, ray_wavelength, share_lens_rays
from raytracer.kernel.medium_boundaries import medium_at_camera
from raytracer.kernel.nested_dielectrics import clear_inside_counts
from raytracer.kernel.path_log import CameraRay, begin_round, record
from raytracer.kernel.path_rows import store3
from raytracer.kernel.path_state import Path, sample_draws, store_draws, store_path
from raytracer.kernel.transparency import first_vertex, no_passthroughs
from raytracer.plugins.cameras.base.interface import (
    FILTER,
    TIME,
    PacketRays,
    film_corner,
    film_to_view,
    lane_ray,
    packet_rays,
    set_lane,
    trace_lanes,
)
from raytracer.plugins.filters.base.interface import sample_filter
from raytracer.plugins.materials.base.interface import BLACK, WHITE


@kernel
def start_camera_paths(scene, aovs, work, x, y, index, first, count):
    """Start the paths of `count` samples of pixel (x, y), and queue those that the lens lets through.

    index : of the first of these samples in the pixel.
    first : its number in the batch.
    """
    begin_round(work.log, 0)
    key = pixel_key(scene.sampler, x, y)
    for lane in range(count):
        store_draws(work, first + lane, key, index + lane)
    packet = packet_rays(scene.camera)
    # Once for all samples: which view a pixel is of takes two divisions of integers.
    corner = film_corner(scene.camera, x, y)
    _trace_lens_packet(packet, scene, work, x, y, corner, first, count)
    for lane in range(count):
        _start_sample(packet, scene, aovs, work, first + lane, lane, corner)


@kernel
def _start_sample(packet, scene, aovs, work, sample, lane, corner):
    """Make the camera ray of a sample, in this lane of its packet, and start its path if the lens lets it through."""
    draws = sample_draws(scene, work, sample, 0)
    film_x, film_y, weight = _lane_film_position(packet, scene, work, lane, corner, draws)
    view_x, view_y = film_to_view(scene.camera, film_x, film_y)
    time, rate = sample_time(scene.shutter, view_x, view_y, draws)
    origin, direction, importance = lane_ray(scene.camera, work.lens, lane, film_x, film_y, time, draws)
    store3(work.radiance, sample, 0, BLACK)
    # Not into the throughput: the weight of a camera ray says nothing of whether its path should go on.
    work.weight[sample] = weight * rate * importance
    start_aovs(aovs, work, sample, origin, direction)
    start_rgb_path(scene.spectrum, work, sample, draws, origin, direction)
    wavelength = ray_wavelength(scene.spectrum, work, sample)
    factors = (weight, rate, importance)
    record(work.log, work, sample, CameraRay(film_x, film_y, time, origin, direction, factors, wavelength))
    if importance != 0.0:
        start_path(scene, work, sample, origin, direction, time)


@optional
def sample_time(shutter, x, y, draws):
    """Sample the time at which film position (x, y) is exposed: a fraction of the exposure or None, and a weight.

    The weight is of mean 1, and the constant 1 where no light has a time of its own.
    """
    return None, 1.0


@sample_time.register(Shutter)
def sample_time_shutter(shutter, x, y, draws):
    return sample_shutter_time(shutter.pulses, shutter, x, y, sample_1d(draws.sampler, draws.key, draws.index, TIME))


@kernel
def start_path(scene, work, sample, origin, direction, time):
    """Start the path of a sample along a camera ray, outside of all solids."""
    clear_inside_counts(scene.nested_dielectrics, work.paths.inside_counts, sample)
    medium, vertex = medium_at_camera(scene.media), first_vertex(scene.transparency, origin)
    # The camera had no choice of direction that a light sample could share: its density is infinite.
    path = Path(
        sample, 1, origin, direction, WHITE, math.inf, time, medium, vertex, no_passthroughs(scene.transparency)
    )
    store_path(work, path)


@kernel
def _sample_film_position(scene, corner, draws):
    """Sample a film position of the pixel at this corner by the filter; returns it and its weight."""
    u1, u2 = sample_2d(draws.sampler, draws.key, draws.index, FILTER)
    dx, dy, weight = sample_filter(scene.filter, u1, u2)
    left, top = corner
    return left + 0.5 + dx, top + 0.5 + dy, weight


@optional
def _trace_lens_packet(packet, scene, work, x, y, corner, first, count):
    """Trace the packet's camera rays through the lens together, if the camera does so."""


@_trace_lens_packet.register(PacketRays)
def _trace_lens_packet_packet_rays(packet, scene, work, x, y, corner, first, count):
    for lane in range(count):
        draws = sample_draws(scene, work, first + lane, 0)
        film_x, film_y, weight = _sample_film_position(scene, corner, draws)
        work.lens[FILM_POSITION_ROW, lane] = film_x
        work.lens[FILM_POSITION_ROW + 1, lane] = film_y
        work.lens[FILM_POSITION_ROW + 2, lane] = weight
        set_lane(scene.camera, work.lens, lane, film_x, film_y, draws)
    trace_lanes(scene.camera, work.lens)
    share_lens_rays(scene.spectrum, scene.camera, work, x, y, first, count)


@optional
def _lane_film_position(packet, scene, work, lane, corner, draws):
    """Sample a film position and its weight, or read those of the packet that the lens has traced."""
    return _sample_film_position(scene, corner, draws)


@_lane_film_position.register(PacketRays)
def _lane_film_position_packet_rays(packet, scene, work, lane, corner, draws):
    return (
        work.lens[FILM_POSITION_ROW, lane],
        work.lens[FILM_POSITION_ROW + 1, lane],
        work.lens[FILM_POSITION_ROW + 2, lane],
    )
