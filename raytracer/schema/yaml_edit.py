"""Change values in the text of a YAML file: each byte that is not of the value stays as it is."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import yaml

from raytracer.schema.yaml_nodes import Node, SourceLocation, node_of, override
from raytracer.schema.yaml_parser import parse, scalar
from raytracer.util.errors import InputError


class _Change(NamedTuple):
    """A change of a text: characters from `begin` to `end` become `text`."""

    begin: int
    end: int
    text: str


def edit_values(text: str, changes: Mapping[tuple[str, ...], Any], file: str) -> str:
    """Set values at paths of keys of mappings; a value of None takes its key out.

    A value that is there is replaced where it stands; a key that is not is added to its mapping, in front.  A key that
    is taken out gives its place to one of the same mapping that is added, if there is one.

    Raises
    ------
    InputError : the text says it in a way, by an alias or a merge, that cannot be changed in place.
    """
    wanted, result = parse(text, file), text
    for parent in dict.fromkeys(tuple(path[:-1]) for path in changes):
        values = {path[-1]: value for path, value in changes.items() if tuple(path[:-1]) == parent}
        result = _edit_mapping(result, parent, values, file)
    for path, value in changes.items():
        if wanted is not None:
            wanted = override(wanted, path, node_of(value, SourceLocation(0)))
    if _without_none(parse(result, file)) != _without_none(wanted):
        raise InputError(f"{file}: {'.'.join(next(iter(changes)))} is said by an alias; change it by hand")
    return result


def _without_none(root: Node | None) -> Any:
    """Convert a tree to plain values without keys of nothing."""

    def clean(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: clean(item) for key, item in value.items() if item is not None}
        return [clean(item) for item in value] if isinstance(value, list) else value

    return None if root is None else clean(root.plain())


def _edit_mapping(text: str, parent: Sequence[str], values: Mapping[str, Any], file: str) -> str:
    """Set values of one mapping of a text."""
    node = yaml.compose(text, yaml.SafeLoader)
    for key in parent:
        node = _entries(node).get(key, (None, None))[1]
    if not isinstance(node, yaml.MappingNode):
        raise InputError(f"{file}: {'.'.join(parent)} is no mapping to write to")
    entries = _entries(node)
    added = {key: value for key, value in values.items() if key not in entries and value is not None}
    changes = []
    for key, value in values.items():
        if key not in entries:
            continue
        name, old = entries[key]
        if value is not None:
            changes.append(_Change(old.start_mark.index, _end(text, old), _scalar(value)))
        elif added:
            # The new key says in its place what the old one said.
            new = next(iter(added))
            changes.append(_Change(name.start_mark.index, _end(text, old), f"{new}: {_scalar(added.pop(new))}"))
        else:
            changes.append(_Change(*_removal(text, node, key), ""))
    for key, value in added.items():
        changes.append(_insertion(text, node, f"{key}: {_scalar(value)}"))
    for change in sorted(changes, reverse=True):
        text = text[: change.begin] + change.text + text[change.end :]
    return text


def _entries(node: Any) -> dict[str, tuple[Any, Any]]:
    """Return the keys of a mapping with the nodes of key and value."""
    return {key.value: (key, value) for key, value in node.value} if isinstance(node, yaml.MappingNode) else {}


def _end(text: str, node: Any) -> int:
    """Return where the text of a value ends, without what follows a block."""
    return len(text[: node.end_mark.index].rstrip())


def _insertion(text: str, node: Any, entry: str) -> _Change:
    """Add an entry in front of the first of a mapping."""
    if not node.value:
        begin = node.start_mark.index + 1
        return _Change(begin, begin, entry)
    first = node.value[0][0].start_mark
    newline = "\r\n" if "\r\n" in text else "\n"
    between = ", " if node.flow_style else newline + " " * first.column
    return _Change(first.index, first.index, entry + between)


def _removal(text: str, node: Any, key: str) -> tuple[int, int]:
    """Find the characters to take out with a key: those up to the next one, or from the end of the one before."""
    keys = [name.value for name, _ in node.value]
    at = keys.index(key)
    name, value = node.value[at]
    if at + 1 < len(keys):
        return name.start_mark.index, node.value[at + 1][0].start_mark.index
    begin = _end(text, node.value[at - 1][1]) if at else name.start_mark.index
    return begin, _end(text, value)


def _scalar(value: Any) -> str:
    """Write a number or a name as YAML."""
    if isinstance(value, float):
        return repr(value).removesuffix(".0") if value not in (float("inf"), float("-inf")) else f"{value}"
    if isinstance(value, str):
        # Quoted where a plain word would be something else, in YAML 1.1 or in the core schema.
        plain = str(yaml.safe_dump(value)).removesuffix("\n").removesuffix("\n...")
        return plain if scalar(plain) == value else "'" + value.replace("'", "''") + "'"
    return str(value)
