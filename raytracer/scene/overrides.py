"""Overrides: values at dotted paths in place of a scene's own, as `-D camera.f_number=2` gives them."""

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, TypeVar

from raytracer.optics.to_yaml import value_to_plain
from raytracer.scene.files import check_files
from raytracer.scene.validation import validate_scene
from raytracer.schema.yaml_nodes import Node, SourceLocation, collection, node_of, override, parse_path
from raytracer.schema.yaml_parser import parse
from raytracer.util.errors import InputError, SceneError, abbreviate, format_value

if TYPE_CHECKING:
    from raytracer.scene.spec import SceneSpec

S = TypeVar("S", bound="SceneSpec")


def parse_overrides(definitions: Iterable[str]) -> dict[str, Any]:
    """Parse `-D` options, each `key.path=value` with the value in YAML.

    Raises
    ------
    InputError: an option without `=`, with a path that is none, given twice, or with a value that is not YAML.
    """
    result: dict[str, Any] = {}
    for definition in definitions:
        key, equals, text = definition.partition("=")
        option = f"-D {definition}"
        if not equals:
            raise InputError(f"{option}: must be key.path=value, such as camera.vfov=40")
        _path(key, option)
        if key in result:
            raise InputError(f"{option}: {key} is given twice")
        root = parse(text, "", option=option)
        result[key] = root.plain() if root is not None else None
    return result


def override_path(key: str, value: Any) -> tuple[str, ...]:
    """Split the dotted path of an override into its steps.

    Raises
    ------
    InputError: it is no path.
    """
    return _path(key, _option(key, value))


def _option(key: str, value: Any) -> str:
    return f"-D {key}={abbreviate(as_yaml(value))}"


def _path(key: str, option: str) -> tuple[str, ...]:
    try:
        return parse_path(key)
    except ValueError as error:
        raise InputError(f"{option}: {error}") from None


def set_value(root: Node, key: str, value: Any) -> Node:
    """Replace the value at a dotted path of a tree; see `yaml_nodes.override`.

    Raises
    ------
    SceneError: the path leads to what is not there.
    InputError: it is no path.
    """
    option = _option(key, value)
    try:
        return override(
            root, override_path(key, value), node_of(value, SourceLocation(0, option, is_user_requested=True))
        )
    except ValueError as error:
        raise SceneError(str(error), source=option) from None


def as_yaml(value: Any) -> str:
    """Format a value as the command line would give it."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {as_yaml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(as_yaml(item) for item in value) + "]"
    if isinstance(value, str):
        return value
    return "null" if value is None else format_value(value)


# ---- Changes of a checked scene

_NOWHERE = SourceLocation(0)


def apply_overrides(spec: S, overrides: Mapping[str, Any]) -> S:
    """Replace values of a checked scene by dotted path (`camera.f_number`, `objects.ball.radius`).

    The result is as if they had been given to `load`; the scene may also be built in code.  What no override
    touches, the new scene shares with the old one: `new.objects is old.objects`.

    Raises
    ------
    SceneError: a path leads to what is not there, or a value does not suit; it names the override.
    InputError: a path that is none.
    """
    touched = list(dict.fromkeys(override_path(key, value)[0] for key, value in overrides.items()))
    if not touched:
        return spec
    written = spec._root.entries if spec._root is not None and spec._root.entries is not None else {}
    tree = dict(written)
    before: dict[str, Node] = {}
    for key in touched:
        tree.pop(key, None)
        if key in spec.model_fields_set:
            place, like = written.get(key, (_NOWHERE, None))
            before[key] = _node(value_to_plain(getattr(spec, key)), like, place)
            tree[key] = (place, before[key])
    root = collection(_NOWHERE if spec._root is None else spec._root.place, entries=tree)
    for key, value in overrides.items():
        root = set_value(root, key, value)

    # Unchanged parts are passed on as checked specs; only the names in them are checked again.
    values: dict[str, Any] = {key: getattr(spec, key) for key in spec.model_fields_set}
    after = root.entries or {}
    for key in touched:
        values[key] = _mixed(values.get(key), before.get(key), after[key][1])
    checked = validate_scene(type(spec), values, root, spec.file)
    result = spec.model_copy(update={key: getattr(checked, key) for key in touched})
    result._root = root
    check_files(result, touched)
    return result


def _node(value: Any, like: Node | None, place: SourceLocation) -> Node:
    """Convert plain values to a tree with the locations of the nodes of `like`, as far as it has them."""
    place = like.place if like is not None else place
    if isinstance(value, dict):
        entries = like.entries if like is not None and like.entries is not None else {}
        placed = ((key, *entries.get(key, (place, None))) for key in value)
        return collection(place, entries={key: (at, _node(value[key], below, at)) for key, at, below in placed})
    if isinstance(value, list):
        items = like.items if like is not None else None
        models = items if items is not None and len(items) == len(value) else (None,) * len(value)
        pairs = zip(value, models, strict=True)
        return collection(place, items=tuple(_node(item, below, place) for item, below in pairs))
    return Node(place, value)


def _mixed(value: Any, old: Node | None, new: Node) -> Any:
    """Convert a tree to plain values, or to the checked specs that it was made of where it is unchanged."""
    if new is old:
        return value
    if old is not None and isinstance(value, tuple) and old.items is not None and new.items is not None:
        if len(value) == len(new.items) == len(old.items):
            return [_mixed(*parts) for parts in zip(value, old.items, new.items, strict=True)]
    elif old is not None and type(value) is dict and old.entries is not None and new.entries is not None:
        before = {key: node for key, (_, node) in old.entries.items()}
        return {key: _mixed(value.get(key), before.get(key), node) for key, (_, node) in new.entries.items()}
    return new.plain()
