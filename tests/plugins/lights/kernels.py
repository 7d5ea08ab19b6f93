"""Compiled loops over lights."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import entry, kernel
from raytracer.core.embree import MISS
from raytracer.core.geometry import Hit, Interaction, Site
from raytracer.core.sampling import SAMPLERS, pixel_key, sample_1d
from raytracer.core.shutter.timing import Timing
from raytracer.core.vec import Vec3
from raytracer.plugins.lights.base.interface import escaped_radiance, pdf_light, sample_light_of
from raytracer.plugins.materials.base.interface import LIGHT, Draws
from raytracer.schema.registry import LIGHTS


class Aimed(NamedTuple):
    """Light samples: direction, weight and target (n, 3), pdf and gap (n,)."""

    direction: NDArray[np.float64]
    weight: NDArray[np.float64]
    pdf: NDArray[np.float64]
    target: NDArray[np.float64]
    gap: NDArray[np.float64]


@kernel
def _sample(lights, scene, point, time, sampler, index):
    draws = Draws(sampler, pixel_key(sampler, 0, 0), index, 8)
    u = sample_1d(draws.sampler, draws.key, draws.index, draws.dimension + LIGHT)
    return sample_light_of(lights, 0, scene, point, time, u, draws)


@entry
def _aim(lights, scene, sampler, point, out):
    for index in range(len(out.pdf)):
        light = _sample(lights, scene, point, None, sampler, index)
        out.pdf[index] = light.pdf
        out.gap[index] = light.gap
        for axis in range(3):
            out.direction[index, axis] = light.direction[axis]
            out.weight[index, axis] = light.weight[axis]
            out.target[index, axis] = light.target[axis]


@entry
def _aim_at_times(lights, sampler, point, times, weight):
    for index in range(len(times)):
        light = _sample(lights, None, point, times[index], sampler, index)
        for axis in range(3):
            weight[index, axis] = light.weight[axis]


def arriving_at_times(lights: Any, point: Vec3, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """The weights (n, 3) of light samples at times (n,)."""
    weight = np.empty((len(times), 3))
    _aim_at_times(lights, SAMPLERS["independent"](3, 1), point, np.ascontiguousarray(times, np.float64), weight)
    return weight


@entry
def _pdf(scene, table, primitive, origin, points, normals, pdf):
    for index in range(len(pdf)):
        point = (points[index, 0], points[index, 1], points[index, 2])
        normal = (normals[index, 0], normals[index, 1], normals[index, 2])
        hit = Hit(point, normal, normal, 0.0, 0.0, 0.0, 0, normal, normal, point)
        site = Site(point, 0.0, 0.0, 1.0)
        surface = Interaction(
            MISS, table[index], primitive[index], hit, site, 0, True, normal, origin, normal, 1.0, None
        )
        pdf[index] = pdf_light(scene.lights, scene, surface)


@entry
def _escape(lights, scene, directions, pdf, radiance):
    for index in range(len(directions)):
        result = escaped_radiance(
            lights, scene, (directions[index, 0], directions[index, 1], directions[index, 2]), pdf
        )
        for axis in range(3):
            radiance[index, axis] = result[axis]


def aim(lights: Any, scene: Any, point: Vec3, count: int, *, seed: int = 3) -> Aimed:
    """Samples of the first table of lights, from a point."""
    out = Aimed(np.empty((count, 3)), np.empty((count, 3)), np.empty(count), np.empty((count, 3)), np.empty(count))
    _aim(lights, scene, SAMPLERS["independent"](seed, 1), point, out)
    return out


def pdf_of(scene: Any, table: Any, primitive: Any, origin: Vec3, points: Any, normals: Any) -> NDArray[np.float64]:
    """`pdf_light` of points on primitives that move in no way."""
    pdf = np.empty(len(points))
    _pdf(scene, table, primitive, origin, points, normals, pdf)
    return pdf


def escaped(lights: Any, directions: NDArray[np.float64], pdf: float) -> NDArray[np.float64]:
    """`escaped_radiance` along directions (n, 3) drawn with a density, of lights alone: (n, 3)."""
    radiance = np.empty((len(directions), 3))
    _escape(lights, None, np.ascontiguousarray(directions), pdf, radiance)
    return radiance


def table_of(kind: str, *items: dict[str, Any]) -> Any:
    """The packed table of lights of a kind, from their keys; the shutter is open for a second, and nothing moves."""
    cls = LIGHTS.specs()[kind]
    lights = [cls.model_validate({"type": kind, **keys}) for keys in items]
    lights = [light.at_exposure(Timing(0.0, 1.0), (0.0, 0.0, 9.0), False) for light in lights]
    shining = [light for light in lights if light.shines()]
    return cls.pack(shining) if shining else None
