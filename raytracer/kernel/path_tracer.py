"""The path tracer: one loop for every scene, specialised by the scene's type when it is compiled.

It names no kind of a family, and no effect has a branch here: what a scene lacks is None in it, and the functions that
are called on None compile to nothing.  The steps of a segment are those of `extend_path`, in their order; each effect's
part in them stands in a file of its own.

The paths of some pixels advance together, a packet of samples of each, so that Embree traces full packets of rays even
when many have ended.  Paths that go on and shadow rays wait in queues until the whole batch has taken the step
(`path_state`).

References: Kajiya 1986, "The Rendering Equation"; Veach 1997, thesis, ch. 9 (multiple importance sampling) and
sec. 10.4 (Russian roulette); Laine, Karras, Aila 2013, "Megakernels Considered Harmful", HPG (queues of paths).
"""

import numpy as np

from raytracer.core.compiler.dispatch import entry, kernel, optional
from raytracer.core.compiler.intrinsics import share
from raytracer.core.embree import GEOMETRY, MISS, PACKET, TFAR, load_float, load_int
from raytracer.core.geometry import spawn_point
from raytracer.core.vec import is_black, mul, scale
from raytracer.kernel.aovs.base.layers import finish_aov_retrace, record_aovs, record_direct_light, start_aov_retrace
from raytracer.kernel.camera_medium import initialize_medium
from raytracer.kernel.camera_rays import start_camera_paths, start_path
from raytracer.kernel.direct_light import sample_direct_light
from raytracer.kernel.hero_wavelength import (
    DispersiveLens,
    DispersiveMaterials,
    add_radiance,
    enter_dispersion,
    estimate_contribution,
    max_traces,
    needs_retrace,
    path_wavelengths,
    restart_rgb_path,
    terminate_secondary_wavelengths,
    upsample_bsdf,
    upsample_rgb,
)
from raytracer.kernel.interaction import intersect_paths, surface_interaction
from raytracer.kernel.medium_boundaries import cross_towards
from raytracer.kernel.medium_sampling import sample_medium
from raytracer.kernel.normal_mapping import scatter_surface
from raytracer.kernel.path_log import Emission, Escape, Retrace, Scattering, SurfaceHit, begin_round, record
from raytracer.kernel.path_state import (
    BATCH_PIXELS,
    load_path,
    path_time,
    sample_draws,
    scattered_path,
    store_path,
    take_all,
    with_throughput,
)
from raytracer.kernel.pixel_accumulator import accumulate
from raytracer.kernel.russian_roulette import LEAST_THROUGHPUT, russian_roulette
from raytracer.kernel.shadow_rays import trace_shadow_rays
from raytracer.kernel.transparency import discard_unfinished, max_rounds, pass_through
from raytracer.plugins.lights.base.interface import escaped_radiance, mis_weight_emission
from raytracer.plugins.materials.base.dispatch import emission_at
from raytracer.plugins.materials.base.interface import DIMENSIONS_PER_SEGMENT


@entry
def render_tile(scene, film, work, left, top, right, bottom, begin, end):
    """Render samples begin .. end - 1 of the pixels left <= x < right, top <= y < bottom; returns the rays traced.

    Packets start at multiples of PACKET from `begin` on, so calls with such a `begin` give the same bits however the
    samples are split into calls.
    """
    shared_scene, workspace = share(scene), share(work)
    width, pixels = right - left, (right - left) * (bottom - top)
    rays = 0
    for pixel in range(0, pixels, BATCH_PIXELS):
        batch_end = min(pixel + BATCH_PIXELS, pixels)
        for index in range(begin, end, PACKET):
            count = min(PACKET, end - index)
            for number in range(pixel, batch_end):
                x, y = left + number % width, top + number // width
                start_camera_paths(shared_scene, film.aovs, workspace, x, y, index, (number - pixel) * count, count)
            rays += trace_batch(shared_scene, film.aovs, workspace, (batch_end - pixel) * count)
            for number in range(pixel, batch_end):
                x, y = left + number % width - film.left, top + number // width - film.top
                accumulate(scene.spectrum, scene.clamp, film, workspace, x, y, (number - pixel) * count, count)
    return rays


@kernel
def trace_batch(scene, aovs, work, size):
    """Trace the `size` samples of a batch from their camera rays on; returns the number of rays traced."""
    return initialize_medium(scene.nested_dielectrics, scene, work) + trace_wavelengths(
        scene.spectrum, scene, aovs, work, size
    )


@optional(DispersiveLens)
def trace_wavelengths(spectrum, scene, aovs, work, size):
    """Trace the queued paths, and those of the batch again whose wavelengths parted; returns the rays traced."""
    return trace_paths(scene, aovs, work)


@trace_wavelengths.register(DispersiveMaterials)
def trace_wavelengths_dispersive_materials(spectrum, scene, aovs, work, size):
    rays = 0
    for number in range(max_traces(spectrum.camera)):
        if number > 0:
            rays += _restart_paths(scene, aovs, work, number, size)
        rays += trace_paths(scene, aovs, work)
        if number > 0:
            _finish_retrace(aovs, work, size)
    return rays


