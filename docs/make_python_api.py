"""Write raytracer/scene/python_api.pyi, by which editors and type checkers know the words of scene files: `make docs`.

It is made of the schema of scene files, as docs/reference/scenes is; a test compares the two.
"""

import inspect
import textwrap
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from raytracer.scene.json_schema import scene_schema
from raytracer.scene.python_api import FAMILIES, parts
from raytracer.schema.registry import type_name
from raytracer.schema.spec import Spec

OUTPUT = Path(__file__).parent.parent / "raytracer" / "scene" / "python_api.pyi"

_WIDTH = 120

_HEAD = """\
# Made by `make docs` from the schema of scene files; change the descriptions in the code instead.
# fmt: off
# ruff: noqa: A001, A002, E501, I001, N802
from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raytracer.schema.registry import Family
from raytracer.plugins.materials.base.interface import MaterialSpec
from raytracer.plugins.textures.base.interface import TextureSpec
"""

_ALIASES = """\
_Numbers: TypeAlias = Sequence[float | str] | NDArray[np.floating[Any] | np.integer[Any]]
_Rows: TypeAlias = Sequence[_Numbers] | NDArray[np.floating[Any] | np.integer[Any]]
_Keys: TypeAlias = Mapping[str, Any]

FAMILIES: dict[str, Family]

def parts() -> dict[str, type[Any]]: ...
"""

_NAMED = {"Material": "MaterialSpec", "Texture": "TextureSpec"}


def _classes() -> dict[str, type[Spec]]:
    """The mappings of a scene, by what they are called here: `Sphere`, and with their noun where two have one name."""
    every = [(word, spec) for word, family in FAMILIES.items() for spec in family.specs().values()]
    every += [("", spec) for spec in parts().values()]
    names = [spec.__name__ for _, spec in every]
    return {
        f"_{word.capitalize()}{spec.__name__}" if names.count(spec.__name__) > 1 else f"_{spec.__name__}": spec
        for word, spec in every
    }


class _Types:
    """Types of Python for those of the schema."""

    def __init__(self, classes: Mapping[str, type[Spec]], definitions: Mapping[str, Any]) -> None:
        self._names = {}
        for name, spec in classes.items():
            full = f"{spec.__module__}.{spec.__name__}".replace(".", "__")
            self._names[full if full in definitions else spec.__name__] = name

    def of(self, node: Mapping[str, Any], *others: str) -> str:
        """Write the Python type of the values that this schema, or others, takes."""
        return " | ".join(_simplified([*self._choices(node), *others]))

    def _choices(self, node: Mapping[str, Any]) -> Iterable[str]:
        for key in ("anyOf", "oneOf"):
            for choice in node.get(key, ()):
                yield from self._choices(choice)
        if "$ref" in node:
            name = node["$ref"].rpartition("/")[2]
            yield from (_NAMED.get(name) or self._names.get(name, ""), "_Keys")
        elif "enum" in node or "const" in node:
            values = node.get("enum", [node.get("const")])
            yield "Literal[" + ", ".join(repr(value).replace("'", '"') for value in values) + "]"
        elif node.get("type") == "array":
            yield self._array(node)
        elif node.get("type") == "object":
            yield "_Keys"
        else:
            plain = {"number": "float", "integer": "int", "string": "str", "boolean": "bool", "null": "None"}
            if node.get("type") in plain:
                yield plain[node["type"]]
            elif "anyOf" not in node and "oneOf" not in node:
                # What has no schema of its own is a material within a material.
                yield from ("str", "MaterialSpec", "_Keys")

    def _array(self, node: Mapping[str, Any]) -> str:
        items = node.get("items") or node.get("prefixItems", [{}])[0]
        inner = set(self._choices(items))
        if inner <= {"float", "int", "str"} and "float" in inner:
            return "_Numbers"
        if inner == {"_Numbers"}:
            return "_Rows"
        return f"Sequence[{' | '.join(_simplified(self._choices(items)))}]"


def _simplified(choices: Iterable[str]) -> list[str]:
    """Each choice once, in order, with None last."""
    found = [choice for choice in dict.fromkeys(choices) if choice]
    if "str" in found:
        found = [choice for choice in found if not choice.startswith('Literal["')]
    return [choice for choice in found if choice != "None"] + [choice for choice in found if choice == "None"]


def _function(name: str, result: str, spec: type[Spec], definition: Mapping[str, Any], types: _Types) -> str:
    properties = definition["properties"]
    required = definition.get("required", ())
    keys = [key for key in spec.own_keys_first() if key != "type" or type_name(spec) is None]
    keys.sort(key=lambda key: key not in required)
    arguments = [
        f"{key}: {types.of(properties[key], *(('PathLike[str]',) if key in spec.loads else ()))}"
        f"{'' if key in required else ' = ...'}"
        for key in keys
    ]
    told = [
        textwrap.fill(f"{key} : {properties[key].get('description', '')}", _WIDTH - 8, subsequent_indent="    ")
        for key in keys
    ]
    text = "\n".join([inspect.cleandoc(spec.__doc__ or ""), *(("", "Parameters", "----------", *told) if told else ())])
    body = textwrap.indent(f'"""{text}\n"""', "    ", lambda line: bool(line.strip()))
    listed = "".join(f"    {argument},\n" for argument in arguments)
    head = f"def {name}(\n    *,\n{listed}) -> {result}:" if arguments else f"def {name}() -> {result}:"
    return f"{head}\n{body}\n"


def stub() -> str:
    """The text of the stub."""
    definitions: Mapping[str, Any] = scene_schema()["$defs"]
    classes = _classes()
    names = {spec: name for name, spec in classes.items()}
    types = _Types(classes, definitions)

    def definition(spec: type[Spec]) -> Mapping[str, Any]:
        full = f"{spec.__module__}.{spec.__name__}".replace(".", "__")
        found: Mapping[str, Any] = definitions[full] if full in definitions else definitions[spec.__name__]
        return found

    imports = sorted(f"from {spec.__module__} import {spec.__name__} as {name}\n" for name, spec in classes.items())
    written = [_HEAD, *imports, "\n", _ALIASES]
    for word, family in FAMILIES.items():
        written.append(f"\nclass _{word.capitalize()}s:\n")
        for kind, spec in family.specs().items():
            function = _function(kind, names[spec], spec, definition(spec), types)
            written.append(textwrap.indent(f"@staticmethod\n{function}", "    "))
    written.append("\n")
    written += [f"{word}: _{word.capitalize()}s\n" for word in FAMILIES]
    written += ["\n" + _function(name, names[spec], spec, definition(spec), types) for name, spec in parts().items()]
    return "".join(written)


if __name__ == "__main__":
    OUTPUT.write_text(stub(), encoding="utf-8", newline="\n")
