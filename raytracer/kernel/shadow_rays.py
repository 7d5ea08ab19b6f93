"""Shadow rays: queued to sampled lights, traced through transparent surfaces and media, and what they bring."""

import math

import numpy as np

from raytracer.core import embree
from raytracer.core.compiler.dispatch import kernel, optional
from raytracer.core.embree import GEOMETRY, MISS, TFAR, load_float, load_int
from raytracer.core.geometry import Site, spawn_point
from raytracer.core.vec import dot, mul, norm, scale, sub
from raytracer.core.world_origin import to_authored_space
from raytracer.kernel.hero_wavelength import add_radiance, upsample_rgb
from raytracer.kernel.interaction import load_ray, solve_hit
from raytracer.kernel.medium_boundaries import (
    cross_shadow,
    move_shadow_medium,
    shadow_transmittance,
    start_shadow_medium,
)
from raytracer.kernel.nested_dielectrics import beer_transmittance, resolve_boundary
from raytracer.kernel.path_log import Occluded, ShadowHit, Unoccluded, record
from raytracer.kernel.path_rows import load3, store3
from raytracer.kernel.path_state import path_time, push, sample_draws, set_ray_time, take_all
from raytracer.kernel.transparency import (
    MAX_PASSTHROUGHS,
    PASSTHROUGH_STRIDE,
    TransparentShadows,
    discard_unfinished,
    store_shadow_target,
)
from raytracer.plugins.lights.base.interface import Lights, NoLightSampling
from raytracer.plugins.materials.base.dispatch import select_for_shadow_ray
from raytracer.plugins.materials.base.interface import DIMENSIONS_PER_SEGMENT, PASSTHROUGH, WHITE


@kernel
def queue_shadow_ray(scene, work, path, start, target, gap, radiance):
    """Queue a shadow ray from `start` to a distance `gap` before `target`, with the radiance that it brings.

    Returns its slot.  It starts in the medium and the solids that the path is in.
    """
    shadows = work.shadows
    slot = push(shadows.queue, path.sample)
    offset = sub(target, start)
    distance = norm(offset)
    direction = scale(1.0 / distance, offset)
    # A negative end would count as an occlusion.
    end = max(0.0, distance - gap)
    embree.set_ray(shadows.rays, slot, start, direction, end)
    store_shadow_target(scene.transparency, shadows, slot, start, direction, end)
    set_ray_time(scene.shutter, shadows.rays, slot, path.time)
    start_shadow_medium(scene, work, slot, path)
    store3(shadows.radiance, slot, 0, radiance)
    return slot


@optional(NoLightSampling)
def trace_shadow_rays(lights, scene, work, rounds):
    """Trace the shadow rays that light sampling has queued; returns the number of rays traced."""
    return 0


@trace_shadow_rays.register(Lights)
def trace_shadow_rays_lights(lights, scene, work, rounds):
    return trace_shadow_queue(scene.transparency, scene, work, rounds)


@kernel
def _shadow_draws(scene, work, sample, rounds, surfaces):
    """Return the random numbers of a shadow ray, for what it meets after so many surfaces."""
    return sample_draws(scene, work, sample, (rounds + 1) * DIMENSIONS_PER_SEGMENT + surfaces * PASSTHROUGH_STRIDE)


@optional
def trace_shadow_queue(transparency, scene, work, rounds):
    """Empty the queue of shadow rays: trace them, and add the radiance that arrives; returns the number of rays traced.

    rounds : of the batch before this one, by which random numbers are taken.
    """
    shadows = work.shadows
    count = take_all(shadows.queue)
    if count > 0:
        embree.occluded(scene.accel, shadows.rays, count)
    for slot in range(count):
        sample = shadows.queue.samples[slot]
        if load_float(shadows.rays, slot, TFAR) >= 0.0:
            distance = np.float64(load_float(shadows.rays, slot, TFAR))
            through = shadow_transmittance(
                scene.media, shadows, slot, distance, _shadow_draws(scene, work, sample, rounds, 0)
            )
            through = upsample_rgb(scene.spectrum, work, sample, through)
            _add_unoccluded(scene, work, sample, through, load3(shadows.radiance, slot, 0))
        else:
            record(work.log, work, sample, Occluded(slot, scene.accel))
    return count


