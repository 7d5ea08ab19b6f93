"""Pack materials and the textures that they use: resolve names, read and check files, and make one table a kind."""

from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from raytracer.plugins.materials.base.dispatch import Selectors
from raytracer.plugins.materials.base.interface import MaterialSpec, SelectorSpec
from raytracer.plugins.shapes.base.interface import ShapeSpec
from raytracer.plugins.textures.base.interface import (
    Assets,
    ParameterPacker,
    TextureSpec,
    TextureUse,
    ValueRange,
    textures_of,
)
from raytracer.scene.assets.gltf_materials import read_materials
from raytracer.scene.kind_unions import check_material
from raytracer.scene.scene_assets import SceneAssets
from raytracer.scene.spec import SceneSpec
from raytracer.schema.registry import MATERIALS
from raytracer.schema.validation_errors import error_sentence
from raytracer.schema.yaml_nodes import KeyPath, path_text
from raytracer.util.errors import InputError, format_value

DEFAULT_MATERIAL = "lambertian"
"""Material of an object that names none."""

INVISIBLE = "boundary"
"""Material of an object that is only the boundary of a medium."""

_NORMAL_MAPPING_KEYS = ("bump", "bump_height", "normal_map", "normal_scale")


def resolve_material(material: MaterialSpec, named: Mapping[str, MaterialSpec]) -> MaterialSpec:
    """Resolve names in a material to specs; a selector that always selects the same child becomes that child.

    A surface without an effect, as glass of the index around it, becomes an invisible one.  A selector's normal mapping
    applies to its children, except to those that have their own.
    """
    if not isinstance(material, SelectorSpec):
        # What is index-matched keeps out a medium if it has an inside.
        return make_material(INVISIBLE, clear=material.has_interior()) if material.is_index_matched() else material
    children = []
    for child in material.children().values():
        resolved = resolve_material(named[child] if isinstance(child, str) else child, named)
        children.append(_with_normal_mapping_of(material, resolved))
    return material.with_children(children)


def object_material(spec: SceneSpec, item: ShapeSpec) -> MaterialSpec:
    """Resolve an object's material: named, inline, or the default."""
    if isinstance(item.material, str):
        return resolve_material(spec.materials[item.material], spec.materials)
    default = DEFAULT_MATERIAL if item.medium is None else INVISIBLE
    return resolve_material(item.material or make_material(default), spec.materials)


def make_material(kind: str, **values: Any) -> MaterialSpec:
    """Make a material of a kind, with these of its keys."""
    material: MaterialSpec = MATERIALS.spec(kind)(**values)
    return material


def _with_normal_mapping_of(parent: MaterialSpec, child: MaterialSpec) -> MaterialSpec:
    given = {key: getattr(parent, key) for key in _NORMAL_MAPPING_KEYS if key in parent.model_fields_set}
    if not given or any(key in child.model_fields_set for key in _NORMAL_MAPPING_KEYS):
        return child
    if isinstance(child, SelectorSpec):
        return child.with_children([_with_normal_mapping_of(parent, below) for below in child.children().values()])
    return child.model_copy(update=given)


def collect_components(materials: Iterable[MaterialSpec]) -> Iterator[MaterialSpec]:
    """Walk through resolved materials and all of their parts."""
    for material in materials:
        yield material
        yield from collect_components(material.children().values())


def mesh_materials(
    spec: SceneSpec, item: ShapeSpec, keys: tuple[str | int, ...], held: Mapping[str, Any]
) -> tuple[list[MaterialSpec], NDArray[np.int64]] | None:
    """Read the materials in an object's file, and the index of each face's, unless the object names one itself.

    held : contents of the object's files.

    Raises
    ------
    SceneError : a material in the file is invalid.
    """
    path, (name, _) = next(iter(item.files().items()), ((), ("", "")))
    kinds = getattr(held.get(".".join(map(str, path))), "kinds", None)
    if kinds is None or item.material is not None or item.medium is not None:
        return None
    try:
        file_materials = read_materials(spec.base / name, name)
    except InputError as error:
        raise spec.error(str(error), *keys, *path) from None
    present, faces = np.unique(kinds, return_inverse=True)
    materials: list[MaterialSpec] = []
    for number in present:
        try:
            checked = check_material(file_materials[number])
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            # pydantic's path holds the names of kinds, too.
            below = path_text(tuple(step for step in first["loc"] if step not in MATERIALS.modules))
            wrong = f"{name}: has material {number}, counted from 0, whose {below} {error_sentence(first)}"
            raise spec.error(wrong, *keys, *path) from None
        assert isinstance(checked, MaterialSpec)
        materials.append(resolve_material(checked, {}))
    return materials, faces.astype(np.int64)


class Materials(NamedTuple):
    """Packed materials.

    tables : one a kind, sorted by it.
    selectors : one a kind, sorted by it, or None.
    references : of the materials that were given.
    parts : every material in the tables with its reference.
    """

    tables: tuple[Any, ...]
    selectors: Selectors | None
    references: list[int]
    parts: list[tuple[MaterialSpec, int]]


