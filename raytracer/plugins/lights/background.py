"""The environment as a light: directions drawn in proportion to its radiance.

Not a kind of the `lights` list: a scene has it as soon as its environment can be drawn from and some material is lit.
"""

from typing import NamedTuple

from raytracer.environments.interface import background_with_pdf, sample_background
from raytracer.lights.interface import arriving, at_infinity, sample_light, weight_found
from raytracer.materials.interface import BLACK, LIGHT_POINT
from raytracer.sampling import sample_2d
from raytracer.vec import scale


class Background(NamedTuple):
    """The one light of its table: the scene's own environment."""


@sample_light.register(Background)
def _(table, scene, point, time, u, draws):
    u1, u2 = sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + LIGHT_POINT)
    direction, radiance, pdf = sample_background(scene.environment, u1, u2)
    return at_infinity(direction, scale(1.0 / pdf, radiance) if pdf > 0.0 else BLACK, pdf)


@arriving.register(Background)
def _(table, scene, direction, pdf, tables, heuristic):
    radiance, by_light = background_with_pdf(scene.environment, direction)
    return scale(weight_found(heuristic, pdf, by_light / tables), radiance)