@kernel
def _add_unoccluded(scene, work, sample, through, radiance):
    """Add the radiance of a shadow ray that arrives, times this transmittance."""
    add_radiance(scene.spectrum, work, sample, through, radiance)
    record(work.log, work, sample, Unoccluded(mul(through, radiance)))


@trace_shadow_queue.register(TransparentShadows)
def trace_shadow_queue_transparent_shadows(transparency, scene, work, rounds):
    """Follow shadow rays through transparent surfaces, which let them pass with the probability that paths do."""
    rays, queue = 0, work.shadows.queue
    for surfaces in range(1, MAX_PASSTHROUGHS):
        count = take_all(queue)
        if count == 0:
            break
        embree.intersect(scene.accel, work.shadows.rays, count)
        rays += count
        for slot in range(count):
            _extend_shadow_ray(scene, work, slot, rounds, surfaces)
    discard_unfinished(transparency, work, queue)
    return rays


@kernel
def _extend_shadow_ray(scene, work, slot, rounds, surfaces):
    """Follow a shadow ray to what it meets, its surface of this number, and queue it again if it goes on."""
    shadows = work.shadows
    sample = shadows.queue.samples[slot]
    distance = np.float64(load_float(shadows.rays, slot, TFAR))
    through = shadow_transmittance(scene.media, shadows, slot, distance, _shadow_draws(scene, work, sample, rounds, 0))
    through = mul(through, beer_transmittance(scene.nested_dielectrics, shadows.inside_counts, slot, distance))
    radiance = mul(upsample_rgb(scene.spectrum, work, sample, through), load3(shadows.radiance, slot, 0))
    if load_int(shadows.rays, slot, GEOMETRY) == MISS:
        _add_unoccluded(scene, work, sample, WHITE, radiance)
        return

    # Meet a surface, and end there unless it lets the ray pass.
    origin, direction = load_ray(shadows.rays, slot)
    time = path_time(work, sample)
    instance, _, _, _, hit = solve_hit(scene, shadows.rays, slot, origin, direction, time)
    front = dot(direction, hit.normal) < 0.0
    local = to_authored_space(scene.origin, scene.instances, instance, hit.local)
    site = Site(local, hit.u, hit.v, distance, None)
    surface_draws = _shadow_draws(scene, work, sample, rounds, surfaces)
    material = select_for_shadow_ray(scene.selectors, scene, hit.material, front, site, surface_draws)
    material = resolve_boundary(scene.nested_dielectrics, shadows.inside_counts, slot, hit.material, material, front)
    record(work.log, work, sample, ShadowHit(slot, material == PASSTHROUGH))
    if material != PASSTHROUGH:
        return
    cross_shadow(scene, shadows, slot, hit.material, front)

    # The ray was moved off the surface, and would miss its end by as much: aim at the end again.
    start = spawn_point(hit, direction)
    target, is_finite = load3(shadows.target, slot, 0), shadows.target[slot, 3]
    aim, rest = target, math.inf
    if is_finite != 0.0:
        aim = sub(target, start)
        rest = norm(aim)
        if dot(aim, direction) <= 0.0:
            _add_unoccluded(scene, work, sample, WHITE, radiance)
            return
        aim = scale(1.0 / rest, aim)
    to = push(shadows.queue, sample)
    embree.set_ray(shadows.rays, to, start, aim, rest)
    set_ray_time(scene.shutter, shadows.rays, to, time)
    store3(shadows.target, to, 0, target)
    shadows.target[to, 3] = is_finite
    move_shadow_medium(scene, shadows, slot, to)
    store3(shadows.radiance, to, 0, radiance)