@kernel
def _restart_paths(scene, aovs, work, number, size):
    """Queue the paths of those of the batch's `size` samples whose wavelength `number` was terminated.

    Returns the number of rays traced to find what the camera is in.
    """
    for sample in range(size):
        if needs_retrace(work, sample):
            begin_round(work.log, 0)
            start_aov_retrace(aovs, work, sample)
            origin, direction = restart_rgb_path(work, sample, number)
            record(work.log, work, sample, Retrace(number))
            start_path(scene, work, sample, origin, direction, path_time(work, sample))
    return initialize_medium(scene.nested_dielectrics, scene, work)


@kernel
def _finish_retrace(aovs, work, size):
    """Add what AOVs have recorded of the paths that were traced again."""
    for sample in range(size):
        if needs_retrace(work, sample):
            finish_aov_retrace(aovs, work, sample)


@kernel
def trace_paths(scene, aovs, work):
    """Trace the queued paths to their ends, adding radiance by sample; returns the number of rays traced."""
    rays = 0
    for rounds in range(max_rounds(scene.transparency, scene.depth)):
        live = work.queue.size[0]
        if live == 0:
            break
        begin_round(work.log, rounds)
        intersect_paths(scene, work)
        take_all(work.queue)
        for lane in range(live):
            extend_path(scene, aovs, work, lane, rounds)
        rays += live + trace_shadow_rays(scene.lights, scene, work, rounds)
    discard_unfinished(scene.transparency, work, work.queue)
    return rays


@kernel
def extend_path(scene, aovs, work, lane, rounds):
    """Extend the path of a lane by a segment, which Embree has traced, and scatter it at the segment's end."""
    path = load_path(work, lane, rounds)
    draws = sample_draws(scene, work, path.sample, (rounds + 1) * DIMENSIONS_PER_SEGMENT)

    # Medium: what is on the way, in which the path may scatter
    distance = np.float64(load_float(work.rays, lane, TFAR))
    path, ends_in_medium = sample_medium(scene.media, scene, work, path, distance, draws)
    if ends_in_medium:
        record_direct_light(aovs, work, path)
        return

    # Escape: the light from infinity
    if load_int(work.rays, lane, GEOMETRY) == MISS:
        add_escaped_radiance(scene, work, path)
        return

    # Interaction: the surface, its material, and its shading normal
    surface = surface_interaction(scene, work, lane, path, draws)
    waves = path_wavelengths(scene.spectrum, work, path.sample)
    record(work.log, work, path.sample, SurfaceHit(surface, path.throughput, waves))
    if pass_through(scene.transparency, scene, work, path, surface):
        return
    throughput, surface = enter_dispersion(scene.spectrum, work, path, surface)
    path = with_throughput(path, throughput)
    record_aovs(aovs, scene, work, path, surface)

    # Emission, weighted against what light sampling would have found
    add_emission(scene, work, path, surface)
    record_direct_light(aovs, work, path)
    if path.depth == scene.depth:
        return

    # Direct light: a shadow ray to a sampled light
    sample_direct_light(scene.lights, scene, work, path, surface, draws)

    # Scattering: the direction in which the path goes on, if Russian roulette lets it
    scatter_path(scene, work, path, surface, draws)


@kernel
def add_escaped_radiance(scene, work, path):
    """Add the radiance that comes from infinity along a path that leaves the scene."""
    radiance = escaped_radiance(scene.lights, scene, path.direction, path.pdf)
    radiance = upsample_rgb(scene.spectrum, work, path.sample, radiance)
    add_radiance(scene.spectrum, work, path.sample, path.throughput, radiance)
    record(work.log, work, path.sample, Escape(path.throughput, radiance))


@kernel
def add_emission(scene, work, path, surface):
    """Add the radiance that a surface emits towards the path."""
    emitted = emission_at(scene, surface.material, surface.front, surface.site)
    if is_black(emitted):
        return
    weight = mis_weight_emission(scene.lights, scene, surface, path.pdf)
    emitted = upsample_rgb(scene.spectrum, work, path.sample, emitted)
    add_radiance(scene.spectrum, work, path.sample, scale(weight, path.throughput), emitted)
    record(work.log, work, path.sample, Emission(emitted, weight))


@kernel
def scatter_path(scene, work, path, surface, draws):
    """Sample the BSDF at a surface, and queue the path if it goes on."""
    out = scatter_surface(scene.normal_mapping, scene, surface, draws)
    weight = upsample_bsdf(scene.spectrum, work, path.sample, surface.material, out.weight)
    throughput = terminate_secondary_wavelengths(
        scene.spectrum, work, path, surface, out.direction, mul(path.throughput, weight)
    )
    contribution = estimate_contribution(scene.spectrum, work, path.sample, throughput)
    survival = russian_roulette(scene, contribution, LEAST_THROUGHPUT, path.depth, draws)
    waves = path_wavelengths(scene.spectrum, work, path.sample)
    event = Scattering(surface.normal, out.direction, weight, out.pdf, throughput, survival, waves)
    record(work.log, work, path.sample, event)
    if survival == 0.0:
        return
    medium = cross_towards(scene, work, path, surface, out.direction)
    start = spawn_point(surface.hit, out.direction)
    throughput = scale(1.0 / survival, throughput)
    store_path(work, scattered_path(path, surface.hit.point, start, out.direction, throughput, out.pdf, medium))
