"""What a concern is: something in a scene that is probably not meant, or that numbers cannot hold."""

from collections.abc import Iterable
from typing import NamedTuple, TypeAlias

from raytracer.document import path_text
from raytracer.errors import SceneError
from raytracer.scene.spec import SceneSpec

Keys: TypeAlias = tuple[str | int, ...]

MOST_TOLD = 10
"""Concerns of a kind that are told one by one."""


class Concern(NamedTuple):
    """A warning.

    kind, the same words for all concerns that are alike; keys, the path in the scene of what it is about; text, one
    sentence that begins with file, line and object.
    """

    kind: str
    keys: Keys
    text: str


def concern(spec: SceneSpec, kind: str, keys: Keys, message: str) -> Concern:
    """A concern about what the scene holds at a path, of which `message` says what is the matter."""
    found = spec.error(message, *keys)
    key = found.key.replace(path_text(keys), named(spec, keys), 1)
    return Concern(kind, keys, str(SceneError(message, file=found.file, line=found.line, key=key, source=found.source)))


def named(spec: SceneSpec, keys: Keys) -> str:
    """What a sentence calls an object: its path in the scene, and its name if it has one."""
    within, *rest = keys
    objects = spec.groups.get(str(rest[0]), ()) if within == "groups" and rest else spec.objects
    number = rest[-1] if within in ("objects", "groups") and rest else None
    name = objects[number].name if isinstance(number, int) else None
    return path_text(keys) if name is None else f'{path_text(keys)} "{name}"'


def told(found: Iterable[Concern]) -> list[str]:
    """The sentences, at most `MOST_TOLD` of a kind, and for each kind how many more there are."""
    kinds: dict[str, list[str]] = {}
    for item in found:
        kinds.setdefault(item.kind, []).append(item.text)
    lines = []
    for kind, texts in kinds.items():
        lines += texts[:MOST_TOLD]
        if len(texts) > MOST_TOLD:
            lines.append(f"and {len(texts) - MOST_TOLD:,} more {kind}")
    return lines
