"""What a camera that may stand in solids or liquids begins in, looked up before its rays go."""

import math

import numpy as np

from raytracer import embree
from raytracer.embree import GEOMETRY, MISS, TFAR
from raytracer.geometry import spawn_point
from raytracer.instances import meet
from raytracer.interior import Interior, Submerged, look_past, settle_within
from raytracer.jit import generic
from raytracer.paths import MOST_PASSED, drop_lost, found_in, load3, load_ray, set_time, time_of
from raytracer.vec import dot


@generic
def look_around(interior, scene, work, live):
    """Find out what the camera's rays begin in; returns the number of rays traced."""
    raise NotImplementedError


@look_around.register(type(None))
def _(interior, scene, work, live):
    return 0


@look_around.register(Interior)
def _(interior, scene, work, live):
    return look_up(interior.camera, scene, work, live)


@generic
def look_up(camera, scene, work, live):
    """Count the solids that the camera's rays begin in; returns the number of rays traced."""
    raise NotImplementedError


@look_up.register(type(None))
def _(camera, scene, work, live):
    return 0


@look_up.register(Submerged)
def _(camera, scene, work, live):
    # The room of shadow rays is still free.
    for slot in range(live):
        sample = work.sample[slot]
        work.shadow_sample[slot] = sample
        embree.set_ray(work.shadows, slot, load3(work.path, slot, 0), camera.up, math.inf)
        set_time(scene.shutter, work.shadows, slot, time_of(scene.shutter, work, sample))
    rays, count = 0, live
    for _ in range(MOST_PASSED):
        if count == 0:
            break
        embree.intersect(scene.accel, work.shadows, count)
        rays += count
        going = 0
        for slot in range(count):
            sample = work.shadow_sample[slot]
            table = work.shadows.ints[GEOMETRY, slot]
            if table == MISS:
                continue
            origin, direction = load_ray(work.shadows, slot)
            instance, primitive = found_in(scene, work.shadows, slot)
            near, time = np.float64(work.shadows.floats[TFAR, slot]), time_of(scene.shutter, work, sample)
            hit = meet(scene.instances, scene, instance, table, primitive, origin, direction, near, time)
            look_past(scene.interior, work.within, sample, hit.material, dot(direction, hit.normal) < 0.0)
            embree.set_ray(work.shadows, going, spawn_point(hit, direction), direction, math.inf)
            set_time(scene.shutter, work.shadows, going, time)
            work.shadow_sample[going] = sample
            going += 1
        count = going
    drop_lost(scene.passage, work, work.shadow_sample, count)
    for slot in range(live):
        settle_within(scene.interior, scene.media, work, work.sample[slot])
    return rays
