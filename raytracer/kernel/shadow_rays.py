"""Shadow rays: aimed at lights, and followed through what lets them pass to what they bring."""

import math

import numpy as np

from raytracer import embree
from raytracer.embree import GEOMETRY, MISS, TFAR
from raytracer.geometry import Site, spawn_point
from raytracer.hues import LensSpectrum, Spectrum, tinted
from raytracer.instances import meet
from raytracer.interior import boundary_of, kept, move_within, shadow_goes_through
from raytracer.jit import generic, kernel
from raytracer.lights.interface import Lights, Unaimed
from raytracer.materials.interface import PASS, SLOTS, WHITE, Draws, select_again
from raytracer.origin import as_written
from raytracer.pathlog import note_arrival, note_met, note_occluded
from raytracer.paths import (
    MOST_PASSED,
    PASS_STRIDE,
    Passage,
    drop_lost,
    found_in,
    gather,
    keep_goal,
    load3,
    load_ray,
    move_shadow,
    set_time,
    store3,
    time_of,
    veil,
)
from raytracer.vec import dot, mul, norm, scale, sub


@kernel
def aim(scene, work, slot, sample, start, light, arriving, time):
    """Set shadow ray `slot` from `start` to a LightSample, and the radiance that it brings if nothing is in its way."""
    way = sub(light.target, start)
    distance = norm(way)
    direction = scale(1.0 / distance, way)
    # A negative end would count as something met.
    end = max(0.0, distance - light.gap)
    embree.set_ray(work.shadows, slot, start, direction, end)
    keep_goal(scene.passage, work, slot, start, direction, end)
    set_time(scene.shutter, work.shadows, slot, time)
    work.shadow_sample[slot] = sample
    store3(work.unshadowed, slot, 0, arriving)


@generic
def deliver(spectrum, work, slot, through):
    """Add to a sample what a shadow ray brings, of which this comes through what is in its way."""
    raise NotImplementedError


@deliver.register(type(None))
@deliver.register(LensSpectrum)
def _(spectrum, work, slot, through):
    for channel in range(3):
        work.radiance[work.shadow_sample[slot], channel] += through[channel] * work.unshadowed[slot, channel]


@deliver.register(Spectrum)
def _(spectrum, work, slot, through):
    gather(spectrum, work, work.shadow_sample[slot], through, load3(work.unshadowed, slot, 0))


@generic
def resolve_shadows(lights, scene, work, count, key, first, segment):
    """Trace the shadow rays, and add what arrives; returns the number of rays traced."""
    raise NotImplementedError


@resolve_shadows.register(type(None))
@resolve_shadows.register(Unaimed)
def _(lights, scene, work, count, key, first, segment):
    return 0


@resolve_shadows.register(Lights)
def _(lights, scene, work, count, key, first, segment):
    return follow_shadows(scene.passage, scene, work, count, key, first, segment) if count > 0 else 0


@generic
def follow_shadows(passage, scene, work, count, key, first, segment):
    """Add what each shadow ray brings, where it arrives; returns the number of rays traced."""
    raise NotImplementedError


@follow_shadows.register(type(None))
def _(passage, scene, work, count, key, first, segment):
    embree.occluded(scene.accel, work.shadows, count)
    for slot in range(count):
        if work.shadows.floats[TFAR, slot] >= 0.0:
            distance = np.float64(work.shadows.floats[TFAR, slot])
            through = veil(scene.media, scene, work, slot, distance, key, first, segment)
            through = tinted(scene.spectrum, work, work.shadow_sample[slot], through)
            deliver(scene.spectrum, work, slot, through)
            note_arrival(work.log, work, work.shadow_sample[slot], mul(through, load3(work.unshadowed, slot, 0)))
        else:
            note_occluded(work.log, scene, work, slot)
    return count


@follow_shadows.register(Passage)
def _(passage, scene, work, count, key, first, segment):
    """A surface lets a shadow ray pass as often as it lets a path pass."""
    rays = 0
    for surface in range(1, MOST_PASSED):
        if count == 0:
            break
        embree.intersect(scene.accel, work.shadows, count)
        rays += count
        going = 0
        for slot in range(count):
            sample = work.shadow_sample[slot]
            time = time_of(scene.shutter, work, sample)
            near = np.float64(work.shadows.floats[TFAR, slot])
            through = veil(scene.media, scene, work, slot, near, key, first, segment)
            through = mul(through, kept(scene.interior, work.shadow_within, slot, near))
            arriving = mul(tinted(scene.spectrum, work, sample, through), load3(work.unshadowed, slot, 0))
            table = work.shadows.ints[GEOMETRY, slot]
            if table == MISS:
                gather(scene.spectrum, work, sample, arriving, WHITE)
                note_arrival(work.log, work, sample, arriving)
                continue

            # Meet a surface, and end there unless it lets the ray pass.
            origin, direction = load_ray(work.shadows, slot)
            instance, primitive = found_in(scene, work.shadows, slot)
            hit = meet(scene.instances, scene, instance, table, primitive, origin, direction, near, time)
            front = dot(direction, hit.normal) < 0.0
            draws = Draws(scene.sampler, key, first + sample, (segment + 1) * SLOTS + surface * PASS_STRIDE)
            local = as_written(scene.origin, scene.instances, instance, hit.local)
            site = Site(local, hit.u, hit.v, near, None)
            reference = select_again(scene.selectors, scene, hit.material, front, site, draws)
            if boundary_of(scene.interior, work.shadow_within, slot, hit.material, reference, front) != PASS:
                note_met(work.log, work, slot, sample, work.shadows, False)
                continue
            note_met(work.log, work, slot, sample, work.shadows, True)
            shadow_goes_through(scene.interior, scene, work, slot, hit.material, front)
            # Off the surface, it is aimed at its end anew: it would miss that by as much as it was moved.
            start = spawn_point(hit, direction)
            goal = load3(work.shadow_goal, slot, 0)
            way, rest = goal, math.inf
            if work.shadow_goal[slot, 3] != 0.0:
                way = sub(goal, start)
                rest = norm(way)
                if dot(way, direction) <= 0.0:
                    gather(scene.spectrum, work, sample, arriving, WHITE)
                    note_arrival(work.log, work, sample, arriving)
                    continue
                way = scale(1.0 / rest, way)
            embree.set_ray(work.shadows, going, start, way, rest)
            store3(work.shadow_goal, going, 0, goal)
            work.shadow_goal[going, 3] = work.shadow_goal[slot, 3]
            set_time(scene.shutter, work.shadows, going, time)
            move_shadow(scene.media, work, slot, going)
            move_within(scene.interior, work, slot, going)
            work.shadow_sample[going] = sample
            store3(work.unshadowed, going, 0, arriving)
            going += 1
        count = going
    drop_lost(passage, work, work.shadow_sample, count)
    return rays
