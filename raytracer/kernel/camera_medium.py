"""Find the solids and liquids that camera rays start in, before the rays are traced."""

import math

import numpy as np

from raytracer.core import embree
from raytracer.core.compiler.dispatch import kernel, optional
from raytracer.core.embree import GEOMETRY, MISS, load_int
from raytracer.core.geometry import spawn_point
from raytracer.core.vec import dot, load_vector
from raytracer.kernel.interaction import load_ray, solve_hit
from raytracer.kernel.medium_boundaries import medium_of_rank
from raytracer.kernel.nested_dielectrics import NestedDielectrics, SubmergedCamera, highest_rank
from raytracer.kernel.path_state import path_time, push, set_ray_time, take_all
from raytracer.kernel.transparency import MAX_PASSTHROUGHS, discard_unfinished
from raytracer.plugins.media.base.interface import Media


@optional
def initialize_medium(nested, scene, work):
    """Initialize the medium of the camera rays in the queue; returns the number of rays traced to find it."""
    return 0


@initialize_medium.register(NestedDielectrics)
def initialize_medium_nested_dielectrics(nested, scene, work):
    return _count_enclosing_solids(nested.camera, scene, work)


@optional
def _count_enclosing_solids(camera, scene, work):
    """Count the solids that enclose the origins of camera rays; returns the number of rays traced."""
    return 0


@_count_enclosing_solids.register(SubmergedCamera)
def _count_enclosing_solids_submerged_camera(camera, scene, work):
    # The shadow rays are not in use yet.
    probes, queue = work.shadows.rays, work.shadows.queue
    live = work.queue.size[0]
    for lane in range(live):
        sample = work.queue.samples[lane]
        slot = push(queue, sample)
        embree.set_ray(probes, slot, load_vector(work.paths.ray[np.uintp(sample)].origin), camera.up, math.inf)
        set_ray_time(scene.shutter, probes, slot, path_time(work, sample))
    rays = 0
    for _ in range(MAX_PASSTHROUGHS):
        count = take_all(queue)
        if count == 0:
            break
        embree.intersect(scene.accel, probes, count)
        rays += count
        for slot in range(count):
            _count_outward(scene, work, slot)
    discard_unfinished(scene.transparency, work, queue)
    for lane in range(live):
        _enter_counted(scene, work, work.queue.samples[lane])
    return rays


@kernel
def _count_outward(scene, work, slot):
    """Count a surface on the way from a camera ray's origin to the outside: a solid that is left encloses it."""
    shadows = work.shadows
    sample = shadows.queue.samples[slot]
    if load_int(shadows.rays, slot, GEOMETRY) == MISS:
        return
    origin, direction = load_ray(shadows.rays, slot)
    time = path_time(work, sample)
    _, _, _, _, hit = solve_hit(scene, shadows.rays, slot, origin, direction, time)
    rank = scene.nested_dielectrics.rank[hit.material]
    if rank >= 0:
        work.paths.inside_counts[sample, rank] += -1 if dot(direction, hit.normal) < 0.0 else 1
    to = push(shadows.queue, sample)
    embree.set_ray(shadows.rays, to, spawn_point(hit, direction), direction, math.inf)
    set_ray_time(scene.shutter, shadows.rays, to, time)


@kernel
def _enter_counted(scene, work, sample):
    """Start a path in the solids that were counted on the way out."""
    counts, solids = work.paths.inside_counts, len(scene.nested_dielectrics.surface)
    for rank in range(solids):
        counts[sample, rank] = max(0, counts[sample, rank])
    highest = highest_rank(counts, sample, solids, -1)
    if highest >= 0:
        _set_medium(scene.media, scene.nested_dielectrics, work.paths, sample, highest)


@optional
def _set_medium(media, nested, paths, sample, rank):
    """Start a path in the medium of the solids of this rank."""


@_set_medium.register(Media)
def _set_medium_media(media, nested, paths, sample, rank):
    paths.medium[sample] = medium_of_rank(media, nested, 0, rank)
