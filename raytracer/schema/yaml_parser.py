"""A YAML text as a tree of nodes that know their line, so that every error can name it.

YAML 1.2's core schema with what scenes and lenses need made safe: `1e-3` is a number, `on`, `yes` and `1:30` are texts,
`inf` and `.inf` are infinite; tags, duplicate keys, several documents and expanding aliases are refused.

References: YAML Ain't Markup Language 1.2.2, section 10.3 (core schema); https://yaml.org/type/merge.html
"""

import math
import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any, TypeAlias

import yaml
from pydantic import ValidationError
from yaml.events import (
    AliasEvent,
    DocumentStartEvent,
    MappingEndEvent,
    MappingStartEvent,
    ScalarEvent,
    SequenceEndEvent,
    SequenceStartEvent,
    StreamEndEvent,
)

from raytracer.errors import SceneError, shortened, shown, suggestion
from raytracer.spec import sentence
from raytracer.untrusted import opened

MAX_BYTES = 64 * 2**20
MAX_DEPTH = 64
MAX_VALUES = 1_000_000
MAX_EXPANDED = 1_000_000

Path: TypeAlias = tuple[str | int, ...]

_INTEGER = re.compile(r"[-+]?[0-9]+")
_PREFIXED = re.compile(r"0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?")
_INFINITE = re.compile(r"([-+]?)\.?(?:inf|Inf|INF)")
_WORDS: dict[str, bool | float | None] = {
    "": None,
    "~": None,
    "null": None,
    "Null": None,
    "NULL": None,
    "true": True,
    "True": True,
    "TRUE": True,
    "false": False,
    "False": False,
    "FALSE": False,
    ".nan": float("nan"),
    ".NaN": float("nan"),
    ".NAN": float("nan"),
}
_DIGITS_KEPT = 400
_CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f]")

_ERRORS_LOOKED_AT = 200
"""Which of the errors of a file stands first takes the square of their number."""

# What pydantic appends to the path of a dict's key that is itself wrong.
_KEY = "[key]"

# libyaml where PyYAML was built with it: six times as fast.
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


@dataclass(frozen=True, slots=True)
class Place:
    """Where a node was written: a line of the file (from 1), or an option of the command line.

    asked : whether it was whoever runs the program that asked for it, and not a file.
    """

    line: int
    option: str | None = None
    asked: bool = False


@dataclass(frozen=True, slots=True)
class Node:
    """A scalar (`value`), a list (`items`) or a mapping (`entries`), and where it was written.

    `size` counts the values below and including this one with aliases expanded; `depth` counts the levels.
    """

    place: Place
    value: Any = None
    items: tuple["Node", ...] | None = None
    entries: dict[str, tuple[Place, "Node"]] | None = None
    size: int = 1
    depth: int = 1

    def plain(self) -> Any:
        """The tree as Python values: dict, list, str, int, float, bool, None."""
        if self.entries is not None:
            return {key: node.plain() for key, (_, node) in self.entries.items()}
        if self.items is not None:
            return [node.plain() for node in self.items]
        return self.value


def collection(
    place: Place,
    *,
    items: tuple[Node, ...] | None = None,
    entries: dict[str, tuple[Place, Node]] | None = None,
) -> Node:
    """A list or mapping of the given nodes."""
    below = items if items is not None else tuple(node for _, node in (entries or {}).values())
    size, depth = 1, 0
    for node in below:
        size += node.size
        depth = max(depth, node.depth)
    return Node(place, None, items, entries, size, 1 + depth)


def scalar(text: str) -> Any:
    """The value of a plain scalar by the core schema."""
    if text in _WORDS:
        return _WORDS[text]
    if text[0] not in "+-.0123456789iI":
        return text
    if _INTEGER.fullmatch(text):
        # Python refuses to convert integers of thousands of digits; as a float such a one is infinite.
        return int(text) if len(text) < _DIGITS_KEPT else float(text)
    if _FLOAT.fullmatch(text):
        return float(text)
    if _PREFIXED.fullmatch(text):
        return int(text, 0) if len(text) < _DIGITS_KEPT else math.inf
    if match := _INFINITE.fullmatch(text):
        return float(match[1] + "inf")
    return text


