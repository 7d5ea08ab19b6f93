"""Write docs/scenes.md, the reference of scene files, from their schema: `make docs`.

What it says of a key is the key's own description in the code, so the reference cannot fall behind it; a test compares
the two.
"""

import json
import re
import sys
import textwrap
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from raytracer.kinds import CAMERAS, ENVIRONMENTS, FILTERS, LIGHTS, MATERIALS, SHAPES, Family
from raytracer.scene.schema import schema
from raytracer.scene.spec import Film, Render, SceneSpec
from raytracer.spec import ObjectSpec, Rotate, Spec, Step

OUTPUT = Path(__file__).with_name("scenes.md")

INTRODUCTION = """\
# Scene files

Made by `make docs` from the schema of scene files; change the descriptions in the code instead.

A scene is one YAML file. This is a whole one:

```yaml
camera: {type: thin_lens, look_from: [3, 2, 5], look_at: [0, 1, 0], vfov: 30, aperture: 80 mm}
film: {width: 640, height: 360}
render: {spp: 128, max_depth: 20}
environment: {type: gradient}
materials:
  clay: {type: lambertian, albedo: [0.7, 0.4, 0.3]}
objects:
  - {type: sphere, center: [0, -1000, 0], radius: 1000, material: {type: lambertian, albedo: 0.5}}
  - {type: sphere, name: ball, center: [0, 1, 0], radius: 1, material: clay}
```

`rt validate SCENE` checks a file, `rt explain SCENE` says what it will make the program do, and `rt schema` prints the
JSON Schema with which an editor completes keys and marks mistakes.

## Rules

- **Units.** World lengths are metres, lengths of optics millimetres, angles degrees, times seconds. Any number may
  carry its unit, `50 mm`, `0.3 rad`, `8 ms`, or be a fraction, `1/3`. Radiance is W/(m2 sr), or plain numbers as in
  *Ray Tracing in One Weekend*.
- **Vectors** are lists of three numbers. Colours too; one number stands for three equal ones.
- **Axes.** Right-handed, column vectors. The rows of a picture run downwards from the top left pixel.
- **Sides.** A surface has an outside, to which its normal points: outwards from spheres and boxes, to the side of u x v
  from a quad, to the side from which the vertices run anticlockwise from triangles and meshes.
- **YAML 1.2**, with anchors, aliases and `<<`. `yes`, `no`, `on` and `off` are texts; `1e-3` is a number. Tags, and
  several documents in a file, are refused.
- **Mistakes** are named by file, line and key: unknown keys (with the nearest known one), keys given twice, values of a
  wrong type, unit or range, names of materials that there are not, files that there are not.
- **Files** named in a scene are relative to the scene's folder.
- **Overrides.** `-D camera.vfov=30` puts a value in place of the file's, in YAML; `-D objects.ball.radius=2` finds an
  object by its name, `-D objects[0].radius=2` by its number.
- **Nothing for nothing.** What a scene does not ask for is not in the compiled program: an aperture of 0 is a pinhole,
  a black environment is none, and a material that no object has is left out.
"""

FAMILIES: tuple[tuple[str, str, Family], ...] = (
    ("Cameras", "The value of `camera`.", CAMERAS),
    ("Filters", "The value of `film.filter`: a mapping, or the type alone where the defaults will do.", FILTERS),
    ("Environments", "The value of `environment`.", ENVIRONMENTS),
    ("Materials", "Values of `materials`, by name; or the value of an object's `material`.", MATERIALS),
    ("Shapes", "Items of `objects`. Each may have the keys of [objects](#objects) besides its own.", SHAPES),
    ("Lights", "Items of `lights`.", LIGHTS),
)


def values(node: Mapping[str, Any]) -> str:
    """What a property of the schema may be, in a few words."""
    if "enum" in node:
        return " \\| ".join(f"`{value}`" for value in node["enum"])
    if "const" in node:
        return f"`{node['const']}`"
    if "$ref" in node or "oneOf" in node:
        return "mapping"
    if "prefixItems" in node:
        return f"list of {len(node['prefixItems'])}"
    if node.get("type") == "array":
        count = node.get("maxItems")
        return {3: "vector", None: "list"}.get(count, f"list of {count}")
    if "anyOf" in node:
        found = [values(choice) for choice in node["anyOf"] if "pattern" not in choice and choice.get("type") != "null"]
        return " or ".join(dict.fromkeys(found))
    names = {"boolean": "true or false", "integer": "whole number", "string": "text", "object": "mapping"}
    return names.get(node.get("type", ""), node.get("type", "any"))


