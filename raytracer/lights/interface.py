"""What every light kind gives to kernels."""

from typing import NamedTuple

from raytracer.jit import generic
from raytracer.vec import Vec3


class LightSample(NamedTuple):
    """Light that may reach a point.

    direction, unit, towards the light; radiance (W/(m2 sr)) without what may stand between; pdf (1/sr) of the
    direction, 0 where nothing can arrive; target, the light's point; gap, how far before it a shadow ray ends (m).
    """

    direction: Vec3
    radiance: Vec3
    pdf: float
    target: Vec3
    gap: float


@generic
def sample_light(lights, primitives, materials, point, draws):
    """Choose a light and a point on it, as seen from `point`: a LightSample."""
    raise NotImplementedError


@generic
def pdf_light(lights, primitives, table, primitive, origin, point, normal):
    """Density in solid angle (1/sr) with which `sample_light` at `origin` aims at `point` on a primitive."""
    raise NotImplementedError


@pdf_light.register(type(None))
def _(lights, primitives, table, primitive, origin, point, normal):
    return 0.0