def node_of(value: Any, place: Place) -> Node:
    """Python values (dict, list, tuple, array, scalars) as a tree that was written at `place`."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, dict):
        return collection(place, entries={str(key): (place, node_of(item, place)) for key, item in value.items()})
    if isinstance(value, list | tuple):
        return collection(place, items=tuple(node_of(item, place) for item in value))
    return Node(place, value)


class _Composer:
    """Builds the tree from the parser's events."""

    def __init__(self, text: str, file: str, option: str | None) -> None:
        self._file = file
        self._option = option
        try:
            self._parser = _LOADER(text)
        except UnicodeEncodeError:
            # An option holds what the terminal sent, which may be no text.
            raise SceneError("is no text in Unicode", file=file or None, source=option) from None
        self._anchors: dict[str, Node | None] = {}
        self._literal = 0
        self._last = Place(0)

    def compose(self) -> Node | None:
        """The one document's root; None for an empty text."""
        self._next()
        event = self._next()
        if isinstance(event, StreamEndEvent):
            return None
        root = self._node(self._next(), 1)
        self._next()
        event = self._next()
        if isinstance(event, DocumentStartEvent):
            raise self.error(event, "a second document starts here; a file holds one")
        return root

    def error(self, event: Any, message: str) -> SceneError:
        place = self._place(event)
        return SceneError(message, file=self._file, line=place.line, source=place.option)

    def _next(self) -> Any:
        try:
            return self._parser.get_event()
        except yaml.MarkedYAMLError as error:
            line = error.problem_mark.line + 1 if error.problem_mark else 1
            raise SceneError(_syntax(error, line), file=self._file, line=line, source=self._option) from None
        except yaml.reader.ReaderError as error:
            given = error.character
            character = chr(given) if isinstance(given, int) else given
            message = f"holds the control character {character!r}"
            raise SceneError(message, file=self._file or None, source=self._option) from None

    def _place(self, event: Any) -> Place:
        # What stands on one line shares its place, which saves half of all objects.
        line = event.start_mark.line + 1
        if line != self._last.line:
            self._last = Place(line, self._option)
        return self._last

    def _node(self, event: Any, depth: int) -> Node:
        if depth > MAX_DEPTH:
            raise self.error(event, f"is nested more than {MAX_DEPTH} levels deep")
        if isinstance(event, AliasEvent):
            return self._alias(event, depth)
        if event.tag is not None:
            raise self.error(event, f"the tag {event.tag!r} is refused; only plain values are taken")

        # An anchor is open (None) while what it names is being read, so that it cannot hold itself.
        if event.anchor is not None:
            self._anchors[event.anchor] = None
        self._literal += 1
        if self._literal > MAX_VALUES:
            what = "a mesh, or the placements of an instance, are files that hold more"
            raise self.error(event, f"this is one of more than {MAX_VALUES:,} values; {what}")
        if isinstance(event, ScalarEvent):
            node = Node(self._place(event), scalar(self._text(event)) if event.implicit[0] else self._text(event))
        elif isinstance(event, SequenceStartEvent):
            node = self._list(event, depth)
        else:
            node = self._mapping(event, depth)
        if event.anchor is not None:
            self._anchors[event.anchor] = node
        if node.size > MAX_EXPANDED + self._literal:
            raise self.error(event, f"aliases expand to more than {MAX_EXPANDED:,} values")
        return node

    def _text(self, event: Any) -> str:
        """What a scalar holds: nothing that a terminal would act upon, for names are printed."""
        text: str = event.value
        if not event.implicit[0] and (found := _CONTROL.search(text)):
            raise self.error(event, f"holds the control character {found[0]!r}")
        return text

    def _alias(self, event: Any, depth: int) -> Node:
        if event.anchor not in self._anchors:
            hint = suggestion(event.anchor, self._anchors, "anchors")
            raise self.error(event, f"the alias *{event.anchor} has no anchor before it; {hint}")
        node = self._anchors[event.anchor]
        if node is None:
            raise self.error(event, f"the alias *{event.anchor} stands inside what it names")
        if depth + node.depth - 1 > MAX_DEPTH:
            raise self.error(event, f"is nested more than {MAX_DEPTH} levels deep")
        return node

    def _list(self, start: SequenceStartEvent, depth: int) -> Node:
        items = []
        while not isinstance(event := self._next(), SequenceEndEvent):
            items.append(self._node(event, depth + 1))
        return collection(self._place(start), items=tuple(items))

    def _mapping(self, start: MappingStartEvent, depth: int) -> Node:
        entries: dict[str, tuple[Place, Node]] = {}
        merged: list[Node] = []
        while not isinstance(event := self._next(), MappingEndEvent):
            if not isinstance(event, ScalarEvent) or event.tag is not None:
                raise self.error(event, "a key must be a plain text")
            key, place = self._text(event), self._place(event)
            node = self._node(self._next(), depth + 1)
            if key == "<<" and event.implicit[0]:
                # Each merges all keys of what it names, and a line of a file that names it is short.
                if merged:
                    raise self.error(event, "<< is given twice; it takes a list of mappings")
                merged.extend(self._merged(event, node))
            elif key in entries:
                first = f" on line {entries[key][0].line}" if self._option is None else ""
                raise self.error(event, f"the key {shown(key)} is given twice, first{first or ' before'}")
            else:
                entries[key] = (place, node)

        # A key of the mapping's own stands before merged ones, an earlier merged mapping before a later one.
        for source in merged:
            for key, entry in (source.entries or {}).items():
                entries.setdefault(key, entry)
        return collection(self._place(start), entries=entries)

    def _merged(self, event: Any, node: Node) -> Sequence[Node]:
        nodes = node.items if node.items is not None else (node,)
        if any(item.entries is None for item in nodes):
            raise self.error(event, "<< must name a mapping, or a list of mappings")
        return nodes


