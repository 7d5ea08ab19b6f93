"""Emitters: every primitive whose material radiates, chosen in proportion to its power.

Not a kind of the `lights` list: a scene has it as soon as an object's material is an emitter that some other
material can reflect.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.geometry import Site
from raytracer.instances import choose_instance, pdf_placed, sample_placed, variant_of
from raytracer.lights.interface import LightSample, pdf_hit, sample_light
from raytracer.materials.interface import BLACK, LIGHT_POINT, emission_shown
from raytracer.origin import as_written
from raytracer.sampling import sample_2d
from raytracer.sampling.alias import AliasTable, sample_alias
from raytracer.vec import dot, norm, normalize, scale, sub

ABSENT = np.iinfo(np.int32).min


class Emitters(NamedTuple):
    """One row an emitting primitive: table and primitive number, material reference (n,) int32; and how to choose.

    variant (n,) int32, which instances a row stands for, 0 for none (see instances.Glow); choice draws a row; `first`
    (variants, tables) int32 and `pmf` (p,) float64 give the probability of primitive k of table t and variant v as
    pmf[first[v, t] + k], where first is ABSENT for what does not emit.
    """

    table: NDArray[np.int32]
    primitive: NDArray[np.int32]
    material: NDArray[np.int32]
    variant: NDArray[np.int32]
    choice: AliasTable
    first: NDArray[np.int32]
    pmf: NDArray[np.float64]


@sample_light.register(Emitters)
def _(table, scene, point, time, u, draws):
    # One emitter needs no choice.
    chosen, probability = 0, 1.0
    if len(table.table) > 1:
        chosen, probability, u = sample_alias(table.choice, u)
    instance, chance = choose_instance(scene.instances, table.variant[chosen], u)
    u1, u2 = sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + LIGHT_POINT)
    number, primitive = table.table[chosen], table.primitive[chosen]
    on = sample_placed(scene.instances, scene, instance, number, primitive, point, u1, u2, time)
    way = sub(on.point, point)
    direction = normalize(way)
    pdf = probability * chance * on.pdf
    if pdf == 0.0:
        return LightSample(direction, BLACK, 0.0, on.point, on.gap)
    local = as_written(scene.origin, scene.instances, instance, on.local)
    site = Site(local, on.u, on.v, norm(way), None)
    front = dot(direction, on.normal) < 0.0
    radiance = emission_shown(scene.selectors, scene, table.material[chosen], front, site, draws)
    return LightSample(direction, scale(1.0 / pdf, radiance), pdf, on.point, on.gap)


@pdf_hit.register(Emitters)
def _(table, scene, instance, number, primitive, origin, point, normal, time):
    variant, chance = variant_of(scene.instances, instance)
    if variant < 0:
        return 0.0
    first = table.first[variant, number]
    if first == ABSENT:
        return 0.0
    probability = chance * table.pmf[first + primitive]
    return probability * pdf_placed(scene.instances, scene, instance, number, primitive, origin, point, normal, time)
