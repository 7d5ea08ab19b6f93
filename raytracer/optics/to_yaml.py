"""Conversion of a checked scene or lens to plain values and to YAML, from which an equal one is read."""

from collections.abc import Mapping
from functools import cache
from typing import Any

import yaml

from raytracer.optics.glass import Glass
from raytracer.schema.spec import Spec
from raytracer.schema.transform import Transform
from raytracer.schema.yaml_parser import scalar

_FIRST = ("type", "name")

_MAX_EXACT_INTEGER = 2.0**53

_WIDTH = 120
_INDENT = 4

# libyaml where PyYAML was built with it.
_DUMPER = getattr(yaml, "CSafeDumper", yaml.SafeDumper)


def spec_to_plain(spec: Spec) -> dict[str, Any]:
    """Convert a scene to dicts, lists, strings, numbers, bools and None; `load.build_plain` makes an equal one of them.

    Keys that were not set are left out; numbers are in the units that plain numbers of a scene have.  The result is
    what the checked scene holds, overrides and changes in code included, whatever file it was loaded from.
    """
    return {key: value_to_plain(getattr(spec, key)) for key in type(spec).model_fields if key in spec.model_fields_set}


def value_to_plain(value: Any) -> Any:
    """Convert a part of a scene as `spec_to_plain` does."""
    if isinstance(value, Spec):
        # A kind always has its type.
        given = value.model_fields_set | {"type"}
        return {key: value_to_plain(getattr(value, key)) for key in _order(type(value)) if key in given}
    if isinstance(value, Transform):
        return (
            [value_to_plain(step) for step in value.steps] if value.matrix is None else {"matrix": _list(value.matrix)}
        )
    if isinstance(value, Glass):
        return value_to_plain(value.to_plain())
    if isinstance(value, tuple | list):
        return _list(value)
    if isinstance(value, Mapping):
        return {key: value_to_plain(item) for key, item in value.items()}
    return value


def _list(values: Any) -> list[Any]:
    return [value if type(value) is float else value_to_plain(value) for value in values]


@cache
def _order(kind: type[Spec]) -> list[str]:
    """List the keys of a kind, in the order in which they are written: type and name first."""
    keys = kind.own_keys_first()
    return [key for key in _FIRST if key in keys] + [key for key in keys if key not in _FIRST]


# ---- YAML

_LISTED = ("textures", "materials", "media", "groups", "objects", "lights", "surfaces")


class _Representer(yaml.representer.SafeRepresenter):
    """Writer of what `yaml_parser.parse` reads, the core schema of YAML 1.2; what fits on a line is on one."""

    def ignore_aliases(self, data: Any) -> bool:
        return True

    def represent_sequence(self, tag: str, sequence: Any, flow_style: bool | None = None) -> Any:
        return _folded(super().represent_sequence(tag, sequence, flow_style))

    def represent_mapping(self, tag: str, mapping: Any, flow_style: bool | None = None) -> Any:
        return _folded(super().represent_mapping(tag, mapping, flow_style))

    def text(self, text: str) -> Any:
        # PyYAML quotes what YAML 1.1 would take for another type than a string, and 1.2 differs.
        is_string = text != text.strip() or isinstance(scalar(text), str)
        return self.represent_scalar("tag:yaml.org,2002:str", text, style=None if is_string else "'")

    def number(self, number: float) -> Any:
        # People write integers; a scene reads them as the same numbers.
        if number.is_integer() and abs(number) < _MAX_EXACT_INTEGER and str(number) != "-0.0":
            return self.represent_int(int(number))
        return self.represent_float(number)


_Representer.add_representer(str, _Representer.text)
_Representer.add_representer(float, _Representer.number)


def _folded(node: Any) -> Any:
    """Set a list or mapping on one line if it fits."""
    parts = (part for pair in node.value for part in (pair if isinstance(pair, tuple) else (pair,)))
    node.flow_style = 2 + sum(map(_length, parts)) <= _WIDTH - 2 * _INDENT
    return node


def _length(node: Any) -> int:
    """Estimate the characters of a node on its line; those of a whole line if it takes several."""
    if isinstance(node, yaml.ScalarNode):
        return len(node.value) + 2
    if not node.flow_style:
        return _WIDTH
    return 2 + sum(_length(part) for pair in node.value for part in (pair if isinstance(pair, tuple) else (pair,)))


def to_yaml(plain_scene: Mapping[str, Any]) -> str:
    """Write plain values as YAML, from which every float64 is read as it was."""
    representer = _Representer(default_flow_style=True, sort_keys=False)
    root = representer.represent_mapping("tag:yaml.org,2002:map", plain_scene)
    root.flow_style = False
    for key, node in root.value:
        if key.value in _LISTED and node.value:
            node.flow_style = False
    text: str = yaml.serialize(root, Dumper=_DUMPER, allow_unicode=True, width=2 * _WIDTH)
    return text
