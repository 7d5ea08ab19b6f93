"""What can be aimed at in a scene: its lights, its emitting objects, and its environment."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.cameras.moving import camera_at
from raytracer.instances import Glow, Instances
from raytracer.lights.background import Background
from raytracer.lights.emitters import ABSENT, Emitters
from raytracer.lights.interface import AimedOnly, Lights, LightSpec, Unaimed
from raytracer.lights.sun import Sun
from raytracer.materials.interface import MaterialSpec
from raytracer.primitives.interface import areas, section
from raytracer.sampling.alias import build_alias
from raytracer.scene.objects import Objects
from raytracer.scene.spec import SceneSpec
from raytracer.shutter import Pulses
from raytracer.spec import Vector
from raytracer.textures.interface import Book


def pack_lights(
    spec: SceneSpec,
    environment: Any,
    objects: Objects,
    used: Sequence[MaterialSpec],
    references: Sequence[int],
    book: Book,
    is_lit: bool,
    is_moving: bool,
) -> tuple[Lights | Unaimed | None, Instances | None]:
    """The lights of a scene, one table a kind, and the instances, with how those that emit are chosen.

    There are no lights, None, where there is none that could make a difference.

    Parameters
    ----------
    environment : the packed environment.
    used, references : each object's material, and the reference that its primitives have.
    is_lit : whether anything can be lit by choice; mirrors and glass find lights only by being followed, so without it
        only those remain that a ray may find: the discs of suns.
    is_moving : whether anything moves while the shutter is open.

    Raises
    ------
    SceneError : a light that shines in a pulse, and a shutter that is open for no time; or one that only aiming finds,
        where nothing is aimed at.
    """
    tables: list[Any] = []
    instances = objects.instances
    how = spec.render.light_sampling
    is_aimed = is_lit and how != "paths"
    if is_aimed:
        exitance = exitances(used, references, book)
        variants, instances = glowing(objects, exitance)
        tables.append(pack_emitters(objects, variants, exitance))
    kinds: dict[str, list[LightSpec]] = {}
    for light in _fired(spec, [light for light in lights_of(spec) if is_lit or light.is_seen()], is_moving):
        if not is_aimed:
            _check_found(spec, light)
        kinds.setdefault(light.type, []).append(light)
    tables += [type(kinds[kind][0]).pack(kinds[kind]) for kind in sorted(kinds)]
    unaimed = environment
    if is_aimed and environment is not None and spec.environment is not None and spec.environment.can_be_drawn:
        tables.append(Background())
        unaimed = None
    present = tuple(table for table in tables if table is not None)
    if not present:
        return None, instances
    if not is_aimed:
        return Unaimed(present, unaimed), instances
    return Lights(present, unaimed, AimedOnly() if how == "lights" else None), instances


def _check_found(spec: SceneSpec, light: LightSpec) -> None:
    """Refuse a light that is shining, and that no path can find, since without aiming the picture would lack it."""
    if not light.is_seen() and type(light).pack([light]) is not None:
        raise spec.error(
            f"paths never find a {light.type} light without extent, since no ray can meet it: use mis or lights",
            "render",
            "light_sampling",
        )


def lights_of(spec: SceneSpec) -> tuple[LightSpec, ...]:
    """The lights that a scene names, and its sky's sun."""
    disc = spec.environment.disc() if spec.environment is not None else None
    sun = () if disc is None else (Sun(direction=disc.direction, irradiance=disc.irradiance, angle=disc.angle),)
    return (*spec.lights, *sun)


def _fired(spec: SceneSpec, lights: Sequence[LightSpec], is_moving: bool) -> list[LightSpec]:
    """The lights in the time of the shutter, without those whose pulse it does not see."""
    timing = spec.camera.timing()
    span = timing.span()
    seen: list[tuple[LightSpec, float]] = []
    for light in lights:
        pulse = light.pulse(timing)
        if pulse is None:
            seen.append((light, span.open))
        elif timing.seconds() == 0.0:
            number = [item is light for item in spec.lights].index(True)
            raise spec.error(
                f"a {light.type} needs a shutter that is open for some time: give camera.shutter, such as 1/60 s",
                "lights",
                number,
            )
        elif pulse[1] > span.open and pulse[0] < span.close:
            seen.append((light, pulse[0]))
    timed = is_moving or (timing.readout > 0.0 and any(light.pulse(timing) is not None for light, _ in seen))
    return [light.fired(timing, _place(spec, time), timed) for light, time in seen]


def _place(spec: SceneSpec, time: float) -> Vector:
    """Where the camera is at a time of the scene (s)."""
    return camera_at(spec.camera, time).look_from


