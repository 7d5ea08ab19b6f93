"""Next-event estimation: a light is sampled from each vertex of a path, and a shadow ray to it queued."""

from raytracer.core.compiler.dispatch import optional
from raytracer.core.geometry import spawn_point
from raytracer.core.vec import is_black, mul, scale
from raytracer.kernel.hero_wavelength import upsample_bsdf, upsample_rgb
from raytracer.kernel.medium_boundaries import cross_shadow_towards
from raytracer.kernel.normal_mapping import evaluate_surface
from raytracer.kernel.path_log import ShadowRay, record
from raytracer.kernel.shadow_rays import queue_shadow_ray
from raytracer.plugins.lights.base.interface import Lights, NoLightSampling, mis_weight_light_sample, sample_lights
from raytracer.plugins.media.base.interface import evaluate_phase_at


@optional(NoLightSampling)
def sample_direct_light(lights, scene, work, path, surface, draws):
    """Sample a light at a surface, and queue a shadow ray to it, unless the path sees none of its light there."""


@sample_direct_light.register(Lights)
def sample_direct_light_lights(lights, scene, work, path, surface, draws):
    light = sample_lights(lights, scene, surface.hit.point, path.time, draws)
    if is_black(light.weight):
        return
    value, pdf = evaluate_surface(scene.normal_mapping, scene, surface, light.direction)
    if is_black(value):
        return
    value = upsample_bsdf(scene.spectrum, work, path.sample, surface.material, value)
    weight = mis_weight_light_sample(lights.heuristic, light.pdf, pdf)
    radiance = scale(
        weight, mul(mul(path.throughput, value), upsample_rgb(scene.spectrum, work, path.sample, light.weight))
    )
    start = spawn_point(surface.hit, light.direction)
    slot = queue_shadow_ray(scene, work, path, start, light.target, light.gap, radiance)
    cross_shadow_towards(scene, work.shadows, slot, surface, light.direction)
    record(work.log, work, path.sample, ShadowRay(slot, start, light, value, pdf, weight, radiance))


@optional(NoLightSampling)
def sample_direct_light_in_medium(lights, scene, work, path, point, draws):
    """Sample a light where a path scatters in its medium, and queue a shadow ray to it, unless it sees none of it."""


@sample_direct_light_in_medium.register(Lights)
def sample_direct_light_in_medium_lights(lights, scene, work, path, point, draws):
    light = sample_lights(lights, scene, point, path.time, draws)
    if is_black(light.weight):
        return
    phase = evaluate_phase_at(scene.media, path.medium, path.direction, light.direction)
    if phase == 0.0:
        return
    weight = mis_weight_light_sample(lights.heuristic, light.pdf, phase)
    radiance = scale(
        phase * weight, mul(path.throughput, upsample_rgb(scene.spectrum, work, path.sample, light.weight))
    )
    slot = queue_shadow_ray(scene, work, path, point, light.target, light.gap, radiance)
    record(work.log, work, path.sample, ShadowRay(slot, point, light, (phase, phase, phase), phase, weight, radiance))
