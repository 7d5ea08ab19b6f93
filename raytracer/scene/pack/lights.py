"""Pack the lights that next-event estimation samples: lights, emitting objects and the environment."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.instancing import EmissiveInstances, Instances
from raytracer.core.primitives.base.interface import Boxes, areas, boxes, slice_rows
from raytracer.core.shutter.table import Pulses
from raytracer.plugins.cameras.base.moving import camera_at_time
from raytracer.plugins.lights.background import Background
from raytracer.plugins.lights.base.interface import Lights, LightSamplingOnly, LightSpec, NoLightSampling
from raytracer.plugins.lights.base.light_tree import build_choice
from raytracer.plugins.lights.emitters import ABSENT, Emitters
from raytracer.plugins.lights.sun import Sun
from raytracer.plugins.materials.base.interface import MaterialSpec
from raytracer.plugins.textures.base.interface import ParameterPacker
from raytracer.scene.pack.objects import Objects
from raytracer.scene.spec import SceneSpec


def pack_lights(
    spec: SceneSpec,
    environment: Any,
    objects: Objects,
    used: Sequence[MaterialSpec],
    references: Sequence[int],
    packer: ParameterPacker,
    is_lit: bool,
    is_moving: bool,
) -> tuple[Lights | NoLightSampling | None, Instances | None]:
    """Pack the lights of a scene, one table a kind, and the probabilities of its emitting instances.

    The lights are None if none of them could make a difference.

    environment : the packed environment.
    used, references : each object's material, and the reference that its primitives have.
    is_lit : a material in use allows next-event estimation; mirrors and glass find lights only by their paths, so
        without one only lights remain that a ray may hit: the discs of suns.
    is_moving : something moves while the shutter is open.

    Raises
    ------
    SceneError : a light shines in a pulse, and the shutter is open for no time; or a light needs next-event estimation,
        which is off.
    """
    tables: list[Any] = []
    instances = objects.instances
    how = spec.render.light_sampling
    is_aimed = is_lit and how != "paths"
    if is_aimed:
        # The emitted power per area, by reference (n,).
        exitance = np.zeros(max(references) + 1)
        exitance[list(references)] = [material.emitted_power(packer) for material in used]
        variants, instances = instance_emission(objects, exitance)
        tables.append(pack_emitters(objects, variants, exitance))
    kinds: dict[str, list[LightSpec]] = {}
    for light in _lights_in_exposure(
        spec, [light for light in lights_of(spec) if is_lit or light.is_visible_to_paths()], is_moving
    ):
        if not light.shines():
            continue
        if not is_aimed and not light.is_visible_to_paths():
            sentence = (
                f"paths never find a {light.type} light without extent, since no ray can meet it: use mis or lights"
            )
            raise spec.error(sentence, "render", "light_sampling")
        kinds.setdefault(light.type, []).append(light)
    tables += [type(kinds[kind][0]).pack(kinds[kind]) for kind in sorted(kinds)]
    has_sampling = spec.environment is not None and spec.environment.has_importance_sampling
    is_environment_aimed = is_aimed and environment is not None and has_sampling
    unaimed = None if is_environment_aimed else environment
    tables += [Background()] if is_environment_aimed else []
    present = tuple(table for table in tables if table is not None)
    if not present:
        return None, instances
    if not is_aimed:
        return NoLightSampling(present, unaimed), instances
    return Lights(present, unaimed, LightSamplingOnly() if how == "lights" else None), instances


def lights_of(spec: SceneSpec) -> tuple[LightSpec, ...]:
    """List the lights of a scene, with its sky's sun."""
    disc = spec.environment.sun_disc() if spec.environment is not None else None
    sun = () if disc is None else (Sun(direction=disc.direction, irradiance=disc.irradiance, angle=disc.angle),)
    return (*spec.lights, *sun)


def _lights_in_exposure(spec: SceneSpec, lights: Sequence[LightSpec], is_moving: bool) -> list[LightSpec]:
    """Convert the lights to shutter time, without those whose pulse the shutter misses."""
    timing = spec.camera.timing()
    span = timing.span()
    seen: list[tuple[LightSpec, float]] = []
    for light in lights:
        pulse = light.pulse(timing)
        if pulse is None:
            seen.append((light, span.open))
        elif timing.seconds() == 0.0:
            number = [item is light for item in spec.lights].index(True)
            sentence = "needs a shutter that is open for some time: give camera.shutter, such as 1/60 s"
            raise spec.error(f"a {light.type} {sentence}", "lights", number)
        elif pulse[1] > span.open and pulse[0] < span.close:
            seen.append((light, pulse[0]))
    timed = is_moving or (timing.readout > 0.0 and any(light.pulse(timing) is not None for light, _ in seen))
    return [light.at_exposure(timing, camera_at_time(spec.camera, time).look_from, timed) for light, time in seen]


def light_pulses(lights: Lights | NoLightSampling | None) -> list[Pulses]:
    """List the pulses of the lights whose contribution depends on the path's time."""
    pulses = [getattr(table, "pulse", None) for table in (lights.tables if lights is not None else ())]
    return [pulse for pulse in pulses if pulse is not None]


