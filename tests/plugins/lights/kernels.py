"""Functions of lights, for rows of random numbers, times and points."""

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.embree import MISS
from raytracer.core.geometry import Hit, Interaction, Site
from raytracer.core.sampling import sample_1d
from raytracer.core.shutter.timing import Timing
from raytracer.plugins.lights.base.interface import escaped_radiance, pdf_light, sample_light_of
from raytracer.plugins.materials.base.interface import LIGHT
from raytracer.schema.registry import LIGHTS
from tests.vectorised import random_draws, rows, vectorised


@kernel
def _sample(lights, scene, point, time, draws):
    u = sample_1d(draws.sampler, draws.key, draws.index, draws.dimension + LIGHT)
    return sample_light_of(lights, 0, scene, point, time, u, draws)


@kernel
def _pdf(scene, table, primitive, origin, point, normal):
    hit = Hit(point, normal, normal, 0.0, 0.0, 0.0, 0, normal, normal, point)
    site = Site(point, 0.0, 0.0, 1.0)
    surface = Interaction(MISS, table, primitive, hit, site, 0, True, normal, origin, normal, 1.0, None)
    return pdf_light(scene.lights, scene, surface)


def aim(lights, scene, point, count, *, seed=3, times=None):
    """Samples of the first table of lights, from a point: a LightSample of `count` rows."""
    time = None if times is None else rows(times)
    return vectorised(_sample)(lights, scene, tuple(map(float, point)), time, random_draws(count, seed=seed))


def pdf_of(scene, table, primitive, origin, points, normals):
    """`pdf_light` of points on primitives that move in no way."""
    return vectorised(_pdf)(scene, rows(table), rows(primitive), origin, rows(points), rows(normals))


def escaped(lights, directions, pdf):
    """`escaped_radiance` along directions (n, 3) drawn with a density, of lights alone: (n, 3)."""
    return vectorised(escaped_radiance)(lights, None, rows(directions), float(pdf))


def table_of(kind, *items):
    """The packed table of lights of a kind, from their keys; the shutter is open for a second, and nothing moves."""
    cls = LIGHTS.specs()[kind]
    lights = [cls.model_validate({"type": kind, **keys}) for keys in items]
    lights = [light.at_exposure(Timing(0.0, 1.0), (0.0, 0.0, 9.0), False) for light in lights]
    shining = [light for light in lights if light.shines()]
    return cls.pack(shining) if shining else None
