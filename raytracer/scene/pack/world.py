"""Pack the part of a scene that is independent of how it is seen: objects, materials, textures and media."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raytracer.core.world_origin import Origin
from raytracer.kernel.normal_mapping import pack_normal_mapping
from raytracer.plugins.cameras.base.moving import camera_at_time
from raytracer.plugins.materials.base.dispatch import Selectors
from raytracer.plugins.materials.base.interface import MaterialSpec
from raytracer.plugins.textures.base.interface import ParameterPacker
from raytracer.scene.object_bounds import ObjectBounds
from raytracer.scene.pack.layout import Layout, lay_out
from raytracer.scene.pack.materials import (
    collect_components,
    dispersion_modes,
    mesh_materials,
    object_material,
    pack_materials,
    pack_textures,
)
from raytracer.scene.pack.media import MediumInterface, SceneMedia
from raytracer.scene.pack.nested_dielectrics import PrioritySolids
from raytracer.scene.pack.objects import Objects, pack_objects
from raytracer.scene.pack.origin_shift import shift_origin
from raytracer.scene.scene_assets import SceneAssets
from raytracer.scene.spec import SceneSpec
from raytracer.schema.yaml_nodes import path_text

MaterialVariant: TypeAlias = Callable[[MaterialSpec, ParameterPacker], MaterialSpec]
"""Function that replaces a resolved material, whose textures the packer knows."""


class PackedWorld(NamedTuple):
    """The packed part of a scene that depends on the camera's position and opening times only.

    layout : the sorted objects.
    origin : of the packed scene; None for the scene's own.
    objects, environment : packed.
    assets : the files that were read.
    bounds : of objects by time.
    used, references : the materials in use, and the reference of each.
    boundaries : references of the boundaries between `solids`.
    packer : of material parameters; it holds the textures.
    tables, selectors : of materials.
    normal_mapping : packed; None without it.
    names, resolved_materials : of materials, by reference.
    dispersion_mode : of materials, by reference; None if none disperses.
    solids : materials with a priority.
    interfaces : the media on both sides of each of `used`.
    media : of the scene.
    empty : see `PackedScene`.
    """

    layout: Layout
    origin: Origin | None
    objects: Objects
    environment: Any
    assets: SceneAssets
    bounds: ObjectBounds
    used: Sequence[MaterialSpec]
    references: Sequence[int]
    boundaries: Sequence[int]
    packer: ParameterPacker
    tables: tuple[Any, ...]
    selectors: Selectors | None
    normal_mapping: Any
    names: Mapping[int, str]
    resolved_materials: Mapping[int, MaterialSpec]
    dispersion_mode: NDArray[np.uint8] | None
    solids: PrioritySolids
    interfaces: Sequence[MediumInterface]
    media: SceneMedia
    empty: Mapping[int, tuple[int, int]]


def world_key(spec: SceneSpec) -> tuple[Any, ...]:
    """Collect all of a scene that `pack_world` depends on, but for the contents of its files."""
    opening = spec.camera.shutter_interval()
    place = camera_at_time(spec.camera, opening.open).look_from
    keys = ("environment", "textures", "materials", "media", "medium", "groups", "objects")
    return (spec.base, opening, place, spec.camera.medium, *(getattr(spec, key) for key in keys))


def pack_world(spec: SceneSpec, assets: SceneAssets, material_variant: MaterialVariant | None) -> PackedWorld:
    """Pack the part of a scene that `world_key` determines."""
    layout, origin = shift_origin(spec, lay_out(spec, assets), assets)
    used, owners, faces = _materials(spec, layout, assets)
    file_paths = {material: (*layout.items[owner].keys, "file") for material, owner in zip(used, owners, strict=True)}
    packer = pack_textures(spec, list(collect_components(used)), file_paths, assets)
    if material_variant is not None:
        used = [material_variant(material, packer) for material in used]
        packer = pack_textures(spec, list(collect_components(used)), file_paths, assets)
    media = SceneMedia(spec, assets)
    interfaces = [media.of(layout.items[owner].spec, material) for owner, material in zip(owners, used, strict=True)]
    solids = PrioritySolids(spec, used, interfaces, owners, layout.items)
    more, around = solids.materials()
    tables, selectors, references, parts = pack_materials([*used, *more], [*interfaces, *around], packer)
    references, boundaries = references[: len(used)], references[len(used) :]
    face_references = [
        reference if which is None else np.array(references)[which]
        for reference, which in zip(references, faces, strict=False)
    ]
    eye = np.array(camera_at_time(spec.camera, spec.camera.shutter_interval().open).look_from)
    if origin is not None:
        eye -= origin.world
    objects = pack_objects(spec, layout, face_references, assets, textured=packer.tables is not None, eye=eye)
    names: dict[int, str] = {}
    for owner, reference in zip(owners, references, strict=True):
        item = layout.items[owner]
        given = item.spec.material
        names.setdefault(reference, given if isinstance(given, str) else path_text((*item.keys, "material")))
    return PackedWorld(
        layout=layout,
        origin=origin,
        objects=objects,
        environment=_pack_environment(spec, assets),
        assets=assets,
        bounds=ObjectBounds(spec, assets),
        used=used,
        references=references,
        boundaries=boundaries,
        packer=packer,
        tables=tables,
        selectors=selectors,
        normal_mapping=pack_normal_mapping(parts, packer, objects.primitives),
        names=names,
        resolved_materials=dict(zip(references, used, strict=True)),
        dispersion_mode=dispersion_modes(parts),
        solids=solids,
        interfaces=interfaces,
        media=media,
        empty=_empty(layout, assets),
    )


def _empty(layout: Layout, assets: SceneAssets) -> dict[int, tuple[int, int]]:
    """Count the triangles without an area in the files of items, and find the first of each."""
    counts: dict[int, tuple[int, int]] = {}
    for number, item in enumerate(layout.items):
        for held in assets.of(item.spec, item.keys).values():
            if getattr(held, "degenerate", 0):
                counts.setdefault(number, (held.degenerate, held.first_degenerate))
    return counts


def _materials(
    spec: SceneSpec, layout: Layout, assets: SceneAssets
) -> tuple[list[MaterialSpec], list[int], list[NDArray[np.int64] | None]]:
    """Collect the materials in use, the item of each, and the materials of each item's faces.

    The first materials are those of the items; None stands for faces that all have that one.
    """
    used: list[MaterialSpec] = []
    more: list[tuple[int, MaterialSpec]] = []
    faces: list[NDArray[np.int64] | None] = []
    for number, item in enumerate(layout.items):
        mesh = mesh_materials(spec, item.spec, item.keys, assets.of(item.spec, item.keys))
        if mesh is None:
            used.append(object_material(spec, item.spec))
            faces.append(None)
            continue
        (first, *others), of_faces = mesh
        places = np.array([number, *range(len(layout.items) + len(more), len(layout.items) + len(more) + len(others))])
        used.append(first)
        more += [(number, material) for material in others]
        faces.append(places[of_faces])
    owners = [*range(len(used)), *(number for number, _ in more)]
    return [*used, *(material for _, material in more)], owners, faces


def _pack_environment(spec: SceneSpec, files: SceneAssets) -> Any:
    """Pack the environment; None if there is none, or a black one."""
    item = spec.environment
    if item is None:
        return None
    contents = files.of(item, ("environment",))
    with spec.errors_at("environment", *item.loads):
        return item.pack(contents)