class EmitterVariant(NamedTuple):
    """An emitter that is the same wherever instances place it.

    group : -1 for what is in none.
    material : reference that replaces its primitives' own, or -1.
    size : areas of all its instances relative to its own.
    """

    group: int
    material: int
    size: float


def instance_emission(
    objects: Objects, exitance: NDArray[np.float64]
) -> tuple[Sequence[EmitterVariant], Instances | None]:
    """Find the instances that emit; within a variant, one is chosen in proportion to its size.

    Returns the variants, the first of which is what is in no instance, and the instances with their probabilities.
    """
    variants = [EmitterVariant(-1, -1, 1.0)]
    instances = objects.instances
    if instances is None:
        return variants, None
    still = np.abs(np.linalg.det(instances.pose[:, :, :3]))
    moving = instances.trajectories
    # An estimate is enough here: it is exact for the same scale along all axes.
    volumes = [still] if moving is None else [still, np.abs(moving.rows[moving.first[:-1], :3].prod(axis=1))]
    size = np.concatenate(volumes) ** (2.0 / 3.0)
    material = np.full(len(size), -1, np.int32) if instances.material is None else instances.material
    pairs, number = np.unique(np.stack([instances.group, material], axis=1), axis=0, return_inverse=True)
    number = number.ravel()
    variant, probability = np.full(len(size), -1, np.int32), np.zeros(len(size))
    members: list[NDArray[np.int64]] = [np.empty(0, np.int64)]
    for place, (group, override) in enumerate(pairs.tolist()):
        if not any(_emitting(objects, group, table, override, exitance).any() for table in range(len(objects.owners))):
            continue
        chosen = np.flatnonzero(number == place)
        total = float(size[chosen].sum())
        variant[chosen], probability[chosen] = len(variants), size[chosen] / total
        variants.append(EmitterVariant(group, override, total))
        members.append(chosen)
    if len(variants) == 1:
        return variants, instances
    emissive = EmissiveInstances(
        variant=variant,
        probability=probability,
        first=np.cumsum([0, *map(len, members)]).astype(np.int32),
        member=np.concatenate(members).astype(np.int32),
        cumulative=np.concatenate([np.cumsum(probability[chosen]) for chosen in members]),
    )
    return variants, instances._replace(emissive=emissive)


def _emitting(
    objects: Objects, group: int, table: int, material: int, exitance: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Look up the exitance of each primitive of a table in a group, or in none."""
    start, stop = objects.bounds[group + 1, table]
    if material >= 0:
        return np.full(stop - start, exitance[material])
    return np.asarray(exitance[objects.primitives[table].material[start:stop]])


def pack_emitters(
    objects: Objects, variants: Sequence[EmitterVariant], exitance: NDArray[np.float64]
) -> Emitters | None:
    """Pack the emitting primitives; None if there are none."""
    tables = len(objects.primitives)
    first = np.full((len(variants), tables), ABSENT, np.int32)
    rows: list[tuple[int, int, NDArray[np.int64], NDArray[np.int32]]] = []
    powers: list[NDArray[np.float64]] = []
    taken = 0
    for number, variant in enumerate(variants):
        for table in range(tables):
            start, stop = (int(bound) for bound in objects.bounds[variant.group + 1, table])
            radiated = _emitting(objects, variant.group, table, variant.material, exitance)
            emitting = np.flatnonzero(radiated)
            # Areas of a million triangles that do not emit would be the largest arrays in memory.
            if not len(emitting):
                continue
            shown = slice_rows(objects.primitives[table], start, stop)
            powers.append(variant.size * areas(shown)[emitting] * radiated[emitting])
            own = np.full(len(emitting), variant.material) if variant.material >= 0 else shown.material[emitting]
            rows.append((number, table, start + emitting, own.astype(np.int32)))
            first[number, table] = taken - start
            taken += stop - start
    if not rows:
        return None
    # Rows by primitive, for the ranges that emit at all.
    row = np.full(taken, ABSENT, np.int32)
    offset = np.concatenate([int(first[number, table]) + primitives for number, table, primitives, _ in rows])
    row[offset] = np.arange(len(offset))
    counts = [len(primitives) for _, _, primitives, _ in rows]
    return Emitters(
        table=np.repeat(np.array([table for _, table, _, _ in rows], np.int32), counts),
        primitive=np.concatenate([primitives for _, _, primitives, _ in rows]).astype(np.int32),
        material=np.concatenate([material for *_, material in rows]),
        variant=np.repeat(np.array([number for number, *_ in rows], np.int32), counts),
        choice=build_choice(np.concatenate(powers), _boxes(objects, rows)),
        first=first,
        row=row,
    )


def _boxes(objects: Objects, rows: Sequence[tuple[int, int, NDArray[np.int64], NDArray[np.int32]]]) -> Boxes | None:
    """Bound the emitting primitives, in the order of the rows; None where instances or moving ones are among them."""
    if any(variant > 0 for variant, *_ in rows):
        return None
    parts = [boxes(objects.primitives[table], primitives) for _, table, primitives, _ in rows]
    if any(part is None for part in parts):
        return None
    lower, upper = (np.concatenate([part[end] for part in parts if part is not None]) for end in range(2))
    return lower, upper
