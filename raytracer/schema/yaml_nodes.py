"""Trees of nodes that know where they were written, so that every error can name its line.

A scene and what overrides change of it are such trees; `yaml_parser.py` reads them from YAML.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

from raytracer.util.errors import abbreviate, format_value, suggest_name

MAX_DEPTH = 64
MAX_DIGITS = 400
"""Digits of integers that are taken: Python refuses to convert thousands of them."""

KeyPath: TypeAlias = tuple[str | int, ...]
"""Keys and indices that lead to a value: `("objects", 3, "radius")`."""

# What pydantic appends to the path of a dict's key that is itself wrong.
_KEY = "[key]"


@dataclass(frozen=True, slots=True)
class SourceLocation:
    """The source of a node: a line of the file (from 1), or an option of the command line.

    is_user_requested : True if the user who runs the program gave the value, not a file.
    """

    line: int
    option: str | None = None
    is_user_requested: bool = False


@dataclass(frozen=True, slots=True)
class Node:
    """A scalar (`value`), a list (`items`) or a mapping (`entries`), with its source location.

    `size` counts the values below and including this one with aliases expanded; `depth` counts the levels.
    """

    place: SourceLocation
    value: Any = None
    items: tuple["Node", ...] | None = None
    entries: dict[str, tuple[SourceLocation, "Node"]] | None = None
    size: int = 1
    depth: int = 1

    def plain(self) -> Any:
        """Convert the tree to Python values: dict, list, str, int, float, bool, None."""
        if self.entries is not None:
            return {key: node.plain() for key, (_, node) in self.entries.items()}
        if self.items is not None:
            return [node.plain() for node in self.items]
        return self.value


def collection(
    place: SourceLocation,
    *,
    items: tuple[Node, ...] | None = None,
    entries: dict[str, tuple[SourceLocation, Node]] | None = None,
) -> Node:
    """Make a list or a mapping of nodes."""
    below = items if items is not None else tuple(node for _, node in (entries or {}).values())
    size, depth = 1, 0
    for node in below:
        size += node.size
        depth = max(depth, node.depth)
    return Node(place, None, items, entries, size, 1 + depth)


def node_of(value: Any, place: SourceLocation) -> Node:
    """Convert Python values (dict, list, tuple, array, scalars) to a tree whose nodes all stand at `place`."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, dict):
        return collection(place, entries={str(key): (place, node_of(item, place)) for key, item in value.items()})
    if isinstance(value, list | tuple):
        return collection(place, items=tuple(node_of(item, place) for item in value))
    return Node(place, value)


# ---- Paths


_STEP = re.compile(r"\[([0-9]+)\]|\.?([^.\[\]]+)")


def parse_path(text: str) -> tuple[str, ...]:
    """Split a dotted path into its steps: `objects[3].radius`, `objects.3.radius` or `objects.ball.radius`.

    Raises
    ------
    ValueError: not such a path.
    """
    steps = tuple(match[1] or match[2] for match in _STEP.finditer(text))
    if len(steps) > MAX_DEPTH:
        raise ValueError(f"is a path of more than {MAX_DEPTH} steps")
    if not steps or "".join(match[0] for match in _STEP.finditer(text)) != text or text.startswith("."):
        raise ValueError(f"{format_value(text)} is not a path such as camera.vfov or objects[3].radius")
    return steps


def path_text(path: KeyPath) -> str:
    """Format a path as in messages: `("objects", 3, "radius")` as `objects[3].radius`."""
    result = ""
    for step in path:
        result += f"[{step}]" if isinstance(step, int) else f".{step}" if result else step
    return result


def _index(items: Sequence[Node], step: str) -> int:
    """Find the index in a list that a step of a path means: a number, or an item's `name`."""
    if step.isascii() and step.isdecimal():
        if len(step) < MAX_DIGITS and int(step) < len(items):
            return int(step)
        raise ValueError(f"there is no item {abbreviate(step)}; the list has {len(items)}")
    names = {
        str(item.entries["name"][1].value): i for i, item in enumerate(items) if item.entries and "name" in item.entries
    }
    if step not in names:
        raise ValueError(f"there is no item of the name {format_value(step)}; {suggest_name(step, names, 'names')}")
    return names[step]


def override(root: Node, path: Sequence[str], new: Node) -> Node:
    """Replace the value at `path` of a tree, and make mappings that are missing on the way.

    Raises
    ------
    ValueError: the path leads through a value that is neither list nor mapping, or to an item that is not there.
    """
    if not path:
        return new
    step, *rest = path
    if root.items is not None:
        i = _index(root.items, step)
        items = (*root.items[:i], override(root.items[i], rest, new), *root.items[i + 1 :])
        return collection(root.place, items=items)
    if root.entries is None and root.value is not None:
        raise ValueError(
            f"{format_value(step)} is not below {format_value(root.value)}, which is neither a list nor a mapping"
        )
    entries = dict(root.entries or {})
    place, below = entries.get(step, (new.place, Node(new.place)))
    below = override(below, rest, new)
    entries[step] = (new.place if not rest else place, below)
    return collection(root.place if root.entries is not None else new.place, entries=entries)


def locate(root: Node, path: KeyPath, *, typed: bool = True) -> tuple[SourceLocation, KeyPath]:
    """Find the source of the value at `path`, and the path without the type names that pydantic adds to it.

    For a missing or unknown key, it is the location of the mapping that lacks the key, or of the key.

    typed : the path has type names; without them, a key may have the same name as a type.
    """
    node, place = root, root.place
    keys: list[str | int] = []
    tagged = not typed
    for step in path:
        if not tagged and node.entries is not None and "type" in node.entries and node.entries["type"][1].value == step:
            tagged = True
            continue
        tagged = not typed
        if node.entries is None and node.items is None:
            # A bare name stands for a mapping: the steps below it are not in the document.
            break
        if step == _KEY:
            break
        keys.append(step)
        if node.entries is not None and step in node.entries:
            place, node = node.entries[str(step)]
        elif node.items is not None and isinstance(step, int) and step < len(node.items):
            node = node.items[step]
            place = node.place
        else:
            break
    return place, tuple(keys)
