"""The JSON Schema of scene files and lens files, for editors (draft 2020-12)."""

import functools
from collections.abc import Iterator
from typing import Any

from raytracer.lenses.prescription import LensSpec
from raytracer.scene.spec import SceneSpec

DIALECT = "https://json-schema.org/draft/2020-12/schema"


@functools.cache
def schema() -> dict[str, Any]:
    """The JSON Schema of a scene file, with every key's description, unit, default and range; not to be changed."""
    result = SceneSpec.model_json_schema(mode="validation")
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
    """The JSON Schema of a lens file, likewise."""
    return _finished(LensSpec.model_json_schema(mode="validation"), "rt lens")


def _finished(schema: dict[str, Any], title: str) -> dict[str, Any]:
    """A schema as pydantic makes it, with what editors need; it is changed."""
    for node in _mappings(schema):
        # A kind is told by its type, so that cannot be left out although it has a default.
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
    """Every mapping in a tree of lists and mappings."""
    if isinstance(node, dict):
        yield node
    for below in node.values() if isinstance(node, dict) else node if isinstance(node, list) else ():
        yield from _mappings(below)


def _unit(node: dict[str, Any]) -> str | None:
    """The unit of a property's plain numbers."""
    return node.get("x-unit") or next((unit for choice in node.get("anyOf", ()) if (unit := _unit(choice))), None)
