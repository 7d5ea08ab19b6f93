"""Materials that are made of others: from names to one packed table a kind."""

from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from raytracer.assets.gltf import read_materials
from raytracer.document import path_text
from raytracer.errors import InputError
from raytracer.kinds import MATERIALS
from raytracer.materials.interface import MaterialSpec, Selectors, SelectorSpec
from raytracer.scene.spec import SceneSpec, check_material
from raytracer.shapes.interface import ShapeSpec
from raytracer.spec import sentence
from raytracer.textures.interface import Book

DEFAULT_MATERIAL = "lambertian"
"""What an object is made of that names no material."""

INVISIBLE = "boundary"
"""What an object is made of that is no boundary, but for that of a medium."""

_RELIEF = ("bump", "bump_height", "normal_map", "normal_scale")


def resolved(material: MaterialSpec, named: Mapping[str, MaterialSpec]) -> MaterialSpec:
    """The material with specs in place of names; what selects always the same child is that child.

    What is no boundary at all, as glass of the index that is around it, is an invisible one.  A selector's own relief
    is that of its children, but for those that have one themselves.
    """
    if not isinstance(material, SelectorSpec):
        return _invisible(material) if material.is_nothing() else material
    children = []
    for child in material.children().values():
        found = resolved(named[child] if isinstance(child, str) else child, named)
        children.append(_with_relief_of(material, found))
    return material.with_children(children)


def _invisible(material: MaterialSpec) -> MaterialSpec:
    """What is no boundary, but for a medium that a material keeps out."""
    found = MATERIALS.specs()[INVISIBLE](clear=material.holds_medium())
    assert isinstance(found, MaterialSpec)
    return found


def _with_relief_of(parent: MaterialSpec, child: MaterialSpec) -> MaterialSpec:
    given = {key: getattr(parent, key) for key in _RELIEF if key in parent.model_fields_set}
    if not given or any(key in child.model_fields_set for key in _RELIEF):
        return child
    if isinstance(child, SelectorSpec):
        return child.with_children([_with_relief_of(parent, below) for below in child.children().values()])
    return child.model_copy(update=given)


def parts(materials: Iterable[MaterialSpec]) -> Iterator[MaterialSpec]:
    """Resolved materials, and all that they are made of."""
    for material in materials:
        yield material
        yield from parts(material.children().values())


class Brought(NamedTuple):
    """What a mesh's file says it is made of: materials, resolved, and for each face the index of one (m,)."""

    materials: tuple[MaterialSpec, ...]
    faces: NDArray[np.int64]


def brought(spec: SceneSpec, item: ShapeSpec, keys: tuple[str | int, ...], held: Mapping[str, Any]) -> Brought | None:
    """The materials that an object's file brings, unless the object names one itself.

    held : what the object's files hold.

    Raises
    ------
    SceneError : a material in the file is not as it should be.
    """
    path, (name, _) = next(iter(item.files().items()), ((), ("", "")))
    kinds = getattr(held.get(".".join(map(str, path))), "kinds", None)
    if kinds is None or item.material is not None or item.medium is not None:
        return None
    try:
        found = read_materials(spec.base / name, name)
    except InputError as error:
        raise spec.error(str(error), *keys, *path) from None
    present, faces = np.unique(kinds, return_inverse=True)
    materials: list[MaterialSpec] = []
    for number in present:
        try:
            checked = check_material(found[number])
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            # pydantic names the kinds that it told apart, too.
            below = path_text(tuple(step for step in first["loc"] if step not in MATERIALS.specs()))
            wrong = f"{name}: has material {number}, counted from 0, whose {below} {sentence(first)}"
            raise spec.error(wrong, *keys, *path) from None
        assert isinstance(checked, MaterialSpec)
        materials.append(resolved(checked, {}))
    return Brought(tuple(materials), faces.astype(np.int64))


class Materials(NamedTuple):
    """Packed materials.

    tables, one a kind, sorted by it; selectors, likewise, or None; references, of the materials packed; parts, every
    material in the tables with its reference.
    """

    tables: tuple[Any, ...]
    selectors: Selectors | None
    references: list[int]
    parts: list[tuple[MaterialSpec, int]]


def pack_materials(used: Sequence[MaterialSpec], spaces: Sequence[Hashable], book: Book) -> Materials:
    """Pack resolved materials; a reference is row * kinds + kind, where the kinds of selectors come last.

    A material between other media (`spaces`, one a material) has a row of its own, since media are looked up by its
    reference.
    """
    rows: dict[str, dict[tuple[MaterialSpec, Hashable], int]] = {}
    for material, space in zip(used, spaces, strict=True):
        for part in parts([material]):
            of_kind = rows.setdefault(part.type, {})
            of_kind.setdefault((part, space), len(of_kind))
    # Boundaries alone make no table of materials, but kernels want one to choose from.
    if all(_is_selector(of_kind) for of_kind in rows.values()):
        plain = MATERIALS.specs()[DEFAULT_MATERIAL]()
        rows[plain.type] = {(plain, spaces[0]): 0}
    order = sorted(rows, key=lambda kind: (_is_selector(rows[kind]), kind))

    def reference(material: MaterialSpec, space: Hashable) -> int:
        return rows[material.type][material, space] * len(order) + order.index(material.type)

    tables: list[Any] = []
    selectors: list[Any] = []
    for kind in order:
        specs = [material for material, _ in rows[kind]]
        if isinstance(specs[0], SelectorSpec):
            children = [[reference(child, space) for child in item.children().values()] for item, space in rows[kind]]
            selectors.append(specs[0].pack_selectors(specs, book, children))
        else:
            tables.append(specs[0].pack(specs, book))
    packed = [reference(material, space) for material, space in zip(used, spaces, strict=True)]
    real = [(part, reference(part, space)) for kind in order[: len(tables)] for part, space in rows[kind]]
    return Materials(tuple(tables), Selectors(tuple(selectors)) if selectors else None, packed, real)


def _is_selector(rows: Mapping[tuple[MaterialSpec, Hashable], int]) -> bool:
    return isinstance(next(iter(rows))[0], SelectorSpec)
