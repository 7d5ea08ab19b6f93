"""Parse a YAML text to a tree of nodes.

YAML 1.2's core schema with what scenes and lenses need made safe: `1e-3` is a number, `on`, `yes` and `1:30` are
strings, `inf` and `.inf` are infinite; tags, duplicate keys, several documents and expanding aliases are refused.

References: YAML Ain't Markup Language 1.2.2, section 10.3 (core schema); https://yaml.org/type/merge.html
"""

import io
import itertools
import math
import re
import sys
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import IO, Any

import yaml

from raytracer.schema.yaml_nodes import MAX_DEPTH, MAX_DIGITS, Node, SourceLocation, collection
from raytracer.util.errors import SceneError, closest_name, format_value, suggest_name
from raytracer.util.safe_open import open_regular

STANDARD_INPUT = "-"
"""The name that stands for what is piped into the program."""

MAX_BYTES = 64 * 2**20
MAX_VALUES = 1_000_000
MAX_EXPANDED = 1_000_000

_INTEGER = re.compile(r"[-+]?[0-9]+")
_PREFIXED = re.compile(r"0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?")
_INFINITE = re.compile(r"([-+]?)\.?(?:inf|Inf|INF)")
_WORDS: dict[str, bool | float | None] = dict.fromkeys(("", "~", "null", "Null", "NULL"))
_WORDS |= dict.fromkeys(("true", "True", "TRUE"), True) | dict.fromkeys(("false", "False", "FALSE"), False)
_WORDS |= dict.fromkeys((".nan", ".NaN", ".NAN"), math.nan)
_CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f]")

# libyaml where PyYAML was built with it: six times as fast.
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


def scalar(text: str) -> Any:
    """Convert a plain scalar to its value by the core schema."""
    if text in _WORDS:
        return _WORDS[text]
    if text[0] not in "+-.0123456789iI":
        return text
    if _INTEGER.fullmatch(text):
        # Python refuses to convert integers of thousands of digits; as a float such a one is infinite.
        return int(text) if len(text) < MAX_DIGITS else float(text)
    if _FLOAT.fullmatch(text):
        return float(text)
    if _PREFIXED.fullmatch(text):
        return int(text, 0) if len(text) < MAX_DIGITS else math.inf
    if match := _INFINITE.fullmatch(text):
        return float(match[1] + "inf")
    return text


