"""Next-event estimation: lights are sampled from each vertex of a path, and a shadow ray to one of them queued.

Each table of lights is sampled by itself, and of these samples one is chosen in proportion to what it would bring if
nothing were in its way.  So a single shadow ray is nearly as good as one to each; a scene with one table has no choice.

References: Veach 1997, thesis, ch. 9 (multiple importance sampling); Talbot, Cline, Egbert 2005, "Importance Resampling
for Global Illumination", EGSR (choice by what is known without a shadow ray).
"""

from typing import NamedTuple

from raytracer.core.compiler.dispatch import generic, kernel, optional
from raytracer.core.geometry import Interaction, spawn_point
from raytracer.core.sampling import sample_1d, sample_2d
from raytracer.core.vec import Vec3, is_black, mul, scale
from raytracer.kernel.hero_wavelength import upsample_bsdf, upsample_rgb
from raytracer.kernel.medium_boundaries import cross_shadow_towards
from raytracer.kernel.normal_mapping import evaluate_surface
from raytracer.kernel.path_log import ShadowRay, record
from raytracer.kernel.shadow_rays import queue_shadow_ray
from raytracer.plugins.lights.base.interface import (
    Lights,
    LightSample,
    NoLightSampling,
    mis_weight_light_sample,
    sample_light_of,
)
from raytracer.plugins.materials.base.interface import BLACK, LIGHT
from raytracer.plugins.media.base.interface import evaluate_phase_at


class Candidate(NamedTuple):
    """A light sample, and what it would bring to a path if nothing were in its way.

    light : the LightSample.
    value : of the BSDF times the cosine, or of the phase function.
    pdf (1/sr) : with which the path itself would go towards the light.
    weight : of multiple importance sampling.
    radiance : times the path's throughput.
    """

    light: LightSample
    value: Vec3
    pdf: float
    weight: float
    radiance: Vec3


_NOTHING = Candidate(LightSample(BLACK, BLACK, 0.0, BLACK, 0.0), BLACK, 0.0, 0.0, BLACK)
"""The choice among no candidates."""


@generic
def evaluate_vertex(vertex, scene, work, path, direction):
    """Evaluate what a vertex, an Interaction or a point in a medium, scatters to a direction, and the pdf (1/sr)."""


@evaluate_vertex.register(Interaction)
def evaluate_vertex_on_surface(vertex, scene, work, path, direction):
    value, pdf = evaluate_surface(scene.normal_mapping, scene, vertex, direction)
    return upsample_bsdf(scene.spectrum, work, path.sample, vertex.material, value), pdf


@evaluate_vertex.register(tuple)
def evaluate_vertex_in_medium(vertex, scene, work, path, direction):
    phase = evaluate_phase_at(scene.media, path.medium, path.direction, direction)
    return (phase, phase, phase), phase


@kernel
def _sample_candidate(lights, number, scene, work, path, vertex, point, u, draws):
    """Sample a light of the table of this number: a Candidate."""
    light = sample_light_of(lights, number, scene, point, path.time, u, draws)
    if is_black(light.weight):
        return Candidate(light, BLACK, 0.0, 0.0, BLACK)
    value, pdf = evaluate_vertex(vertex, scene, work, path, light.direction)
    if is_black(value):
        return Candidate(light, BLACK, 0.0, 0.0, BLACK)
    weight = mis_weight_light_sample(lights.heuristic, light.pdf, pdf)
    incoming = upsample_rgb(scene.spectrum, work, path.sample, light.weight)
    return Candidate(light, value, pdf, weight, scale(weight, mul(mul(path.throughput, value), incoming)))


@kernel
def _sum(radiance):
    return radiance[0] + radiance[1] + radiance[2]


@kernel
def keep_one(kept, total, candidate, u):
    """Keep either the candidate kept so far, of those of radiance `total` together, or another.

    Returns it, the total with the other, and a new number in [0, 1).

    References: Chao 1982, "A General Purpose Unequal Probability Sampling Plan", Biometrika 69(3).
    """
    added = _sum(candidate.radiance)
    # What is not a number goes into the total, and is counted with it.
    if added == 0.0:
        return kept, total, u
    total += added
    at = u * total
    if at < added:
        return candidate, total, at / added
    return kept, total, (at - added) / (total - added)


@kernel
def sample_candidates(lights, scene, work, path, vertex, point, draws):
    """Sample all tables of lights at a vertex: one Candidate, of radiance over the probability of its choice."""
    if len(lights.tables) == 1:
        u = sample_1d(draws.sampler, draws.key, draws.index, draws.dimension + LIGHT)
        return _sample_candidate(lights, 0, scene, work, path, vertex, point, u, draws)
    u, choice = sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + LIGHT)
    kept, total = _NOTHING, 0.0
    for number in range(len(lights.tables)):
        candidate = _sample_candidate(lights, number, scene, work, path, vertex, point, u, draws)
        kept, total, choice = keep_one(kept, total, candidate, choice)
    if total == 0.0:
        return kept
    radiance = scale(total / _sum(kept.radiance), kept.radiance)
    return Candidate(kept.light, kept.value, kept.pdf, kept.weight, radiance)


@optional(NoLightSampling)
def sample_direct_light(lights, scene, work, path, surface, draws):
    """Sample the lights at a surface, and queue a shadow ray to one, unless the path sees none of their light there."""


@sample_direct_light.register(Lights)
def sample_direct_light_lights(lights, scene, work, path, surface, draws):
    light, value, pdf, weight, radiance = sample_candidates(
        lights, scene, work, path, surface, surface.hit.point, draws
    )
    if is_black(radiance):
        return
    start = spawn_point(surface.hit, light.direction)
    slot = queue_shadow_ray(scene, work, path, start, light.target, light.gap, radiance)
    cross_shadow_towards(scene, work.shadows, slot, surface, light.direction)
    record(work.log, work, path.sample, ShadowRay(slot, start, light, value, pdf, weight, radiance))


@optional(NoLightSampling)
def sample_direct_light_in_medium(lights, scene, work, path, point, draws):
    """Sample the lights where a path scatters in its medium, and queue a shadow ray to one, unless it sees none."""


@sample_direct_light_in_medium.register(Lights)
def sample_direct_light_in_medium_lights(lights, scene, work, path, point, draws):
    light, value, pdf, weight, radiance = sample_candidates(lights, scene, work, path, point, point, draws)
    if is_black(radiance):
        return
    slot = queue_shadow_ray(scene, work, path, point, light.target, light.gap, radiance)
    record(work.log, work, path.sample, ShadowRay(slot, point, light, value, pdf, weight, radiance))
