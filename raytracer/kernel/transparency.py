"""Surfaces that light goes straight through: paths pass them without scattering, and shadow rays are attenuated."""

import math
from typing import NamedTuple

from raytracer.core.compiler.dispatch import optional
from raytracer.core.geometry import spawn_point
from raytracer.core.vec import madd
from raytracer.kernel.medium_boundaries import cross_towards
from raytracer.kernel.path_rows import store3
from raytracer.kernel.path_state import Path, store_path, take_all
from raytracer.plugins.materials.base.interface import PASSTHROUGH

MAX_PASSTHROUGHS = 1024
"""Surfaces that a path may go straight through; a sample that meets more is dropped, and counted."""


PASSTHROUGH_STRIDE = 2**22
"""Distance between the random dimensions of a shadow ray's surfaces: more than the segments of a path take."""


class TransparentShadows(NamedTuple):
    """Transparency in a scene: shadow rays go on through surfaces, and paths do not count those as segments."""


@optional
def max_rounds(transparency, depth):
    """Return the largest number of rounds in which a batch is traced, for paths of `depth` segments."""
    return depth


@max_rounds.register(TransparentShadows)
def max_rounds_transparent_shadows(transparency, depth):
    return depth + MAX_PASSTHROUGHS


@optional
def first_vertex(transparency, origin):
    """Return a path's first vertex, at the camera; None where the ray's origin always is the last vertex."""


@first_vertex.register(TransparentShadows)
def first_vertex_transparent_shadows(transparency, origin):
    return origin


@optional
def no_passthroughs(transparency):
    """Return the number of surfaces that a new path went straight through; None where it cannot."""


@no_passthroughs.register(TransparentShadows)
def no_passthroughs_transparent_shadows(transparency):
    return 0


@optional
def pass_through(transparency, scene, work, path, surface):
    """Continue a path straight through a surface that is not there for it; returns False if it is there."""
    return False


@pass_through.register(TransparentShadows)
def pass_through_transparent_shadows(transparency, scene, work, path, surface):
    if surface.material != PASSTHROUGH:
        return False
    sample, depth, _, direction, throughput, pdf, time, _, vertex, passthroughs = path
    medium, origin = cross_towards(scene, work, path, surface, direction), spawn_point(surface.hit, direction)
    path = Path(sample, depth, origin, direction, throughput, pdf, time, medium, vertex, passthroughs + 1)
    store_path(work, path)
    return True


@optional
def store_shadow_target(transparency, shadows, slot, start, direction, length):
    """Store the end of a shadow ray, which may have to aim at it again."""


@store_shadow_target.register(TransparentShadows)
def store_shadow_target_transparent_shadows(transparency, shadows, slot, start, direction, length):
    finite = length < math.inf
    store3(shadows.target, slot, 0, madd(start, length, direction) if finite else direction)
    shadows.target[slot, 3] = 1.0 if finite else 0.0


@optional
def discard_unfinished(transparency, work, queue):
    """Drop the samples in a queue, which met more than `MAX_PASSTHROUGHS` transparent surfaces, and empty it.

    Their weight becomes NaN, so the film counts them among those that are not finite.  Without transparency all paths
    and rays end by themselves: the queue is empty.
    """


@discard_unfinished.register(TransparentShadows)
def discard_unfinished_transparent_shadows(transparency, work, queue):
    for entry in range(take_all(queue)):
        work.weight[queue.samples[entry]] = math.nan