def pack_materials(used: Sequence[MaterialSpec], interfaces: Sequence[Hashable], packer: ParameterPacker) -> Materials:
    """Pack resolved materials; a reference is row * kinds + kind, where the kinds of selectors come last.

    A material between other media (`interfaces`, one a material) has a row of its own, since media are looked up by its
    reference.
    """
    rows: dict[str, dict[tuple[MaterialSpec, Hashable], int]] = {}
    for material, space in zip(used, interfaces, strict=True):
        for part in collect_components([material]):
            of_kind = rows.setdefault(part.type, {})
            of_kind.setdefault((part, space), len(of_kind))
    # Boundaries alone make no table of materials, but kernels need one.
    if all(issubclass(MATERIALS.spec(kind), SelectorSpec) for kind in rows):
        plain = make_material(DEFAULT_MATERIAL)
        rows[plain.type] = {(plain, interfaces[0]): 0}
    order = sorted(rows, key=lambda kind: (issubclass(MATERIALS.spec(kind), SelectorSpec), kind))

    def reference(material: MaterialSpec, space: Hashable) -> int:
        return rows[material.type][material, space] * len(order) + order.index(material.type)

    tables: list[Any] = []
    selectors: list[Any] = []
    for kind in order:
        specs = [material for material, _ in rows[kind]]
        if isinstance(specs[0], SelectorSpec):
            children = [[reference(child, space) for child in item.children().values()] for item, space in rows[kind]]
            selectors.append(specs[0].pack_selectors(specs, packer, children))
        else:
            tables.append(specs[0].pack(specs, packer))
    packed = [reference(material, space) for material, space in zip(used, interfaces, strict=True)]
    real = [(part, reference(part, space)) for kind in order[: len(tables)] for part, space in rows[kind]]
    return Materials(tuple(tables), Selectors(tuple(selectors)) if selectors else None, packed, real)


# ---- Textures


def _inline(material: MaterialSpec, keys: KeyPath) -> Iterator[tuple[MaterialSpec, KeyPath]]:
    """Walk through a material and those that it holds inline, each with its path."""
    yield material, keys
    for below, child in material.children().items():
        if isinstance(child, MaterialSpec):
            yield from _inline(child, (*keys, *below))


def _texture_uses(
    spec: SceneSpec, used: Sequence[MaterialSpec], file_paths: Mapping[MaterialSpec, KeyPath]
) -> Iterator[tuple[TextureUse, KeyPath, KeyPath]]:
    """Walk through the uses of textures by materials, each with the path of its key and that of the texture."""
    roots = list(file_paths.items())
    for path, item in spec.all_objects():
        if isinstance(item.material, MaterialSpec):
            roots.append((item.material, (*path, "material")))
    roots += [(material, ("materials", name)) for name, material in spec.materials.items()]
    keys: dict[MaterialSpec, KeyPath] = {}
    for material, path in roots:
        keys |= _inline(material, path)
        keys[resolve_material(material, spec.materials)] = path
    for material in dict.fromkeys(used):
        for use in textures_of(material):
            asked = (*keys[material], use.key) if material in keys else ("materials",)
            yield use, asked, ("textures", use.value) if isinstance(use.value, str) else asked


def _check_range(spec: SceneSpec, use: TextureUse, values: ValueRange, keys: KeyPath) -> None:
    """Reject a texture with values that the parameter cannot have."""
    bounds = use.field.bounds
    if bounds.low <= values.low and values.high <= bounds.high:
        return
    name = f"texture {format_value(use.value)}" if isinstance(use.value, str) else "texture"
    side, which = ("at least", 0) if values.low < bounds.low else ("at most", 1)
    raise spec.error(f"must be {side} {bounds[which]:g}, and the {name} takes the value {values[which]:.6g}", *keys)


def pack_textures(
    spec: SceneSpec, used: Sequence[MaterialSpec], file_paths: Mapping[MaterialSpec, KeyPath], files: SceneAssets
) -> ParameterPacker:
    """Pack the textures that the materials `used` ask for, into the packer of material parameters.

    file_paths : paths of materials that are not in the scene itself but in files of its objects.

    Raises
    ------
    SceneError : a texture's file cannot be read, or its values do not suit the parameter.
    """
    assets: dict[TextureSpec, Assets] = {}
    uses: list[TextureUse] = []
    for use, asked, keys in _texture_uses(spec, used, file_paths):
        texture = spec.textures[use.value] if isinstance(use.value, str) else use.value
        uses.append(use)
        for variant in (texture, texture.as_data()):
            if variant not in assets:
                assets[variant] = files.of(variant, keys)
                with spec.errors_at(*keys):
                    variant.check(assets[variant])
        shown = texture.as_data() if use.field.data else texture
        _check_range(spec, use, shown.range(assets[texture]), asked)
    return ParameterPacker(spec.textures, uses, assets)


def dispersion_modes(parts: Sequence[tuple[MaterialSpec, int]]) -> NDArray[np.uint8] | None:
    """Return the dispersion mode by reference, see `DispersiveMaterials`; None where no material disperses."""
    modes = np.zeros(max(reference for _, reference in parts) + 1, np.uint8)
    for material, reference in parts:
        modes[reference] = material.dispersion_mode()
    return modes if modes.any() else None
