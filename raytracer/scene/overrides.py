"""A checked scene with other values in some places, checked again where it has changed."""

from collections.abc import Mapping
from typing import Any

from raytracer.document import Node, Place, collection
from raytracer.dump import plain_value
from raytracer.scene.load import check_files, path_of, set_value, validated
from raytracer.scene.spec import SceneSpec

_NOWHERE = Place(0)


def overridden(spec: SceneSpec, overrides: Mapping[str, Any]) -> SceneSpec:
    """The scene with these values by dotted path (`camera.f_number`, `objects.ball.radius`) in place of its own.

    As if they had been given to `load`, for any scene: built in code, or changed since it was loaded.  What no override
    touches, the new scene shares with the old one: `new.objects is old.objects`.

    Raises
    ------
    SceneError: a path leads to what is not there, or a value does not suit; it names the override.
    InputError: a path that is none.
    """
    touched = list(dict.fromkeys(path_of(key, value)[0] for key, value in overrides.items()))
    if not touched:
        return spec
    written = spec._root.entries if spec._root is not None and spec._root.entries is not None else {}
    tree = dict(written)
    before: dict[str, Node] = {}
    for key in touched:
        tree.pop(key, None)
        if key in spec.model_fields_set:
            place, like = written.get(key, (_NOWHERE, None))
            before[key] = _node(plain_value(getattr(spec, key)), like, place)
            tree[key] = (place, before[key])
    root = collection(_NOWHERE if spec._root is None else spec._root.place, entries=tree)
    for key, value in overrides.items():
        root = set_value(root, key, value)

    # What is as it was is handed over as it is, and not checked again but for the names in it.
    values: dict[str, Any] = {key: getattr(spec, key) for key in spec.model_fields_set}
    after = root.entries or {}
    for key in touched:
        values[key] = _mixed(values.get(key), before.get(key), after[key][1])
    checked = validated(values, root, spec.file)
    result = spec.model_copy(update={key: getattr(checked, key) for key in touched})
    result._root = root
    check_files(result, touched)
    return result


def _node(value: Any, like: Node | None, place: Place) -> Node:
    """Plain values as a tree whose nodes stand where those of `like` do, as far as it has them."""
    place = like.place if like is not None else place
    if isinstance(value, dict):
        entries = like.entries if like is not None and like.entries is not None else {}
        found = ((key, *entries.get(key, (place, None))) for key in value)
        return collection(place, entries={key: (at, _node(value[key], below, at)) for key, at, below in found})
    if isinstance(value, list):
        items = like.items if like is not None else None
        kept = items if items is not None and len(items) == len(value) else (None,) * len(value)
        pairs = zip(value, kept, strict=True)
        return collection(place, items=tuple(_node(item, below, place) for item, below in pairs))
    return Node(place, value)


def _mixed(value: Any, old: Node | None, new: Node) -> Any:
    """The plain values of a tree, or the checked ones of which it was made where it has not changed."""
    if new is old:
        return value
    if old is not None and isinstance(value, tuple) and old.items is not None and new.items is not None:
        if len(value) == len(new.items) == len(old.items):
            return [_mixed(*parts) for parts in zip(value, old.items, new.items, strict=True)]
    elif old is not None and type(value) is dict and old.entries is not None and new.entries is not None:
        before = {key: node for key, (_, node) in old.entries.items()}
        return {key: _mixed(value.get(key), before.get(key), node) for key, (_, node) in new.entries.items()}
    return new.plain()
