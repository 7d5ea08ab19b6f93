"""The environment as a light: directions drawn in proportion to its radiance.

Not a kind of the `lights` list: a scene has it as soon as its environment can be drawn from and some material is lit.
"""

from typing import NamedTuple

from raytracer.core.sampling import sample_2d
from raytracer.core.vec import scale
from raytracer.plugins.environments.base.interface import background_with_pdf, sample_background
from raytracer.plugins.lights.base import interface
from raytracer.plugins.materials.base.interface import BLACK, LIGHT_POINT


class Background(NamedTuple):
    """Table of one light, the scene's own environment."""


@interface.sample_light.register(Background)
def sample_light_background(table, scene, point, time, u, draws):
    u1, u2 = sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + LIGHT_POINT)
    direction, radiance, pdf = sample_background(scene.environment, u1, u2)
    return interface.infinite_light_sample(direction, scale(1.0 / pdf, radiance) if pdf > 0.0 else BLACK, pdf)


@interface.infinite_radiance.register(Background)
def infinite_radiance_background(table, scene, direction, pdf, heuristic):
    radiance, by_light = background_with_pdf(scene.environment, direction)
    return scale(interface.mis_weight_path(heuristic, pdf, by_light), radiance)
