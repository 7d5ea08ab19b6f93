"""Make tables of the keys of scene files from their schema, for the pages of the reference (`make_scenes.py`).

What they say of a key is the key's own description in the code, so the reference cannot fall behind it.
"""

import functools
import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from raytracer.optics.sensor_formats import SENSORS
from raytracer.optics.thin_lens import crop_factor
from raytracer.scene.json_schema import definition_name, description_with_unit, forms_of, scene_schema
from raytracer.schema.registry import (
    APERTURES,
    CAMERAS,
    ENVIRONMENTS,
    FILTERS,
    LIGHTS,
    MATERIALS,
    MEDIA,
    SHAPES,
    TEXTURES,
    Family,
)
from raytracer.schema.spec import Spec

OUTPUT = Path(__file__).parent / "reference" / "scenes"

MARKED = re.compile(r"^<!-- (\w+)((?: \w+)*) -->\n(.*?)^<!-- end -->\n", re.DOTALL | re.MULTILINE)
"""What is made within pages that are written by hand."""

_MOST_NAMES = 8
"""Names of a catalogue are not listed by every key that takes one."""

FAMILIES: dict[str, Family] = {
    "cameras": CAMERAS,
    "apertures": APERTURES,
    "filters": FILTERS,
    "environments": ENVIRONMENTS,
    "lights": LIGHTS,
    "shapes": SHAPES,
    "materials": MATERIALS,
    "textures": TEXTURES,
    "media": MEDIA,
}


def written_pages() -> list[str]:
    """List the pages that are written by hand, by their paths in the reference."""
    return sorted(path.relative_to(OUTPUT).as_posix() for path in (*OUTPUT.glob("*.md"), *OUTPUT.glob("*/index.md")))


def values(node: Mapping[str, Any]) -> str:
    """Say what a property of the schema may be, in a few words; mappings lead to the table of their keys."""
    if len(node.get("enum", ())) > _MOST_NAMES:
        return "name"
    if "enum" in node:
        return " \\| ".join(f"`{value}`" for value in node["enum"])
    if "const" in node:
        return f"`{node['const']}`"
    if "$ref" in node or "oneOf" in node or "properties" in node:
        return f"[mapping]({target(node)})"
    if "prefixItems" in node:
        return f"list of {len(node['prefixItems'])}"
    if node.get("type") == "array":
        count, items = node.get("maxItems"), node.get("items", {})
        if "[mapping]" in (item := values(items)):
            return f"list of {item}"
        if count != node.get("minItems"):
            return "list" if count is None else f"list of up to {count}"
        return {3: "vector", None: "list"}.get(count, f"list of {count}")
    if "anyOf" in node:
        found = [values(choice) for choice in node["anyOf"] if "pattern" not in choice and choice.get("type") != "null"]
        return " or ".join(dict.fromkeys(found))
    if isinstance(node.get("additionalProperties"), Mapping):
        return f"names, each with {values(node['additionalProperties'])}"
    names = {"boolean": "true or false", "object": "mapping"}
    word = str(node.get("type", "any"))
    return names.get(word, word)


class Nested(NamedTuple):
    """Mappings without a type that a key takes.

    key : the key that is met first.
    places : all such keys, each behind what it is a key of: `camera.shake`, `motion.keyframes[]`.
    forms : the schemas of the mappings, each with `properties`.
    names : their names among the definitions; None for those that stand in no definition.
    """

    key: str
    places: list[str]
    forms: list[Mapping[str, Any]]
    names: list[str | None]


def nested_mappings(whole: Mapping[str, Any]) -> list[Nested]:
    """List the mappings at any depth of a schema that are of no family of kinds, in the order of their keys."""
    by_mark: dict[str, Nested] = {}
    met: set[str] = set()

    def look(owner: str, node: Mapping[str, Any]) -> None:
        for key, below in node["properties"].items():
            forms = list(forms_of(whole, below, key))
            plain = [form for form in forms if not form.is_kind]
            # Forms of one place belong together, such as steps of a transform and its matrix.
            marks = [form.name or json.dumps(form.node, sort_keys=True) for form in plain]
            known = next((by_mark[mark] for mark in marks if mark in by_mark), None)
            if plain and known is None:
                known = Nested(key, [], [], [])
            for mark, form in zip(marks, plain, strict=True):
                assert known is not None
                place = f"{owner}.{form.path}"
                known.places.extend([] if place in known.places else [place])
                if mark not in by_mark:
                    by_mark[mark] = known
                    known.forms.append(form.node)
                    known.names.append(form.name)
                    look(known.key, form.node)
            for form in forms:
                if form.is_kind and form.name is not None and form.name not in met:
                    met.add(form.name)
                    look(form.path, form.node)

    look("scene", whole)
    return list({id(each): each for each in by_mark.values()}.values())


