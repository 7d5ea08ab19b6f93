"""Emitters: every primitive whose material radiates, chosen in proportion to its power.

Not a kind of the `lights` list: a scene has it as soon as an object's material is an emitter that some other
material can reflect.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.lights.interface import LightSample, pdf_light, sample_light
from raytracer.materials.interface import LIGHT, LIGHT_POINT, emission_at
from raytracer.primitives.interface import pdf_point_any, sample_point_any
from raytracer.sampling import sample_1d, sample_2d
from raytracer.sampling.alias import AliasTable, sample_alias
from raytracer.vec import dot, normalize, sub


class Emitters(NamedTuple):
    """One row an emitting primitive: table and primitive number, material reference (n,) int32; and how to choose.

    choice draws a row; `first` (tables,) int32 and `pmf` (p,) float64 give the probability of primitive k of table t
    as pmf[first[t] + k], where first is -1 for a table without emitters.
    """

    table: NDArray[np.int32]
    primitive: NDArray[np.int32]
    material: NDArray[np.int32]
    choice: AliasTable
    first: NDArray[np.int32]
    pmf: NDArray[np.float64]


@sample_light.register(Emitters)
def _(lights, primitives, materials, point, draws):
    # One emitter needs no choice, and draws no number for it.
    chosen, probability = 0, 1.0
    if len(lights.table) > 1:
        u = sample_1d(draws.sampler, draws.key, draws.index, draws.dimension + LIGHT)
        chosen, probability, _ = sample_alias(lights.choice, u)
    u1, u2 = sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + LIGHT_POINT)
    on = sample_point_any(primitives, lights.table[chosen], lights.primitive[chosen], point, u1, u2)
    direction = normalize(sub(on.point, point))
    front = dot(direction, on.normal) < 0.0
    radiance = emission_at(materials, lights.material[chosen], front)
    return LightSample(direction, radiance, probability * on.pdf, on.point, on.gap)


@pdf_light.register(Emitters)
def _(lights, primitives, table, primitive, origin, point, normal):
    first = lights.first[table]
    if first < 0:
        return 0.0
    probability = lights.pmf[first + primitive]
    return probability * pdf_point_any(primitives, table, primitive, origin, point, normal)
