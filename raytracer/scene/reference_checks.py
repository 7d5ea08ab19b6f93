"""Checks of the names by which parts of a scene refer to others: materials, textures, media, groups and objects."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from raytracer.plugins.textures.base.interface import is_name, textures_of
from raytracer.schema.spec import Spec, field_error
from raytracer.schema.yaml_nodes import KeyPath, path_text
from raytracer.util.errors import format_value, suggest_name

if TYPE_CHECKING:
    from raytracer.scene.spec import SceneSpec

_DEEPEST_MATERIAL = 64
_MOST_PARTS = 10_000
"""Most materials that one may be made of: names that each use the one before twice would soon make it billions."""

# Levels of groups in groups, which are walked down by recursion; scenes have a handful.
_DEEPEST_GROUP = 64


def check_references(scene: "SceneSpec") -> None:
    """Reject names of materials, textures, media, groups and objects that do not exist, repeat or form loops.

    Raises
    ------
    ValidationError: there is such a name.
    """
    for name in scene.textures:
        if not is_name(name):
            sentence = "a texture's name must not begin as a number does, nor with #, or would be taken for a value"
            field_error(("textures", name), sentence)
    for name, material in scene.materials.items():
        _check_parts(scene, material, "materials", name)
    _check_loops(scene)
    _check_known("medium", scene.medium, scene.media, "medium")
    _check_known("medium", scene.camera.medium, scene.media, "camera", "medium")
    for name, items in scene.groups.items():
        if not items:
            field_error(("groups", name), "must hold at least one object")
    seen: dict[str, KeyPath] = {}
    for keys, item in scene.all_objects():
        if isinstance(item.material, str):
            _check_known("material", item.material, scene.materials, *keys, "material")
        _check_known("medium", item.medium, scene.media, *keys, "medium")
        _check_known("medium", item.outside_medium, scene.media, *keys, "outside_medium")
        if isinstance(item.material, Spec):
            _check_parts(scene, item.material, *keys, "material")

        # A name means one object.
        if item.name is not None:
            if item.name in seen:
                field_error((*keys, "name"), f"{item.name!r} is already the name of {path_text(seen[item.name])}")
            if item.name in scene.groups:
                field_error((*keys, "name"), f"{item.name!r} is already the name of a group")
            seen[item.name] = keys
    _check_instances(scene)
    _check_focus(scene)


def _check_focus(scene: "SceneSpec") -> None:
    """Reject a camera that is focused on an object that does not exist."""
    name = scene.camera.focused_object()
    known = [item.name for item in scene.objects if item.name is not None]
    if name is None or name in known:
        return
    inside = (item.name for items in scene.groups.values() for item in items)
    if name in scene.groups or name in inside:
        what = "a group" if name in scene.groups else "in a group"
        sentence = f"{name!r} is {what}, which may be in many places: name an object that places it"
        field_error(("camera", "focus_on"), sentence)
    close = suggest_name(name, known, "named objects")
    field_error(("camera", "focus_on"), f"unknown object {format_value(name)}; {close}")


def _check_known(noun: str, name: str | None, known: Mapping[str, Any], *keys: str | int) -> None:
    """Reject a name of something that does not exist; None names nothing."""
    if name is not None and name not in known:
        from PIL import ImageColor

        nouns = "media" if noun == "medium" else f"{noun}s"
        hint = suggest_name(name, known, nouns)
        if noun == "texture" and isinstance(written := ImageColor.colormap.get(name.lower()), str):
            hint = f"the colour is written '{written}'"
        field_error(keys, f"unknown {noun} {format_value(name)}; {hint}")


def _check_parts(scene: "SceneSpec", material: Any, *keys: str | int) -> None:
    """Reject a material with a part or a texture that does not exist."""
    for use in textures_of(material):
        if isinstance(use.value, str):
            _check_known("texture", use.value, scene.textures, *keys, use.key)
    for key, child in material.children().items():
        if isinstance(child, str):
            _check_known("material", child, scene.materials, *keys, *key)
        else:
            _check_parts(scene, child, *keys, *key)


def _check_loops(scene: "SceneSpec") -> None:
    """Reject a material that is a part of itself, or is made of too many when all names are followed."""
    parts = {name: tuple(_named_parts(material)) for name, material in scene.materials.items()}
    sizes: dict[str, int] = {}

    def follow(chain: tuple[str, ...]) -> int:
        """Count the materials that the last of a chain of names is made of, itself included."""
        name = chain[-1]
        if name not in sizes:
            size = 1
            for keys, child in parts[name]:
                place = ("materials", name, *keys)
                if child in chain:
                    loop = (*chain[chain.index(child) :], child)
                    first = next(keys for keys, below in parts[child] if below == loop[1])
                    sentence = f"makes the material {loop[0]!r} a part of itself: {' -> '.join(loop)}"
                    field_error(("materials", child, *first), sentence)
                if len(chain) >= _DEEPEST_MATERIAL:
                    field_error(place, f"makes materials of materials more than {_DEEPEST_MATERIAL} levels deep")
                size += follow((*chain, child))
                if size > _MOST_PARTS:
                    sentence = f"makes one material of more than {_MOST_PARTS:,}, each counted where it is named"
                    field_error(place, sentence)
            sizes[name] = size
        return sizes[name]

    for name in scene.materials:
        follow((name,))


def _check_instances(scene: "SceneSpec") -> None:
    """Reject instances of objects that do not exist, and of groups that they are a part of."""
    named = {item.name: item for item in scene.objects if item.name is not None}
    places = {name: [_placed_by(item) for item in items if _placed_by(item)] for name, items in scene.groups.items()}
    places |= {name: [_placed_by(item)] if _placed_by(item) else [] for name, item in named.items()}
    for keys, item in scene.all_objects():
        if (placed := _placed_by(item)) and placed not in places:
            hint = suggest_name(placed, places, "groups and named objects")
            field_error((*keys, "of"), f"unknown group or object {format_value(placed)}; {hint}")

    # Walk down from each name, below each only once.
    depths: dict[str, int] = {}
    for name in places:
        if chain := _find_cycle(name, places, depths):
            keys = next(
                keys
                for keys, item in scene.all_objects()
                if getattr(item, "of", None) == chain[1] and chain[0] in (keys[1], item.name)
            )
            if chain[0] != chain[-1]:
                field_error((*keys, "of"), f"places groups in groups more than {_DEEPEST_GROUP} levels deep")
            field_error((*keys, "of"), f"places {chain[0]!r} in itself: {' -> '.join(chain)}")


def _placed_by(item: Spec) -> str:
    """Return the name of what an object places; empty if it places nothing."""
    return str(item.__dict__.get("of", ""))


def _find_cycle(name: str, places: Mapping[str, Sequence[str]], depths: dict[str, int]) -> list[str]:
    """Find a chain of names, each placing the next, that is a loop or too deep; empty if `name` begins none.

    depths : levels from each name down, of those walked before; those walked now are added.
    """
    path: list[tuple[str, Iterator[str]]] = [(name, iter(places[name]))]
    while path:
        following = next(path[-1][1], None)
        if following is None:
            ended, _ = path.pop()
            depths[ended] = 1 + max((depths[below] for below in places[ended]), default=0)
            continue
        names = [passed for passed, _ in path]
        if following in names:
            return [*names[names.index(following) :], following]
        if len(path) + depths.get(following, 1) > _DEEPEST_GROUP:
            return [*names, following]
        if following not in depths:
            path.append((following, iter(places[following])))
    return []


def _named_parts(material: Any) -> Iterator[tuple[KeyPath, str]]:
    """Walk through the names of a material's parts, of those it holds inline too, with the paths of their keys."""
    for key, child in material.children().items():
        if isinstance(child, str):
            yield key, child
        else:
            yield from (((*key, *below), name) for below, name in _named_parts(child))