def _syntax(error: yaml.MarkedYAMLError, line: int) -> str:
    """The parser's complaint as the end of a sentence."""
    problem = error.problem or "cannot be read"
    if "cannot start any token" in problem:
        return "not valid YAML: a character that cannot start a value (a tab, perhaps: YAML indents with spaces)"
    start = error.context_mark.line + 1 if error.context_mark else line
    context = f" {error.context}" if error.context else ""
    where = f" that starts on line {start}" if context and start != line else ""
    return f"not valid YAML: {problem}{context}{where}"


def parse(text: str, file: str, option: str | None = None) -> Node | None:
    """The tree of a YAML text; None where it holds nothing.

    Parameters
    ----------
    text: The YAML text.
    file: Name by which errors call the file.
    option: Option of the command line that gave the text, where it did not come from a file.

    Raises
    ------
    SceneError: the text is not one YAML document of plain values, or is too deep, or its aliases expand too far.
    """
    return _Composer(text, file, option).compose()


def read(file: str, noun: str = "scene") -> str:
    """The text of a file that holds a scene, or what else `noun` says.

    Raises
    ------
    SceneError: the file does not exist, cannot be read, is too large, or is not UTF-8.
    """
    try:
        # What is named as a file is not waited for; a pipe of a shell (/dev/fd/63) has no suffix.
        named = FilePath(file)
        with opened(named, sys.maxsize) if named.suffix else named.open("rb") as stream:
            data = stream.read(MAX_BYTES + 1)
    except FileNotFoundError:
        raise SceneError("no such file", file=file) from None
    except IsADirectoryError:
        raise SceneError(f"is a folder, not a {noun} file", file=file) from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise SceneError(f"cannot be read: {reason.lower()}", file=file) from None
    if len(data) > MAX_BYTES:
        raise SceneError(f"is larger than {MAX_BYTES // 2**20} MB, the limit for a {noun} file", file=file)
    if b"\0" in data:
        raise SceneError(f"is a binary file, not a {noun} in YAML", file=file)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise SceneError(f"is not UTF-8 text (byte {data[error.start]:#04x})", file=file, line=line) from None


# ---- Paths


_STEP = re.compile(r"\[([0-9]+)\]|\.?([^.\[\]]+)")