@functools.cache
def nested_by_key() -> Mapping[str, Nested]:
    """Find the mappings that are of no family by the key that each is called after."""
    return {nested.key: nested for nested in nested_mappings(scene_schema())}


@functools.cache
def targets() -> Mapping[str, str]:
    """Find where the keys of each mapping are, by the names of definitions, or by the schema of what is in none.

    Raises
    ------
    ValueError : a mapping has no table on any page.
    """
    found = {"Material": "materials/index.md", "Texture": "textures/index.md"}
    for name, family in FAMILIES.items():
        found |= dict.fromkeys(map(definition_name, family.specs().values()), f"{name}/index.md")
    places = {}
    for page in written_pages():
        text = (OUTPUT / page).read_text(encoding="utf-8")
        for mark in MARKED.finditer(text):
            heading = re.findall(r"^#+ (.*)$", text[: mark.start()], re.MULTILINE)[-1]
            places[mark[2].strip()] = f"{page}#{heading.lower().replace(' ', '-')}"
    for key, nested in nested_by_key().items():
        if key not in places:
            raise ValueError(f"no page of docs/reference/scenes has a table <!-- keys {key} -->")
        for form, defined in zip(nested.forms, nested.names, strict=True):
            found[defined or json.dumps(form)] = places[key]
    return found


def target(node: Mapping[str, Any]) -> str:
    """Find the page and heading where the keys of a mapping are; of several kinds, the page of their family."""
    first = node["oneOf"][0] if "oneOf" in node else node
    return targets()[first["$ref"].rpartition("/")[2] if "$ref" in first else json.dumps(first)]


def cell(text: str) -> str:
    """Text on one line, with nothing that would end a table's cell."""
    return re.sub(r"(?<!\\)\|", r"\\|", " ".join(text.split()))


def default(key: str, node: Mapping[str, Any], spec: type[Spec]) -> str:
    """Format the value that a key has if it is not given."""
    if spec.model_fields[key].is_required():
        return "needed"
    value = node.get("default")
    if value is None or isinstance(value, dict):
        return ""
    text = json.dumps(round(value, 4) if isinstance(value, float) else value)
    return "`" + re.sub(r"(?<=\d)\.0(?!\d)", "", text) + "`"


def formats() -> Iterator[str]:
    """The sensors that have names."""
    yield "| name | width x height (mm) | crop factor |\n|---|---|---|"
    for name, (width, height) in SENSORS.items():
        yield f"| `{name}` | {width:g} x {height:g} | {crop_factor(width, height):.3g} |"
    yield ""


def table(spec: type[Spec] | None, node: Mapping[str, Any], leave_out: frozenset[str] = frozenset()) -> Iterator[str]:
    """Write the table of the keys of a mapping; `spec` is its class, None if it has none."""
    properties = {key: below for key, below in node["properties"].items() if key not in leave_out}
    if not properties:
        yield "It has no keys of its own.\n"
        return
    yield "| key | value | default | meaning |\n|---|---|---|---|"
    for key, below in properties.items():
        usual = "needed" if spec is None else default(key, below, spec)
        yield f"| `{key}` | {values(below)} | {usual} | {cell(description_with_unit(below))} |"
    yield ""


def definition(spec: type[Spec]) -> Mapping[str, Any]:
    """The spec's part of the whole schema, with units in its descriptions."""
    found: Mapping[str, Any] = scene_schema()["$defs"][definition_name(spec)]
    return found


def specs_by_name() -> dict[str, type[Spec]]:
    """Find all classes of mappings of a scene, by what the schema calls them."""
    found, left = {}, [Spec]
    while left:
        left += (spec := left.pop()).__subclasses__()
        found[definition_name(spec)] = spec
    return found
