"""From a checked scene to the packed one: a NamedTuple whose type lists the scene's effects.

Only what the picture can depend on is packed: materials that no object has, and lights that nothing could reflect,
are left out, so the compiled kernel holds no code for them.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.assets import LOADERS
from raytracer.errors import InputError
from raytracer.geometry import Exact, Geometry
from raytracer.integrator import Scene
from raytracer.kinds import MATERIALS
from raytracer.lights.emitters import Emitters
from raytracer.lights.interface import Lights
from raytracer.materials.interface import MaterialSpec
from raytracer.primitives.interface import areas, concatenate, geometry
from raytracer.sampling import SAMPLERS
from raytracer.sampling.alias import build_alias
from raytracer.scene.spec import SceneSpec
from raytracer.shapes.interface import ShapeSpec
from raytracer.spec import matrix_of
from raytracer.textures.interface import Book

_DEFAULT_MATERIAL = "lambertian"


class Packed(NamedTuple):
    """A scene ready to be built: the packed scene (its accel still 0), and what Embree builds from.

    robust, whether rays must not slip through the edges between triangles.
    """

    scene: Scene
    geometries: tuple[Geometry, ...]
    robust: bool


def pack(spec: SceneSpec, spp: int | None = None) -> Packed:
    """Pack a checked scene.

    Parameters
    ----------
    spp : samples per pixel that a stratified sampler is to expect; the scene's own if None.

    Raises
    ------
    SceneError : an object's file cannot be read, or its transform does not suit it.
    """
    if not spec.objects:
        raise spec.error("the scene has no objects, so there is nothing to render", "objects")
    used = [material_of(spec, item) for item in spec.objects]
    book = Book()
    tables, references = _pack_materials(used, book)
    primitives = _pack_objects(spec, references)
    settings = spec.render
    scene = Scene(
        accel=0,
        accuracy=Exact() if settings.accuracy == "exact" else None,
        primitives=primitives,
        instances=None,
        materials=tables,
        selectors=None,
        passage=None,
        relief=None,
        textures=None,
        lights=_pack_lights(primitives, used, references, book) if settings.max_depth > 1 else None,
        environment=spec.environment.pack() if spec.environment else None,
        media=None,
        camera=spec.camera.pack(spec.film.width, spec.film.height),
        shutter=None,
        filter=spec.film.filter.pack(),
        sampler=SAMPLERS[settings.sampler](settings.seed, spp or settings.spp),
        depth=settings.max_depth,
        roulette=settings.rr_depth,
    )
    return Packed(scene, tuple(geometry(table) for table in primitives), settings.accuracy != "fast")


def material_of(spec: SceneSpec, item: ShapeSpec) -> MaterialSpec:
    """An object's material: named, inline, or the default."""
    if isinstance(item.material, str):
        return spec.materials[item.material]
    found = item.material or MATERIALS.specs()[_DEFAULT_MATERIAL]()
    assert isinstance(found, MaterialSpec)
    return found


def _pack_materials(used: Sequence[MaterialSpec], book: Book) -> tuple[tuple[Any, ...], list[int]]:
    """One table a kind present, sorted by kind, and each object's reference: row * kinds + kind."""
    kinds: dict[str, dict[MaterialSpec, int]] = {}
    for material in used:
        rows = kinds.setdefault(material.type, {})
        rows.setdefault(material, len(rows))
    order = sorted(kinds)
    tables = tuple(next(iter(kinds[kind])).pack(list(kinds[kind]), book) for kind in order)
    return tables, [kinds[item.type][item] * len(order) + order.index(item.type) for item in used]


def _pack_objects(spec: SceneSpec, references: Sequence[int]) -> tuple[Any, ...]:
    """One table a kind of primitive present, sorted by kind."""
    tables: dict[type, list[Any]] = {}
    for number, (item, reference) in enumerate(zip(spec.objects, references, strict=True)):
        try:
            assets = {key: LOADERS[kind](spec.base / getattr(item, key)) for key, kind in item.loads.items()}
        except InputError as error:
            (key,) = item.loads
            raise spec.error(str(error), "objects", number, key) from None
        try:
            table = item.pack(matrix_of(item.transform), reference, assets)
        except ValueError as error:
            raise spec.error(str(error), "objects", number) from None
        tables.setdefault(type(table), []).append(table)
    order = sorted(tables, key=lambda kind: kind.__name__)
    return tuple(concatenate(tables[kind][0], tables[kind]) for kind in order)


def _pack_lights(
    primitives: Sequence[Any], used: Sequence[MaterialSpec], references: Sequence[int], book: Book
) -> Lights | None:
    """What can be aimed at; None where there is nothing, or no material reflects by choice.

    A material that can be lit by choice has a pdf; mirrors and glass find lights only by being followed.
    """
    if not any(material.is_lit() for material in used):
        return None
    tables = tuple(table for table in (_pack_emitters(primitives, used, references, book),) if table is not None)
    return Lights(tables) if tables else None


def _pack_emitters(
    primitives: Sequence[Any], used: Sequence[MaterialSpec], references: Sequence[int], book: Book
) -> Emitters | None:
    """The emitting primitives, chosen by power; None where there are none."""
    exitance = dict(zip(references, (material.exitance(book) for material in used), strict=True))
    rows: list[tuple[NDArray[np.int64], NDArray[np.float64]]] = []
    per_reference = np.array([exitance.get(reference, 0.0) for reference in range(max(exitance) + 1)])
    for table in primitives:
        emitting = np.flatnonzero(per_reference[table.material])
        # Areas of a million triangles that do not emit would be the largest thing in memory.
        power = areas(table)[emitting] * per_reference[table.material[emitting]] if len(emitting) else np.empty(0)
        rows.append((emitting, power))
    if not any(len(emitting) for emitting, _ in rows):
        return None

    # Probabilities by primitive, for the tables that emit at all.
    choice = build_alias(np.concatenate([power for _, power in rows]))
    first = np.full(len(rows), -1, np.int32)
    pmf: list[NDArray[np.float64]] = []
    taken = 0
    for number, (table, (emitting, _)) in enumerate(zip(primitives, rows, strict=True)):
        if len(emitting):
            first[number] = sum(map(len, pmf))
            by_primitive = np.zeros(len(table.material))
            by_primitive[emitting] = choice.pmf[taken : taken + len(emitting)]
            pmf.append(by_primitive)
            taken += len(emitting)
    return Emitters(
        table=np.concatenate([np.full(len(emitting), number, np.int32) for number, (emitting, _) in enumerate(rows)]),
        primitive=np.concatenate([emitting for emitting, _ in rows]).astype(np.int32),
        material=np.concatenate(
            [table.material[emitting] for table, (emitting, _) in zip(primitives, rows, strict=True)]
        ).astype(np.int32),
        choice=choice,
        first=first,
        pmf=np.concatenate(pmf),
    )