def parse_path(text: str) -> tuple[str, ...]:
    """The steps of a dotted path: `objects[3].radius`, `objects.3.radius` and `objects.ball.radius`.

    Raises
    ------
    ValueError: not such a path.
    """
    steps = tuple(match[1] or match[2] for match in _STEP.finditer(text))
    if len(steps) > MAX_DEPTH:
        raise ValueError(f"is a path of more than {MAX_DEPTH} steps")
    if not steps or "".join(match[0] for match in _STEP.finditer(text)) != text or text.startswith("."):
        raise ValueError(f"{shown(text)} is not a path such as camera.vfov or objects[3].radius")
    return steps


def path_text(path: Path) -> str:
    """`("objects", 3, "radius")` as `objects[3].radius`."""
    result = ""
    for step in path:
        result += f"[{step}]" if isinstance(step, int) else f".{step}" if result else step
    return result


def _index(items: Sequence[Node], step: str) -> int:
    """Index in a list that a path's step names: a number, or an item's `name`."""
    if _INTEGER.fullmatch(step) and step.isdecimal():
        if len(step) < _DIGITS_KEPT and int(step) < len(items):
            return int(step)
        raise ValueError(f"there is no item {shortened(step)}; the list has {len(items)}")
    names = {
        str(item.entries["name"][1].value): i for i, item in enumerate(items) if item.entries and "name" in item.entries
    }
    if step not in names:
        raise ValueError(f"there is no item of the name {shown(step)}; {suggestion(step, names, 'names')}")
    return names[step]


def override(root: Node, path: Sequence[str], new: Node) -> Node:
    """The tree with the value at `path` put in place of what is there; missing mappings are made.

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
        raise ValueError(f"{shown(step)} is not below {shown(root.value)}, which is neither a list nor a mapping")
    entries = dict(root.entries or {})
    place, below = entries.get(step, (new.place, Node(new.place)))
    below = override(below, rest, new)
    entries[step] = (new.place if not rest else place, below)
    return collection(root.place if root.entries is not None else new.place, entries=entries)


def locate(root: Node, path: Path, *, typed: bool = True) -> tuple[Place, Path]:
    """Where the value at `path` is written, and the path without the type names that pydantic adds to it.

    Of a path that ends in a missing or unknown key it is the place of that key, or of the mapping that lacks it.

    typed : whether the path has those names; of one that is of keys alone, a key may be called as a type is.
    """
    node, place = root, root.place
    found: list[str | int] = []
    tagged = not typed
    for step in path:
        if not tagged and node.entries is not None and _type_of(node) == step:
            tagged = True
            continue
        tagged = not typed
        if node.entries is None and node.items is None:
            # A bare name that stands for a mapping: the steps below it are not in the document.
            break
        if step == _KEY:
            break
        found.append(step)
        if node.entries is not None and step in node.entries:
            place, node = node.entries[str(step)]
        elif node.items is not None and isinstance(step, int) and step < len(node.items):
            node = node.items[step]
            place = node.place
        else:
            break
    return place, tuple(found)


def _type_of(node: Node) -> Any:
    if node.entries is not None and "type" in node.entries:
        return node.entries["type"][1].value
    return None


# ---- Errors


def error_at(message: str, keys: Path, root: Node | None, file: str | None, *, typed: bool = True) -> SceneError:
    """`message` about the value at `keys` of the document `root`, with its line or the option that it came from.

    typed : as in `locate`.
    """
    if root is None:
        return SceneError(message, file=file, key=path_text(keys))
    place, path = locate(root, keys, typed=typed)
    return SceneError(message, file=file, line=place.line or None, key=path_text(path), source=place.option)


def first_error(error: ValidationError, root: Node | None, file: str | None) -> SceneError:
    """The error that stands first in the document, of the first `_ERRORS_LOOKED_AT` that were found."""
    items = error.errors(include_url=False)[:_ERRORS_LOOKED_AT]
    # Of a list pydantic counts the items that are right, so that one with a wrong item may seem too short as well.
    wrong = [
        item
        for item in items
        if item["type"] != "too_short" or not any(_is_below(other["loc"], item["loc"]) for other in items)
    ]
    found = [error_at(sentence(item), item["loc"], root, file) for item in wrong]
    return min(found, key=lambda item: (item.source is None, item.line or 0))


def _is_below(path: Path, above: Path) -> bool:
    return len(path) > len(above) and path[: len(above)] == above
