"""From a checked scene to the packed one: a NamedTuple whose type lists the scene's effects.

Only what the picture can depend on is packed: materials that no object has, and lights that nothing could reflect,
are left out, so the compiled kernel holds no code for them.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from raytracer.accumulation import Clamp
from raytracer.cameras.interface import moved as moved_camera
from raytracer.cameras.moving import MovingCamera, camera_at, pack_camera
from raytracer.document import path_text
from raytracer.embree import Accel, Placements
from raytracer.errors import InputError
from raytracer.geometry import Exact, Geometry
from raytracer.integrator import Scene
from raytracer.kinds import MATERIALS
from raytracer.lights.interface import moved as moved_lights
from raytracer.materials.interface import MaterialSpec, Selectors
from raytracer.media.interface import moved as moved_media
from raytracer.origin import Origin
from raytracer.paths import Passage
from raytracer.relief import pack_relief
from raytracer.sampling import SAMPLERS
from raytracer.scene.focus import focused, focuses
from raytracer.scene.interior import Solids
from raytracer.scene.lights import pack_lights, pulses_of
from raytracer.scene.load import bound
from raytracer.scene.materials import DEFAULT_MATERIAL, INVISIBLE, brought, pack_materials, parts, resolved
from raytracer.scene.media import Space, Spaces
from raytracer.scene.objects import Assets, Item, Layout, Objects, Owners, lay_out, pack_objects
from raytracer.scene.recentring import recentred
from raytracer.scene.spec import SceneSpec
from raytracer.scene.spectrum import pack_spectrum, parting_of
from raytracer.scene.supplies import Anew, Supplies
from raytracer.scene.textures import pack_textures
from raytracer.scene.whereabouts import Whereabouts
from raytracer.shapes.interface import ShapeSpec
from raytracer.shutter import Pulses, Shutter, pack_shutter
from raytracer.spec import sentence
from raytracer.textures.interface import Book
from raytracer.vec import Vec3, neg

Recast: TypeAlias = Callable[[MaterialSpec, Book], MaterialSpec]
"""Another material in place of a resolved one, whose textures the book knows."""


class Packed(NamedTuple):
    """A scene ready to be built: the packed scene (its accel still 0), and what Embree builds from.

    robust, whether rays must not slip through the edges between triangles; materials, what the scene calls each by the
    reference that primitives have; owners, the objects that the rows of each table belong to; instance_objects (n,)
    int32, the object that each instance belongs to; spec, the scene that was packed, its camera focused at a distance;
    built, the ray caster's structure, where focusing took it; items, what owners.item means, and empty, by its number,
    how many triangles without an area were left out of its file, and the first of these; looks, the resolved material
    of each reference.
    """

    scene: Scene
    geometries: Mapping[int, Geometry]
    groups: Sequence[Mapping[int, Geometry]]
    placements: Sequence[Placements]
    robust: bool
    materials: Mapping[int, str]
    owners: tuple[Owners, ...]
    instance_objects: NDArray[np.int32]
    spec: SceneSpec
    built: Accel | None
    items: Sequence[Item]
    empty: Mapping[int, tuple[int, int]]
    looks: Mapping[int, MaterialSpec]

    @property
    def shift(self) -> Vec3:
        """What is added to the scene's coordinates to get the packed ones (m)."""
        return (0.0, 0.0, 0.0) if self.scene.origin is None else neg(self.scene.origin.world)

    def build(self, supplies: Supplies | None = None) -> Accel:
        """The ray caster's structure, built or from `supplies`; its address belongs into the scene."""
        if self.built is not None:
            return self.built
        return (supplies or Anew()).structure(
            self.geometries,
            self.groups,
            self.placements,
            first_instance=len(self.scene.primitives),
            robust=self.robust,
        )


class _World(NamedTuple):
    """What is packed of a scene for its camera's place and the time that its shutter is open, however it is seen.

    layout, origin, objects and environment, packed; assets, the files that were read; where, the places of objects;
    used, the materials in use, and of each its reference; boundaries, the references of what `solids` are to each
    other; book, tables, selectors, relief, names, looks and parting, of materials; media, and spaces, those around
    `used`; empty, see `Packed`.
    """

    layout: Layout
    origin: Origin | None
    objects: Objects
    environment: Any
    assets: Assets
    where: Whereabouts
    used: Sequence[MaterialSpec]
    references: Sequence[int]
    boundaries: Sequence[int]
    book: Book
    tables: tuple[Any, ...]
    selectors: Selectors | None
    relief: Any
    names: Mapping[int, str]
    looks: Mapping[int, MaterialSpec]
    parting: NDArray[np.uint8] | None
    solids: Solids
    spaces: Sequence[Space]
    media: Spaces
    empty: Mapping[int, tuple[int, int]]

    def is_fresh(self, supplies: Supplies) -> bool:
        """Whether the files still hold what was packed."""
        return self.assets.is_fresh(supplies)


