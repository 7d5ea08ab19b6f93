"""The names of files in a scene, with the paths of their keys."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from raytracer.schema.spec import Spec
from raytracer.schema.yaml_nodes import KeyPath


class FileReference(NamedTuple):
    """A file that a scene names.

    keys : path of keys to the name.
    name : as it stands in the scene.
    kind : asset kind that it is read as (`assets.LOADERS`).
    """

    keys: KeyPath
    name: str
    kind: str


def file_references(part: Any, keys: KeyPath = ()) -> tuple[FileReference, ...]:
    """List the files that a scene, or a part of it at `keys`, names, in the order of the scene."""
    references: dict[KeyPath, FileReference] = {}
    for place, spec in _specs(part, keys):
        for below, (name, kind) in spec.files().items():
            # A part may list a file that the mapping which holds it lists, too.
            references.setdefault((*place, *below), FileReference((*place, *below), name, kind))
    return tuple(references.values())


def _specs(part: Any, keys: KeyPath) -> Iterator[tuple[KeyPath, Spec]]:
    """Walk through every mapping of a part of a scene, with its path."""
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


def replace_file_names(plain_scene: dict[str, Any], names: Mapping[KeyPath, str]) -> dict[str, Any]:
    """Replace the names of files at these paths in plain values (`to_yaml.spec_to_plain`), in place."""
    for keys, name in names.items():
        place: Any = plain_scene
        for key in keys[:-1]:
            place = place[key]
        place[keys[-1]] = name
    return plain_scene
