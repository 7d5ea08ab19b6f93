"""The JSON Schema of scene files and lens files, for editors (draft 2020-12)."""

import functools
import re
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from pydantic.json_schema import GenerateJsonSchema

from raytracer.optics.lens_system.prescription import LensSpec
from raytracer.optics.to_yaml import value_to_plain
from raytracer.scene.spec import SceneSpec
from raytracer.schema.spec import Spec

_HAS_UNIT = re.compile(r"\((m|mm|nm|deg|s|Hz|m/s|deg/s)[;)]")

DIALECT = "https://json-schema.org/draft/2020-12/schema"


class _Generator(GenerateJsonSchema):
    """Generator that writes defaults as a file would, glasses by name or index too."""

    def encode_default(self, dft: Any) -> Any:
        return super().encode_default(value_to_plain(dft))


@functools.cache
def scene_schema() -> dict[str, Any]:
    """Make the JSON Schema of a scene file, with every key's description, unit, default and range; do not change it."""
    result = SceneSpec.model_json_schema(mode="validation", schema_generator=_Generator)
    definitions = result["$defs"]

    # An object takes a material in place of a material's name.
    definitions["Material"] = result["properties"]["materials"]["additionalProperties"]
    result["properties"]["materials"]["additionalProperties"] = {"$ref": "#/$defs/Material"}
    for definition in definitions.values():
        if "material" in definition.get("properties", {}):
            choices = [{"type": "string"}, {"$ref": "#/$defs/Material"}, {"type": "null"}]
            definition["properties"]["material"] |= {"anyOf": choices}

    # And a material a texture in place of a texture's name.
    definitions["Texture"] = result["properties"]["textures"]["additionalProperties"]
    result["properties"]["textures"]["additionalProperties"] = {"$ref": "#/$defs/Texture"}

    for node in _mappings(result):
        if node.pop("x-texture", False):
            node["$ref"] = "#/$defs/Texture"
    return _finished(result, "rt scene")


@functools.cache
def lens_schema() -> dict[str, Any]:
    """Make the JSON Schema of a lens file, with every key's description, unit, default and range; do not change it."""
    return _finished(LensSpec.model_json_schema(mode="validation", schema_generator=_Generator), "rt lens")


def definition_name(spec: type[Spec]) -> str:
    """Return the name of a class of mappings among the schema's definitions."""
    is_alone = spec.__name__ in scene_schema()["$defs"]
    return spec.__name__ if is_alone else f"{spec.__module__}.{spec.__name__}".replace(".", "__")


def properties_of(spec: type[Spec]) -> Mapping[str, Any]:
    """Return the schemas of the keys of a class of mappings of a scene, with units in their descriptions."""
    whole = scene_schema()
    definition = whole if spec is SceneSpec else whole["$defs"][definition_name(spec)]
    properties: Mapping[str, Any] = definition["properties"]
    return properties


def description_with_unit(node: Mapping[str, Any]) -> str:
    """Return the description of a property, with its unit in it once."""
    description = str(node.get("description", ""))
    text, bracket, unit = description.partition(" [")
    if bracket and unit.endswith(", or with a unit]"):
        return text if _HAS_UNIT.search(text) else f"{text} ({unit.split(',')[0]})"
    return description


def _finished(schema: dict[str, Any], title: str) -> dict[str, Any]:
    """Complete a schema of pydantic with what editors need, in place."""
    for node in _mappings(schema):
        # The type tells a kind, so it is required although it has a default.
        properties = node.get("properties", {})
        if "const" in properties.get("type", {}):
            node["required"] = ["type", *(key for key in node.get("required", []) if key != "type")]

        # Units join the descriptions, where editors show them.
        for described in properties.values():
            if unit := _unit(described):
                text = described.get("description", "").rstrip(".")
                described["description"] = f"{text} [{unit}, or with a unit]".strip()
        node.pop("discriminator", None)
    return {"$schema": DIALECT, **schema, "title": title}


def _mappings(node: Any) -> Iterator[dict[str, Any]]:
    """Walk through every mapping in a tree of lists and mappings."""
    if isinstance(node, dict):
        yield node
    for below in node.values() if isinstance(node, dict) else node if isinstance(node, list) else ():
        yield from _mappings(below)


def _unit(node: dict[str, Any]) -> str | None:
    """Find the unit of a property's plain numbers."""
    return node.get("x-unit") or next((unit for choice in node.get("anyOf", ()) if (unit := _unit(choice))), None)


# ---- Mappings within others


class Form(NamedTuple):
    """A mapping that a value may be or hold.

    path : to it, from its key on.
    node : its schema.
    name : of its definition; None if it stands in none.
    """

    path: str
    node: Mapping[str, Any]
    name: str | None

    @property
    def is_kind(self) -> bool:
        """Tell whether it is a kind of a family, which its `type` names."""
        return "const" in self.node["properties"].get("type", {})


def forms_of(whole: Mapping[str, Any], node: Mapping[str, Any], path: str, name: str | None = None) -> Iterator[Form]:
    """Go through the mappings that a value may be, or be a list or a mapping of."""
    if "properties" in node:
        yield Form(path, node, name)
    elif "$ref" in node:
        below = node["$ref"].rpartition("/")[2]
        yield from forms_of(whole, whole["$defs"][below], path, below)
    for choice in (*node.get("anyOf", ()), *node.get("oneOf", ())):
        yield from forms_of(whole, choice, path)
    for key, mark in (("items", "[]"), ("additionalProperties", ".NAME")):
        if isinstance(node.get(key), Mapping) and "properties" not in node:
            yield from forms_of(whole, node[key], path + mark)
    for item in node.get("prefixItems", ()):
        yield from forms_of(whole, item, f"{path}[]")
