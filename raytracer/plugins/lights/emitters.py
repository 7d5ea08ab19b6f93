"""Emitters: every primitive whose material radiates, chosen by a light tree, or in proportion to its power.

Not a kind of the `lights` list: a scene has it as soon as an object's material is an emitter that some other
material can reflect.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.geometry import Site
from raytracer.core.instancing import choose_instance, pdf_instance_point, sample_instance_point, variant_of
from raytracer.core.sampling import sample_2d
from raytracer.core.sampling.alias import AliasTable
from raytracer.core.vec import dot, norm, normalize, scale, sub
from raytracer.core.world_origin import to_authored_space
from raytracer.plugins.lights.base.interface import LightSample, pdf_hit, sample_light
from raytracer.plugins.lights.base.light_choice import choose_light, light_probability
from raytracer.plugins.lights.base.light_tree import LightTree
from raytracer.plugins.materials.base.dispatch import selected_emission
from raytracer.plugins.materials.base.interface import BLACK, LIGHT_POINT

ABSENT = np.iinfo(np.int32).min


class Emitters(NamedTuple):
    """Packed emitting primitives, one row each: table and primitive number, material reference (n,) int32.

    variant (n,) int32 : the instances that a row stands for, 0 for none (see `core.instancing`).
    choice : draws a row; by power where instances or moving primitives emit.
    first (variants, tables) int32, row (p,) int32 : the row of primitive k of table t and variant v is
        row[first[v, t] + k], where first is ABSENT for what does not emit, and the row of a primitive that does not.
    """

    table: NDArray[np.int32]
    primitive: NDArray[np.int32]
    material: NDArray[np.int32]
    variant: NDArray[np.int32]
    choice: AliasTable | LightTree
    first: NDArray[np.int32]
    row: NDArray[np.int32]


@sample_light.register(Emitters)
def sample_light_emitters(table, scene, point, time, u, draws):
    chosen, probability, u = choose_light(table.choice, point, u)
    instance, chance = choose_instance(scene.instances, table.variant[chosen], u)
    u1, u2 = sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + LIGHT_POINT)
    number, primitive = table.table[chosen], table.primitive[chosen]
    on = sample_instance_point(scene.instances, scene, instance, number, primitive, point, u1, u2, time)
    way = sub(on.point, point)
    direction = normalize(way)
    pdf = probability * chance * on.pdf
    if pdf == 0.0:
        return LightSample(direction, BLACK, 0.0, on.point, on.gap)
    local = to_authored_space(scene.origin, scene.instances, instance, on.local)
    site = Site(local, on.u, on.v, norm(way), None)
    front = dot(direction, on.normal) < 0.0
    radiance = selected_emission(scene.selectors, scene, table.material[chosen], front, site, draws)
    return LightSample(direction, scale(1.0 / pdf, radiance), pdf, on.point, on.gap)


@pdf_hit.register(Emitters)
def pdf_hit_emitters(table, scene, surface):
    variant, chance = variant_of(scene.instances, surface.instance)
    if variant < 0:
        return 0.0
    first = table.first[variant, surface.table]
    if first == ABSENT:
        return 0.0
    row = table.row[first + surface.primitive]
    if row == ABSENT:
        return 0.0
    return (
        chance
        * light_probability(table.choice, surface.previous, row)
        * pdf_instance_point(
            scene.instances,
            scene,
            surface.instance,
            surface.table,
            surface.primitive,
            surface.previous,
            surface.hit.point,
            surface.hit.normal,
            surface.time,
        )
    )