def pack(
    spec: SceneSpec,
    spp: int | None = None,
    assets: Assets | None = None,
    recast: Recast | None = None,
    supplies: Supplies | None = None,
) -> Packed:
    """Pack a checked scene.

    Parameters
    ----------
    spp : samples per pixel that a stratified sampler is to expect; the scene's own if None.
    assets : the files that the scene names; read if None.
    recast : what is packed in place of each material in use, those that files bring included.
    supplies : where files and what was packed or built before come from; nowhere if None.

    Raises
    ------
    SceneError : an object's file cannot be read, or its transform does not suit it; or the camera cannot focus.
    """
    if not spec.objects:
        raise spec.error("the scene has no objects, so there is nothing to render", "objects")
    supplies = supplies or Anew()
    files = assets or Assets(spec, supplies)
    spec = bound(spec, supplies.read)
    if recast is None:
        world = supplies.kept(
            _world_key(spec), lambda: _pack_world(spec, files, None), lambda it: it.is_fresh(supplies)
        )
    else:
        world = _pack_world(spec, files, recast)
    return _seen(spec, world, files, supplies, spp or spec.render.spp)


def _world_key(spec: SceneSpec) -> tuple[Any, ...]:
    """What `_pack_world` makes of a scene depends on this, and on what is in its files."""
    opening = spec.camera.opening()
    return (
        spec.base,
        opening,
        camera_at(spec.camera, opening.open).look_from,
        spec.camera.medium,
        spec.environment,
        spec.textures,
        spec.materials,
        spec.media,
        spec.medium,
        spec.groups,
        spec.objects,
    )


def _pack_world(spec: SceneSpec, assets: Assets, recast: Recast | None) -> _World:
    """Pack what `_world_key` tells, and nothing else, of a scene."""
    layout, origin = recentred(spec, lay_out(spec, assets), assets)
    used, owners, faces = _materials(spec, layout, assets)
    stand = {material: (*layout.items[owner].keys, "file") for material, owner in zip(used, owners, strict=True)}
    book = pack_textures(spec, list(parts(used)), stand, assets)
    if recast is not None:
        used = [recast(material, book) for material in used]
        book = pack_textures(spec, list(parts(used)), stand, assets)
    media = Spaces(spec, assets)
    spaces = [media.of(layout.items[owner].spec, material) for owner, material in zip(owners, used, strict=True)]
    solids = Solids(spec, used, spaces, owners, layout.items)
    more, around = solids.materials()
    tables, selectors, references, real = pack_materials([*used, *more], [*spaces, *around], book)
    references, boundaries = references[: len(used)], references[len(used) :]
    shown = [
        reference if which is None else np.array(references)[which]
        for reference, which in zip(references, faces, strict=False)
    ]
    eye = np.array(camera_at(spec.camera, spec.camera.opening().open).look_from)
    if origin is not None:
        eye -= origin.world
    objects = pack_objects(spec, layout, shown, assets, textured=book.tables is not None, eye=eye)
    environment = _pack_environment(spec, assets)
    names: dict[int, str] = {}
    for owner, reference in zip(owners, references, strict=True):
        item = layout.items[owner]
        given = item.spec.material
        names.setdefault(reference, given if isinstance(given, str) else path_text((*item.keys, "material")))
    return _World(
        layout=layout,
        origin=origin,
        objects=objects,
        environment=environment,
        assets=assets,
        where=Whereabouts(spec, assets),
        used=used,
        references=references,
        boundaries=boundaries,
        book=book,
        tables=tables,
        selectors=selectors,
        relief=pack_relief(real, book, objects.primitives),
        names=names,
        looks=dict(zip(references, used, strict=True)),
        parting=parting_of(real),
        solids=solids,
        spaces=spaces,
        media=media,
        empty=_empty(layout, assets),
    )


def _seen(spec: SceneSpec, world: _World, assets: Assets, supplies: Supplies, spp: int) -> Packed:
    """The packed scene: the world with the camera that sees it, and how it is rendered."""
    origin, objects, used, references = world.origin, world.objects, world.used, world.references
    spec, built = _focused(spec, world, supplies)
    camera = _pack_camera(spec, assets)
    if origin is not None:
        camera = moved_camera(camera, neg(origin.world))
    interior = world.solids.pack(references, world.boundaries, world.where, spec.camera, camera)
    moving = isinstance(camera, MovingCamera) or objects.moves()
    settings = spec.render
    is_lit = settings.max_depth > 1 and (world.media.scatters() or any(material.is_lit() for material in used))
    lights, instances = pack_lights(spec, world.environment, objects, used, references, world.book, is_lit, moving)
    space = world.media.pack(references, world.spaces)
    if origin is not None:
        lights, space = _tables_moved(lights, moved_lights, origin), _tables_moved(space, moved_media, origin)
    shutter = _pack_shutter(spec, moving, pulses_of(lights))
    scene = Scene(
        accel=0,
        accuracy=Exact() if settings.accuracy == "exact" else None,
        primitives=objects.primitives,
        instances=instances,
        materials=world.tables,
        selectors=world.selectors,
        passage=Passage() if interior is not None or any(material.passes() for material in used) else None,
        relief=world.relief,
        textures=world.book.tables,
        lights=lights,
        environment=world.environment,
        media=space,
        camera=camera,
        shutter=shutter,
        filter=spec.film.filter.pack(),
        sampler=SAMPLERS[settings.sampler](settings.seed, spp),
        depth=settings.max_depth,
        roulette=settings.rr_depth,
        origin=origin,
        clamp=None if settings.clamp is None else Clamp(settings.clamp),
        interior=interior,
        spectrum=pack_spectrum(world.parting, camera, spec.film.filter.edge(), shutter),
    )
    return Packed(
        scene,
        objects.geometries,
        objects.groups,
        objects.placements,
        settings.accuracy != "fast",
        world.names,
        objects.owners,
        objects.placed,
        spec,
        built,
        world.layout.items,
        world.empty,
        world.looks,
    )