def pulses_of(lights: Lights | Unaimed | None) -> list[Pulses]:
    """When the lights shine of which paths need to know that."""
    found = [getattr(table, "pulse", None) for table in (lights.tables if lights is not None else ())]
    return [pulses for pulses in found if pulses is not None]


class Variant(NamedTuple):
    """What emits in the same way wherever it is placed.

    group, -1 for what is in none; material, the reference in place of its primitives' own, or -1; size, by how much the
    areas of all its instances are larger than its own.
    """

    group: int
    material: int
    size: float


class Glowing(NamedTuple):
    """variants, of which the first is what is in no instance; and the instances, with how they are chosen."""

    variants: Sequence[Variant]
    instances: Instances | None


def exitances(used: Sequence[MaterialSpec], references: Sequence[int], book: Book) -> NDArray[np.float64]:
    """What a square metre radiates of the materials that primitives may have, by reference (n,)."""
    result = np.zeros(max(references) + 1)
    result[list(references)] = [material.exitance(book) for material in used]
    return result


def glowing(objects: Objects, exitance: NDArray[np.float64]) -> Glowing:
    """Which instances emit, and how one of them is chosen: within a variant, in proportion to their sizes."""
    variants = [Variant(-1, -1, 1.0)]
    instances = objects.instances
    if instances is None:
        return Glowing(variants, None)
    still = np.abs(np.linalg.det(instances.pose[:, :, :3]))
    moving = instances.trajectories
    # An estimate is enough here: it is exact for the same scale along all axes.
    volumes = [still] if moving is None else [still, np.abs(moving.rows[moving.first[:-1], :3].prod(axis=1))]
    size = np.concatenate(volumes) ** (2.0 / 3.0)
    material = np.full(len(size), -1, np.int32) if instances.material is None else instances.material
    pairs, number = np.unique(np.stack([instances.group, material], axis=1), axis=0, return_inverse=True)
    number = number.ravel()
    variant, chance = np.full(len(size), -1, np.int32), np.zeros(len(size))
    members: list[NDArray[np.int64]] = [np.empty(0, np.int64)]
    for place, (group, override) in enumerate(pairs.tolist()):
        if not any(_emitting(objects, group, table, override, exitance).any() for table in range(len(objects.owners))):
            continue
        chosen = np.flatnonzero(number == place)
        total = float(size[chosen].sum())
        variant[chosen], chance[chosen] = len(variants), size[chosen] / total
        variants.append(Variant(group, override, total))
        members.append(chosen)
    if len(variants) == 1:
        return Glowing(variants, instances)
    glow = Glow(
        variant=variant,
        chance=chance,
        first=np.cumsum([0, *map(len, members)]).astype(np.int32),
        member=np.concatenate(members).astype(np.int32),
        cumulative=np.concatenate([np.cumsum(chance[chosen]) for chosen in members]),
    )
    return Glowing(variants, instances._replace(glow=glow))


def _emitting(
    objects: Objects, group: int, table: int, material: int, exitance: NDArray[np.float64]
) -> NDArray[np.float64]:
    """What a square metre of each primitive radiates that a group, or what is in none, has in a table."""
    start, stop = objects.bounds[group + 1, table]
    if material >= 0:
        return np.full(stop - start, exitance[material])
    return np.asarray(exitance[objects.primitives[table].material[start:stop]])


def pack_emitters(objects: Objects, variants: Sequence[Variant], exitance: NDArray[np.float64]) -> Emitters | None:
    """The emitting primitives, chosen by power; None where there are none."""
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
            # Areas of a million triangles that do not emit would be the largest thing in memory.
            if not len(emitting):
                continue
            shown = section(objects.primitives[table], start, stop)
            powers.append(variant.size * areas(shown)[emitting] * radiated[emitting])
            own = np.full(len(emitting), variant.material) if variant.material >= 0 else shown.material[emitting]
            rows.append((number, table, start + emitting, own.astype(np.int32)))
            first[number, table] = taken - start
            taken += stop - start
    if not rows:
        return None
    choice = build_alias(np.concatenate(powers))

    # Probabilities by primitive, for the ranges that emit at all.
    pmf = np.zeros(taken)
    offset = np.concatenate([int(first[number, table]) + primitives for number, table, primitives, _ in rows])
    pmf[offset] = choice.pmf
    counts = [len(primitives) for _, _, primitives, _ in rows]
    return Emitters(
        table=np.repeat(np.array([table for _, table, _, _ in rows], np.int32), counts),
        primitive=np.concatenate([primitives for _, _, primitives, _ in rows]).astype(np.int32),
        material=np.concatenate([material for *_, material in rows]),
        variant=np.repeat(np.array([number for number, *_ in rows], np.int32), counts),
        choice=choice,
        first=first,
        pmf=pmf,
    )