def cell(text: str) -> str:
    """Text on one line, with nothing that would end a table's cell."""
    return re.sub(r"(?<!\\)\|", r"\\|", " ".join(text.split()))


def meaning(node: Mapping[str, Any]) -> str:
    """A property's description, with its unit in it once."""
    description = str(node.get("description", ""))
    text, bracket, unit = description.partition(" [")
    if bracket and unit.endswith(", or with a unit]"):
        return text if re.search(r"\((m|mm|deg|s)\)", text) else f"{text} ({unit.split(',')[0]})"
    return description


def default(key: str, node: Mapping[str, Any], spec: type[Spec]) -> str:
    """What stands where the key is not given."""
    if spec.model_fields[key].is_required():
        return "needed"
    value = node.get("default")
    if value is None or isinstance(value, dict):
        return ""
    return f"`{json.dumps(round(value, 4) if isinstance(value, float) else value)}`".replace(".0", "")


def table(spec: type[Spec], node: Mapping[str, Any], leave_out: frozenset[str] = frozenset()) -> Iterator[str]:
    """The keys of a mapping."""
    properties = {key: below for key, below in node["properties"].items() if key not in leave_out}
    if not properties:
        yield "It has no keys of its own.\n"
        return
    yield "| key | value | default | meaning |\n|---|---|---|---|"
    for key, below in properties.items():
        yield f"| `{key}` | {values(below)} | {default(key, below, spec)} | {cell(meaning(below))} |"
    yield ""


def words(docstring: str | None) -> str:
    """A docstring's text with its references in italics."""
    text = textwrap.dedent("    " + (docstring or "")).strip()
    paragraphs = [" ".join(paragraph.split()) for paragraph in text.split("\n\n")]
    return "\n\n".join(f"*{part}*" if part.startswith("References:") else part for part in paragraphs)


def snippet(docstring: str | None) -> str:
    """The indented part of a kind's module docstring: a piece of a scene.

    Raises
    ------
    ValueError : the docstring holds none.
    """
    lines = [line for line in (docstring or "").splitlines() if line.startswith("    ")]
    if not lines:
        raise ValueError("the docstring of a kind's module must hold an indented piece of a scene")
    return textwrap.dedent("\n".join(lines))


def kind(name: str, spec: type[Spec], base: frozenset[str]) -> Iterator[str]:
    """The section of one kind."""
    yield f"### {name}\n"
    yield words(spec.__doc__) + "\n"
    yield f"```yaml\n{snippet(sys.modules[spec.__module__].__doc__)}\n```\n"
    yield from table(spec, definition(spec), base | {"type"})


def definition(spec: type[Spec]) -> Mapping[str, Any]:
    """The spec's part of the whole schema, with units in its descriptions."""
    definitions = schema()["$defs"]
    name = spec.__name__ if spec.__name__ in definitions else f"{spec.__module__}.{spec.__name__}".replace(".", "__")
    found: Mapping[str, Any] = definitions[name]
    return found


def reference() -> str:
    """The text of docs/scenes.md."""
    parts = [INTRODUCTION, "## The file\n"]
    parts += table(SceneSpec, schema())
    for title, spec in (("film", Film), ("render", Render)):
        parts += [f"### {title}\n", words(spec.__doc__) + "\n", *table(spec, definition(spec))]

    # Keys that every object has, from any of the shapes.
    common = frozenset(ObjectSpec.model_fields)
    shape = next(iter(SHAPES.specs().values()))
    parts += ["### objects\n", "Every object may have these keys; those of its shape are [below](#shapes).\n"]
    parts += table(shape, definition(shape), frozenset(shape.model_fields) - common)
    parts += ["A step of a transform is one of:\n", *table(Step, definition(Step))]
    parts += ["and `rotate` holds:\n", *table(Rotate, definition(Rotate))]

    for title, introduction, family in FAMILIES:
        if specs := family.specs():
            parts += [f"## {title}\n", introduction + "\n"]
            for name, spec in specs.items():
                parts += kind(name, spec, common if family is SHAPES else frozenset())
    return "\n".join(parts).rstrip() + "\n"


if __name__ == "__main__":
    OUTPUT.write_text(reference(), encoding="utf-8")