def _empty(layout: Layout, assets: Assets) -> dict[int, tuple[int, int]]:
    """How many triangles without an area the files of items have, and the first of these."""
    found: dict[int, tuple[int, int]] = {}
    for number, item in enumerate(layout.items):
        for held in assets.of(item.spec, item.keys).values():
            if getattr(held, "degenerate", 0):
                found.setdefault(number, (held.degenerate, held.first_degenerate))
    return found


def _tables_moved(held: Any, moved: Callable[[Any, Vec3], Any], origin: Origin) -> Any:
    """What holds tables of lights or media, in the packed world."""
    if held is None:
        return None
    return held._replace(tables=tuple(moved(table, neg(origin.world)) for table in held.tables))


def _focused(spec: SceneSpec, world: _World, supplies: Supplies) -> tuple[SceneSpec, Accel | None]:
    """The scene with its camera focused at a distance, and the ray caster's structure if that took a ray."""
    if not focuses(spec):
        return spec, None
    objects = world.objects
    clear = {
        reference
        for material, reference in zip(world.used, world.references, strict=True)
        if material.lets_all_through()
    }
    built: list[Accel] = []

    def build() -> Accel:
        first, robust = len(objects.primitives), spec.render.accuracy != "fast"
        shapes = objects.geometries, objects.groups, objects.placements
        built.append(supplies.structure(*shapes, first_instance=first, robust=robust))
        return built[0]

    around = (0.0, 0.0, 0.0) if world.origin is None else world.origin.world
    focused_spec = focused(spec, world.where, objects, clear, build, around)
    return focused_spec, built[0] if built else None


def _materials(
    spec: SceneSpec, layout: Layout, assets: Assets
) -> tuple[list[MaterialSpec], list[int], list[NDArray[np.int64] | None]]:
    """The materials used, the item of each, and for each item which of them its faces have.

    The first ones are those of the items; None stands for faces that all have that one.
    """
    used: list[MaterialSpec] = []
    more: list[tuple[int, MaterialSpec]] = []
    faces: list[NDArray[np.int64] | None] = []
    for number, item in enumerate(layout.items):
        found = brought(spec, item.spec, item.keys, assets.of(item.spec, item.keys))
        if found is None:
            used.append(material_of(spec, item.spec))
            faces.append(None)
            continue
        first, *others = found.materials
        places = np.array([number, *range(len(layout.items) + len(more), len(layout.items) + len(more) + len(others))])
        used.append(first)
        more += [(number, material) for material in others]
        faces.append(places[found.faces])
    owners = [*range(len(used)), *(number for number, _ in more)]
    return [*used, *(material for _, material in more)], owners, faces


def material_of(spec: SceneSpec, item: ShapeSpec) -> MaterialSpec:
    """An object's material, resolved: named, inline, or the default."""
    if isinstance(item.material, str):
        return resolved(spec.materials[item.material], spec.materials)
    default = DEFAULT_MATERIAL if item.medium is None else INVISIBLE
    found = item.material or MATERIALS.specs()[default]()
    assert isinstance(found, MaterialSpec)
    return resolved(found, spec.materials)


def _pack_camera(spec: SceneSpec, assets: Assets) -> Any:
    """The packed camera, moving if it does while its shutter is open."""
    files = assets.of(spec.camera, ("camera",))
    try:
        return pack_camera(spec.camera, spec.film.width, spec.film.height, files)
    except ValidationError as error:
        (found,) = error.errors(include_url=False)
        raise spec.error(sentence(found), "camera", *found["loc"]) from None
    except ValueError as error:
        raise spec.error(str(error), "camera", "motion") from None


def _pack_shutter(spec: SceneSpec, is_moving: bool, pulses: Sequence[Pulses]) -> Shutter | None:
    """The packed shutter; None where all times are alike."""
    if not is_moving and not pulses:
        return None
    return pack_shutter(spec.camera.timing(), spec.film.width, spec.film.height, pulses)


def _pack_environment(spec: SceneSpec, files: Assets) -> Any:
    """The packed environment; None where there is none, or a black one."""
    item = spec.environment
    if item is None:
        return None
    try:
        return item.pack({key: files.read(kind, getattr(item, key)) for key, kind in item.loads.items()})
    except (InputError, ValueError) as error:
        raise spec.error(str(error), "environment", *item.loads) from None
