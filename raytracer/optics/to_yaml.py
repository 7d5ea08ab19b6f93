"""From a checked scene or lens back to plain values, and to YAML, which read as an equal one."""

from collections.abc import Mapping
from functools import cache
from typing import Any

import yaml

from raytracer.document import scalar
from raytracer.glass import Glass
from raytracer.spec import Spec, Transform

_FIRST = ("type", "name")

_LARGEST_WHOLE = 2.0**53

_WIDTH = 120
_INDENT = 4

# libyaml where PyYAML was built with it.
_DUMPER = getattr(yaml, "CSafeDumper", yaml.SafeDumper)


def plain(spec: Spec) -> dict[str, Any]:
    """A scene as dicts, lists, texts, numbers, bools and None, from which `load.build_plain` makes an equal one.

    Keys that were not set are left out; numbers are in the units that plain numbers of a scene have.  It says what the
    checked scene holds, overrides and changes in code included, whatever file it was loaded from.
    """
    return {key: plain_value(getattr(spec, key)) for key in type(spec).model_fields if key in spec.model_fields_set}


def plain_value(value: Any) -> Any:
    """A part of a scene likewise."""
    if isinstance(value, Spec):
        return {key: plain_value(getattr(value, key)) for key in _keys(value)}
    if isinstance(value, Transform):
        return [plain_value(step) for step in value.steps] if value.matrix is None else {"matrix": _list(value.matrix)}
    if isinstance(value, Glass):
        return plain_value(value.written())
    if isinstance(value, tuple | list):
        return _list(value)
    if isinstance(value, Mapping):
        return {key: plain_value(item) for key, item in value.items()}
    return value


def _list(values: Any) -> list[Any]:
    return [value if type(value) is float else plain_value(value) for value in values]


def _keys(spec: Spec) -> list[str]:
    """The keys that a mapping was given, what it is first; a kind always tells its type."""
    given = spec.model_fields_set
    return [key for key in _order(type(spec)) if key in given or key == "type"]


@cache
def _order(kind: type[Spec]) -> list[str]:
    """The keys of a kind, in the order in which they are written."""
    keys = kind.own_keys_first()
    return [key for key in _FIRST if key in keys] + [key for key in keys if key not in _FIRST]


# ---- YAML

_LISTED = ("textures", "materials", "media", "groups", "objects", "lights", "surfaces")


class _Representer(yaml.representer.SafeRepresenter):
    """Writes what `document.parse` reads, the core schema of YAML 1.2; what fits into a line is one."""

    def ignore_aliases(self, data: Any) -> bool:
        return True

    def represent_sequence(self, tag: str, sequence: Any, flow_style: bool | None = None) -> Any:
        return _folded(super().represent_sequence(tag, sequence, flow_style))

    def represent_mapping(self, tag: str, mapping: Any, flow_style: bool | None = None) -> Any:
        return _folded(super().represent_mapping(tag, mapping, flow_style))

    def text(self, text: str) -> Any:
        # PyYAML quotes what YAML 1.1 would take for another thing than a text, and 1.2 differs.
        is_text = text != text.strip() or isinstance(scalar(text), str)
        return self.represent_scalar("tag:yaml.org,2002:str", text, style=None if is_text else "'")

    def number(self, number: float) -> Any:
        # Whole numbers are what people write; a scene takes them for the same.
        if number.is_integer() and abs(number) < _LARGEST_WHOLE and str(number) != "-0.0":
            return self.represent_int(int(number))
        return self.represent_float(number)


_Representer.add_representer(str, _Representer.text)
_Representer.add_representer(float, _Representer.number)


def _folded(node: Any) -> Any:
    """A list or mapping, on one line if it fits."""
    parts = (part for pair in node.value for part in (pair if isinstance(pair, tuple) else (pair,)))
    node.flow_style = 2 + sum(map(_length, parts)) <= _WIDTH - 2 * _INDENT
    return node


def _length(node: Any) -> int:
    """Characters of a node on its line, about; as many as a line has if it takes several."""
    if isinstance(node, yaml.ScalarNode):
        return len(node.value) + 2
    if not node.flow_style:
        return _WIDTH
    return 2 + sum(_length(part) for pair in node.value for part in (pair if isinstance(pair, tuple) else (pair,)))


def yaml_text(plain_scene: Mapping[str, Any]) -> str:
    """The YAML text of plain values; every float64 comes out of it as it went in."""
    representer = _Representer(default_flow_style=True, sort_keys=False)
    root = representer.represent_mapping("tag:yaml.org,2002:map", plain_scene)
    root.flow_style = False
    for key, node in root.value:
        if key.value in _LISTED and node.value:
            node.flow_style = False
    text: str = yaml.serialize(root, Dumper=_DUMPER, allow_unicode=True, width=2 * _WIDTH)
    return text