class _Composer:
    """Composer of the tree of nodes from the parser's events."""

    def __init__(self, text: str, file: str, option: str | None) -> None:
        self._text_given = text
        self._file = file
        self._option = option
        try:
            self._parser = _LOADER(text)
        except UnicodeEncodeError:
            # An option holds the bytes that the terminal sent, which may not be valid.
            raise SceneError("is not valid Unicode", file=file or None, source=option) from None
        self._anchors: dict[str, Node | None] = {}
        self._literal = 0
        self._last = SourceLocation(0)

    def compose(self) -> Node | None:
        """Compose the tree of the one document; None for an empty text."""
        self._next()
        event = self._next()
        if isinstance(event, yaml.StreamEndEvent):
            return None
        root = self._node(self._next(), 1)
        self._next()
        event = self._next()
        if isinstance(event, yaml.DocumentStartEvent):
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
            # The library has a limit of its own, which it may meet first as it reads ahead.
            if error.problem == "exceeded maximum nesting depth":
                message = f"is nested more than {MAX_DEPTH} levels deep"
                raise SceneError(message, file=self._file, line=line, source=self._option) from None
            hint = "; a space goes after the dash of a list" if self._has_tight_dash(line) else ""
            raise SceneError(_syntax(error, line) + hint, file=self._file, line=line, source=self._option) from None
        except yaml.reader.ReaderError as error:
            given = error.character
            character = chr(given) if isinstance(given, int) else given
            message = f"holds the control character {character!r}"
            raise SceneError(message, file=self._file or None, source=self._option) from None

    def _has_tight_dash(self, line: int) -> bool:
        """Tell if a line, or the one before, begins with a dash and no space."""
        lines = itertools.islice(io.StringIO(self._text_given), max(line - 2, 0), line)
        return any(re.match(r"\s*-[\w{\[\"']", text) for text in lines)

    def _place(self, event: Any) -> SourceLocation:
        # Nodes on one line share their location, which saves half of all objects.
        line = event.start_mark.line + 1
        if line != self._last.line:
            self._last = SourceLocation(line, self._option)
        return self._last

    def _node(self, event: Any, depth: int) -> Node:
        if depth > MAX_DEPTH:
            raise self.error(event, f"is nested more than {MAX_DEPTH} levels deep")
        if isinstance(event, yaml.AliasEvent):
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
        if isinstance(event, yaml.ScalarEvent):
            node = Node(self._place(event), scalar(self._text(event)) if event.implicit[0] else self._text(event))
        elif isinstance(event, yaml.SequenceStartEvent):
            node = self._list(event, depth)
        else:
            node = self._mapping(event, depth)
        if event.anchor is not None:
            self._anchors[event.anchor] = node
        if node.size > MAX_EXPANDED + self._literal:
            raise self.error(event, f"aliases expand to more than {MAX_EXPANDED:,} values")
        return node

    def _text(self, event: Any) -> str:
        """Return the text of a scalar, without control characters, which a terminal would act upon."""
        text: str = event.value
        if not event.implicit[0] and (match := _CONTROL.search(text)):
            raise self.error(event, f"holds the control character {match[0]!r}")
        return text

    def _alias(self, event: Any, depth: int) -> Node:
        if event.anchor not in self._anchors:
            hint = suggest_name(event.anchor, self._anchors, "anchors")
            raise self.error(event, f"the alias *{event.anchor} has no anchor before it; {hint}")
        node = self._anchors[event.anchor]
        if node is None:
            raise self.error(event, f"the alias *{event.anchor} stands inside what it names")
        if depth + node.depth - 1 > MAX_DEPTH:
            raise self.error(event, f"is nested more than {MAX_DEPTH} levels deep")
        return node

    def _list(self, start: yaml.SequenceStartEvent, depth: int) -> Node:
        items = []
        while not isinstance(event := self._next(), yaml.SequenceEndEvent):
            items.append(self._node(event, depth + 1))
        return collection(self._place(start), items=tuple(items))

    def _mapping(self, start: yaml.MappingStartEvent, depth: int) -> Node:
        entries: dict[str, tuple[SourceLocation, Node]] = {}
        merged: list[Node] = []
        while not isinstance(event := self._next(), yaml.MappingEndEvent):
            if not isinstance(event, yaml.ScalarEvent) or event.tag is not None:
                raise self.error(event, "a key must be a plain string")
            key, place = self._text(event), self._place(event)
            node = self._node(self._next(), depth + 1)
            if key == "<<" and event.implicit[0]:
                # Each merges all keys of what it names, and a line of a file that names it is short.
                if merged:
                    raise self.error(event, "<< is given twice; it takes a list of mappings")
                merged.extend(self._merged(event, node))
            elif key in entries:
                first = f" on line {entries[key][0].line}" if self._option is None else ""
                raise self.error(event, f"the key {format_value(key)} is given twice, first{first or ' before'}")
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
    """Describe a syntax error as the end of a sentence."""
    problem = error.problem or "cannot be read"
    if "cannot start any token" in problem:
        return "not valid YAML: a character that cannot start a value (a tab, perhaps: YAML indents with spaces)"
    start = error.context_mark.line + 1 if error.context_mark else line
    context = f" {error.context}" if error.context else ""
    where = f" that starts on line {start}" if context and start != line else ""
    return f"not valid YAML: {problem}{context}{where}"


def parse(text: str, file: str, option: str | None = None) -> Node | None:
    """Parse a YAML text to a tree of nodes; None where it holds nothing.

    text: The YAML text.
    file: Name by which errors call the file.
    option: Option of the command line that gave the text, where it did not come from a file.

    Raises
    ------
    SceneError: the text is not one YAML document of plain values, or is too deep, or its aliases expand too far.
    """
    return _Composer(text, file, option).compose()


def _open(file: str, named: Path) -> AbstractContextManager[IO[bytes]]:
    """Open a file, or standard input; never wait for a name with a suffix: a shell's pipe (/dev/fd/63) has none."""
    if file == STANDARD_INPUT:
        return nullcontext(sys.stdin.buffer)
    return open_regular(named, sys.maxsize) if named.suffix else named.open("rb")


def read(file: str, noun: str = "scene") -> str:
    """Read the text of a file that holds a scene, or another `noun`; `-` is standard input.

    Raises
    ------
    SceneError: the file does not exist, cannot be read, is too large, or is not UTF-8.
    """
    try:
        named = Path(file)
        with _open(file, named) as stream:
            data = stream.read(MAX_BYTES + 1)
    except FileNotFoundError:
        hint = f"; did you mean {meant}?" if (meant := _near_file(named, noun)) else ""
        raise SceneError(f"no such file{hint}", file=file) from None
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


def _near_file(missing: Path, noun: str) -> Path | None:
    """Find the file that a name was probably meant for: with its suffix, in the folder of its kind, or spelt alike."""
    for folder in (missing.parent, Path(f"{noun}s") / missing.parent):
        for name in (missing.name, f"{missing.name}.yaml", f"{missing.stem}.yaml"):
            if (folder / name).is_file():
                return folder / name
    close = closest_name(missing.name, (found.name for found in missing.parent.glob("*.yaml")))
    return missing.parent / close if close else None
