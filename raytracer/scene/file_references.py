"""The files that a scene names, and where it names them."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple, TypeAlias

from raytracer.spec import Spec

Keys: TypeAlias = tuple[str | int, ...]


class Named(NamedTuple):
    """A file that a scene names: the path of keys to its name, the name, and what it is read as (`assets.LOADERS`)."""

    keys: Keys
    name: str
    kind: str


def named_files(part: Any, keys: Keys = ()) -> tuple[Named, ...]:
    """The files that a scene, or a part of it at `keys`, names, in the order in which it names them."""
    found: dict[Keys, Named] = {}
    for place, spec in _specs(part, keys):
        for below, (name, kind) in spec.files().items():
            # What a mapping holds may name a file for itself, and be told by the mapping too.
            found.setdefault((*place, *below), Named((*place, *below), name, kind))
    return tuple(found.values())


def _specs(part: Any, keys: Keys) -> Iterator[tuple[Keys, Spec]]:
    """Every mapping of a part of a scene, and where it stands."""
    if isinstance(part, Spec):
        yield keys, part
        for key, value in part.__dict__.items():
            if isinstance(value, Spec | tuple | Mapping):
                yield from _specs(value, (*keys, key))
    elif isinstance(part, tuple):
        for number, value in enumerate(part):
            if isinstance(value, Spec | tuple):
                yield from _specs(value, (*keys, number))
    elif isinstance(part, Mapping):
        for key, value in part.items():
            yield from _specs(value, (*keys, key))


def with_names(plain_scene: dict[str, Any], names: Mapping[Keys, str]) -> dict[str, Any]:
    """Plain values (`dump.plain`) that name other files at these paths; the given ones are changed."""
    for keys, name in names.items():
        place: Any = plain_scene
        for key in keys[:-1]:
            place = place[key]
        place[keys[-1]] = name
    return plain_scene
