"""Sentences of warnings about places in a scene file."""

from collections.abc import Iterable

from raytracer.scene.spec import SceneSpec
from raytracer.schema.warning_kind import WarningRecord
from raytracer.schema.yaml_nodes import KeyPath, path_text
from raytracer.util.errors import SceneError

MAX_PER_KIND = 10
"""Most warnings of a kind that are printed one by one."""


def warning_at(spec: SceneSpec, record: WarningRecord) -> WarningRecord:
    """Begin a warning's sentence with file, line and object of the value that it is about."""
    error = spec.error(record.text, *record.keys)
    key = error.key.replace(path_text(record.keys), object_label(spec, record.keys), 1)
    placed = SceneError(record.text, file=error.file, line=error.line, key=key, source=error.source)
    return record._replace(text=str(placed))


def object_label(spec: SceneSpec, keys: KeyPath) -> str:
    """Format an object for messages: its path in the scene, and its name if it has one."""
    within, *rest = keys
    objects = spec.groups.get(str(rest[0]), ()) if within == "groups" and rest else spec.objects
    number = rest[-1] if within in ("objects", "groups") and rest else None
    name = objects[number].name if isinstance(number, int) else None
    return path_text(keys) if name is None else f'{path_text(keys)} "{name}"'


def warning_messages(warnings: Iterable[WarningRecord]) -> list[str]:
    """List the sentences, at most `MAX_PER_KIND` of a kind, and for each kind how many more there are."""
    kinds: dict[str, list[str]] = {}
    for item in warnings:
        kinds.setdefault(item.kind, []).append(item.text)
    lines = []
    for kind, sentences in kinds.items():
        lines += sentences[:MAX_PER_KIND]
        if len(sentences) > MAX_PER_KIND:
            lines.append(f"and {len(sentences) - MAX_PER_KIND:,} more {kind}")
    return lines
