"""What every light kind gives to kernels, and the choice among the kinds.

A kind's file holds its packed table (one row a light) and its cases of the functions below.
"""

from typing import Any, NamedTuple

from raytracer.jit import fold, generic, kernel, switch
from raytracer.materials.interface import LIGHT
from raytracer.sampling import sample_1d
from raytracer.vec import Vec3, add, scale


class LightSample(NamedTuple):
    """Light that may reach a point.

    direction, unit, towards the light; weight, its radiance (W/(m2 sr)) without what may stand between, over the pdf;
    pdf (1/sr) of the direction, infinite for a light without extent, 0 where nothing can arrive; target, the light's
    point; gap, how far before it a shadow ray ends (m), minus infinity for a light at infinity.
    """

    direction: Vec3
    weight: Vec3
    pdf: float
    target: Vec3
    gap: float


class Lights(NamedTuple):
    """tables, one a kind of light, among which each is chosen as often as any other."""

    tables: tuple[Any, ...]


@generic
def sample_light(table, scene, point, time, u, draws):
    """Choose a light of the table by the number `u`, and a point on it as seen from `point`: a LightSample."""
    raise NotImplementedError


@generic
def pdf_hit(table, scene, instance, number, primitive, origin, point, normal, time):
    """Density in solid angle (1/sr) with which `sample_light` at `origin` aims at `point` on a primitive."""
    raise NotImplementedError


@pdf_hit.register(tuple)
def _(table, scene, instance, number, primitive, origin, point, normal, time):
    return 0.0


@generic
def pdf_escape(table, scene, direction):
    """Density in solid angle (1/sr) with which `sample_light` aims at the environment along `direction`."""
    raise NotImplementedError


@pdf_escape.register(tuple)
def _(table, scene, direction):
    return 0.0


@generic
def arriving(table, direction, pdf, tables):
    """Radiance, along `direction`, of lights at infinity, besides the environment, that a ray which leaves meets.

    It is MIS-weighted: `pdf` is the density with which the ray's direction was drawn, and `tables` the number of
    tables among which `sample_lights` chooses.
    """
    raise NotImplementedError


@arriving.register(tuple)
def _(table, direction, pdf, tables):
    return (0.0, 0.0, 0.0)


@kernel
def _plus(a, b):
    return a + b


_sample_any = switch(sample_light)
_pdf_hit_all = fold(pdf_hit, _plus)
_pdf_escape_all = fold(pdf_escape, _plus)
_arriving_all = fold(arriving, add)


@generic
def sample_lights(lights, scene, point, time, draws):
    """Choose a light among all, and a point on it as seen from `point`: a LightSample."""
    raise NotImplementedError


@sample_lights.register(Lights)
def _(lights, scene, point, time, draws):
    u = sample_1d(draws.sampler, draws.key, draws.index, draws.dimension + LIGHT)
    kinds = len(lights.tables)
    if kinds == 1:
        return sample_light(lights.tables[0], scene, point, time, u, draws)
    chosen = min(kinds - 1, int(kinds * u))
    found = _sample_any(lights.tables, chosen, scene, point, time, kinds * u - chosen, draws)
    return LightSample(found.direction, scale(kinds, found.weight), found.pdf / kinds, found.target, found.gap)


@generic
def pdf_light(lights, scene, instance, number, primitive, origin, point, normal, time):
    """Density in solid angle (1/sr) with which `sample_lights` at `origin` aims at `point` on a primitive."""
    raise NotImplementedError


@pdf_light.register(type(None))
def _(lights, scene, instance, number, primitive, origin, point, normal, time):
    return 0.0


@generic
def pdf_environment(lights, scene, direction):
    """Density in solid angle (1/sr) with which `sample_lights` aims at the environment along `direction`."""
    raise NotImplementedError


@pdf_environment.register(type(None))
def _(lights, scene, direction):
    return 0.0


@pdf_light.register(Lights)
def _(lights, scene, instance, number, primitive, origin, point, normal, time):
    found = _pdf_hit_all(lights.tables, scene, instance, number, primitive, origin, point, normal, time)
    return found / len(lights.tables)


@pdf_environment.register(Lights)
def _(lights, scene, direction):
    return _pdf_escape_all(lights.tables, scene, direction) / len(lights.tables)


@generic
def escape(lights, direction, pdf):
    """Radiance of lights at infinity along `direction`, besides the environment: MIS-weighted, see `arriving`."""
    raise NotImplementedError


@escape.register(type(None))
def _(lights, direction, pdf):
    return (0.0, 0.0, 0.0)


@escape.register(Lights)
def _(lights, direction, pdf):
    return _arriving_all(lights.tables, direction, pdf, len(lights.tables))
