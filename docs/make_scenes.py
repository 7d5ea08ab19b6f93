"""Write docs/scenes.md, the reference of scene files, from their schema: `make docs`.

What it says of a key is the key's own description in the code, so the reference cannot fall behind it; a test compares
the two.
"""

import functools
import json
import re
import sys
import textwrap
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from raytracer.optics.sensor_formats import SENSORS
from raytracer.optics.thin_lens import crop_factor
from raytracer.plugins.materials.base.interface import MaterialSpec
from raytracer.plugins.shapes.base.interface import ShapeSpec
from raytracer.scene.json_schema import definition_name, description_with_unit, forms_of, scene_schema
from raytracer.scene.render_settings import Film, Render
from raytracer.scene.spec import SceneSpec
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

`rt validate SCENE` checks a file, `rt explain SCENE` says what it will make the program do, and with `--all` also what
every key is set to and means, at any depth; `rt schema` prints the JSON Schema with which an editor completes keys and
marks mistakes.

## Rules

- **Units.** World lengths are metres, lengths of optics millimetres, angles degrees, times seconds. Any number may
  carry its unit, `50 mm`, `0.3 rad`, `8 ms`, `36 km/h`, `20 turn/s`, or be a fraction, `1/3`. Radiance is W/(m2 sr),
  or plain numbers as in *Ray Tracing in One Weekend*. A number is 0, or of a magnitude between 1e-30 and 1e+30.
- **Vectors** are lists of three numbers. Colours too; one number stands for three equal ones.
- **Axes.** Right-handed, column vectors. The rows of a picture run downwards from the top left pixel.
- **Sides.** A surface has an outside, to which its normal points: outwards from spheres and boxes, to the side of u x v
  from a quad, to the side from which the vertices run anticlockwise from triangles and meshes.
- **YAML 1.2**, with anchors, aliases and `<<`. `yes`, `no`, `on` and `off` are strings; `1e-3` is a number. Tags, and
  several documents in a file, are refused.
- **Mistakes** are named by file, line and key: unknown keys (with the nearest known one), keys given twice, values of a
  wrong type, unit or range, names of materials that there are not, files that there are not.
- **Files** named in a scene are relative to the scene's folder, and lie in it: a name that leads out of it, by `..`,
  by a link or as an absolute one, is refused, be the file there or not. So is what is no regular file. A folder at or
  above the scene's that holds a file `.rt-root` takes its place; it may be empty, and counts if it belongs to whom
  the scene's folder does. More is allowed by `--allow-files FOLDER`, which may repeat, by the variable
  `RT_ALLOW_FILES`, a list as PATH is, or by `rt.load(path, allow_files=[...])`. What glTF files name has the same
  bounds. Overrides, and scenes built in Python, name what they like.
- **Limits.** A file has 64 MB, a million values and 64 levels at most, one material is made of 10,000 others at most,
  and a string with a unit has 200 characters. What has more belongs into files: meshes, grids, placements of instances.
- **Overrides.** `-D camera.vfov=30` puts a value in place of the file's, in YAML; `-D objects.ball.radius=2` finds an
  object by its name, `-D objects[0].radius=2` by its number, and `-D camera.iso=null` takes the file's value away.
- **Nothing for nothing.** What a scene does not ask for is not in the compiled program: an aperture of 0 is a pinhole,
  a black environment is none, and a material that no object has is left out.
"""

MOTION = """\
Objects and cameras may move. A motion acts in world space, after the object's `transform`; at time 0 a velocity and a
spin leave it where it is. Keyframes are taken apart into translation, rotation, and scale with skew; each goes from one
keyframe to the next by itself, the rotation at a constant rate along the shorter arc. So a turn of 180 degrees or more
between two keyframes needs keyframes between them, or a spin.

```yaml
camera: {type: pinhole, look_from: [0, 2, 9], look_at: [0, 1, 0], vfov: 30, shutter: {open: 0, close: 1/30 s}}
film: {width: 320, height: 180}
environment: {type: gradient}
objects:
  - {type: sphere, center: [-2, 1, 0], radius: 0.5, motion: {velocity: [0, 36 km/h, 0]}}
  - type: box
    min: [-0.6, 0.9, 0]
    max: [0.6, 1.1, 0.1]
    motion: {spin: {axis: [0, 0, 1], rate: 5 turn/s, center: [0, 1, 0]}}
  - type: sphere
    center: [0, 0, 0]
    radius: 0.5
    motion:
      keyframes:
        - {time: 0, transform: [{translate: [2, 1, 0]}]}
        - {time: 1/30 s, transform: [{scale: 1.5}, {translate: [2, 1.2, 0]}]}
```

Only what moves while the shutter is open costs anything: a camera without a `shutter` takes a picture of one moment,
`time`, and what stands still is packed as if it had no motion.
"""

GROUPS = """\
What is placed more than once is written once: as a group, which is nowhere by itself, or as an object with a name.
Instances of it take no memory but for their transforms, however many there are.

```yaml
camera: {type: pinhole, look_from: [0, 3, 12], look_at: [0, 1.5, 0], vfov: 40}
film: {width: 320, height: 180}
environment: {type: gradient}
materials:
  bark: {type: lambertian, albedo: [0.2, 0.14, 0.1]}
  green: {type: lambertian, albedo: [0.15, 0.35, 0.08]}
  gold: {type: lambertian, albedo: [0.6, 0.4, 0.05]}
groups:
  crown:
    - {type: sphere, center: [0, 0, 0], radius: 1, material: green, transform: [{scale: [0.8, 1.2, 0.8]}]}
  tree:
    - {type: box, min: [-0.1, 0, -0.1], max: [0.1, 1.2, 0.1], material: bark}
    - {type: instance, of: crown, transform: [{translate: [0, 2, 0]}]}
objects:
  - {type: instance, of: tree, placements: [[{translate: [-3, 0, 0]}], [{scale: 1.5}, {translate: [3, 0, 1]}]]}
  - {type: instance, of: tree, transform: [{scale: [1, 0.6, 1]}]}
  - {type: scatter, of: crown, count: 200, corner: [-9, 0, -9], edges: [[18, 0, 0], [0, 0, 9]], scale: [0.1, 0.3],
     spacing: 0.4, material: gold}
```

A transform of an instance may scale differently along different axes, shear, and mirror: a sphere becomes an
ellipsoid, and the outside stays outside. An object that is placed again by its name is taken with its own transform and
motion, and stays where it is besides. Groups may hold instances of others, but not of themselves. A `material` of an
instance takes the place of all materials in it. Meshes that name the same file are instances of one another by
themselves.
"""

NORMAL_MAPPING = """\
Every material may have a bump map, a texture of heights, or a normal map, or both, the heights then being on top of the
normal map. The surface stays as flat as it is, and is shaded as if it had the slopes. What would thereby be reflected
into the surface is mirrored at it, so no light is lost and none leaks through.

```yaml
materials:
  hammered: {type: metal, albedo: 0.9, bump: {type: noise, scale: 20}, bump_height: 5 mm}
```
"""

MATERIALS_INTRODUCTION = """\
Values of `materials`, by name; or the value of an object's `material`. Each may have the keys of
[normal mapping](#normal-mapping) besides its own."""

TEXTURES_INTRODUCTION = """\
Values of `textures`, by name. A parameter of a material whose value may be a texture takes the name of one, or a
texture itself: `albedo: {type: checker}`. A colour takes the texture's colour, in linear light; a number takes the
luminance of it. Solid textures are looked up where a point is before motion and instancing move it, others by the
surface's parameters u and v: those of a mesh's file (OBJ `vt`, PLY `s t`, `u v` or `texture_u texture_v`, glTF
`TEXCOORD_0`), or barycentric ones where it has none; of a quad, 0 to 1 along its two edges; of a sphere, once around
the y axis from -x through +z, and from the south pole to the north; of a disc, once around it and from the middle to
the rim. v runs upwards in pictures. Textures that no material in use has cost nothing."""

MEDIA_INTRODUCTION = """\
Values of `media`, by name. A medium fills

- an object that names it as its `medium`: a glass ball and the smoke in it are one object, of which the material is
  the surface. Without a material there is no surface: light goes straight through, and no path segment is counted;
- the whole scene, as the scene's `medium`: outside of objects, and without end. What is infinitely far is then hidden;
- the place of the camera, as the camera's `medium`. It is needed where the camera stands inside of an object: a path is
  in the medium of the last surface that it went through, so the surfaces round the camera have to be told.

Outside of an object is the scene's `medium`, or what its `outside_medium` names: smoke within a box of fog needs it.
Sides are those of the surface's normal. An object that light is refracted into, such as one of glass, is clear inside
if it names no medium; other objects that name none leave light in the medium that it came through. A medium that takes
nothing from light, `{type: homogeneous, absorption: 0}`, is no medium, and serves to name clear space.

```yaml
camera: {type: pinhole, look_from: [0, 1, 6], look_at: [0, 1, 0], vfov: 30}
film: {width: 320, height: 180}
environment: {type: gradient}
media:
  smoke: {type: homogeneous, extinction: 2, albedo: [0.9, 0.6, 0.3]}
  milk: {type: homogeneous, absorption: [0.01, 0.03, 0.1], scattering: 20, g: 0.7}
objects:
  - {type: sphere, center: [-1.2, 1, 0], radius: 1, medium: smoke}
  - {type: sphere, center: [1.2, 1, 0], radius: 1, material: {type: dielectric, ior: 1.33}, medium: milk}
```
"""

APERTURES_INTRODUCTION = """\
The value of a thin lens's `aperture_shape`; a disc where it is not given. An aperture is described as seen from behind
the camera. Lights beyond the plane of focus blur to its image, those before it to its image upside down. Whatever its
shape, it is as large in area as the round aperture of the lens's diameter, weighted by what it lets through: a shape
changes the form of the blur, and neither the exposure nor what the f-number means."""

EXPOSURE = """\
A camera with `iso`, or `exposure`, takes a photograph. Values are then such that 1 saturates the sensor: of the
illuminance E (lx) on the sensor, at 179 lm/W, and the time t (s), a value is E t iso / 78, as ISO 12232 defines the
speed by saturation, times 2 to the power of `exposure_compensation`. E is what the light through the aperture brings,
so f-number, focus and field angle have their effect by themselves. With `exposure: auto` the speed is chosen so that
the metered luminance, before compensation, is 10/78 of saturation, which is middle grey; `rt render` says which speed
that was, and so do the headers of files and `--stats`. Where aperture or shutter are not known, `auto` multiplies
radiance alike. What is metered is what is rendered: with `--crop`, the crop.

A thin lens loses no light, so that each stop of the f-number is a factor of 2 however wide it is. `pupil: flat` exposes
as an even disc of light in its place would, by 1 / (1 + 4 N^2) on the axis and by Foote's formula off it: less by 11 %
at f/1.4.

So scenes need light as it is. A `sky` with `sun: true` is right at f/16, 1/125 s and ISO 100. A bulb of 800 lm is a
`point` light of the intensity 800 / 179 / (4 pi) = 0.36 W/sr, or an emitting sphere of the radius r and the radiance
800 / 179 / (4 pi^2 r^2). A `gradient` of radiance 1 is 179 cd/m2, as in a bright room.

```yaml
camera: {type: thin_lens, look_from: [0, 1, 6], look_at: [0, 1, 0], sensor: {format: full_frame, noise: true},
         focal_length: 50 mm, f_number: 2.8, shutter: 1/125 s, exposure: {metering: spot, at: [0.5, 0.6]}}
film: {width: 360, height: 239, white_balance: 5000 K, tone_curve: filmic}
environment: {type: gradient}
objects:
  - {type: sphere, center: [0, 1, 0], radius: 1}
```

In order, light is exposed, recorded by the sensor if that is simulated (`noise: true`), and its white balanced.
Linear files (`.exr`, `.hdr`, `.npy`) hold these values, which may be beyond 1 without a sensor; the tone curve is for
what is shown, `.png`, `.jpg` and notebooks. `filmic` shows middle grey as 18 % and bends highlights towards white.

A simulated sensor counts photons: n electrons expected are n on average, with the variance n, to which reading adds its
own. A value of 1 at the base ISO is a full well; at n times that speed it is an n-th of it, so ISO 3200 at 1/32 of the
time of ISO 100 is as bright and, but for read noise, sqrt(32) times as noisy. Values end at 1, and are as many as the
bits allow. Light is gathered with a noise of its own, as always, so take enough samples to tell the two apart.
"""

WITHIN_INTRODUCTION = """\
Mappings without a `type` that names their kind, each under the key that takes it: what `camera.shake` may hold is under
`shake`. The tables above lead here."""

GLASSES = """\
An index, the name of a glass of the catalogue ([lenses.md](lenses.md#glass) lists it), or one of these, by the
wavelength l:
"""

DETAILS = {"motion": MOTION, "exposure": EXPOSURE, "ior": GLASSES}
"""What is to be said of some of them besides."""

_MOST_NAMES = 12
"""Names of a catalogue are not listed by every key that takes one."""

FAMILIES: tuple[tuple[str, str, Family], ...] = (
    ("Cameras", "The value of `camera`.", CAMERAS),
    ("Apertures", APERTURES_INTRODUCTION, APERTURES),
    ("Filters", "The value of `film.filter`: a mapping, or the type alone where the defaults will do.", FILTERS),
    ("Environments", "The value of `environment`.", ENVIRONMENTS),
    (
        "Materials",
        MATERIALS_INTRODUCTION,
        MATERIALS,
    ),
    ("Media", MEDIA_INTRODUCTION, MEDIA),
    ("Textures", TEXTURES_INTRODUCTION, TEXTURES),
    ("Shapes", "Items of `objects`. Each may have the keys of [objects](#objects) besides its own.", SHAPES),
    ("Lights", "Items of `lights`.", LIGHTS),
)


def values(node: Mapping[str, Any]) -> str:
    """Say what a property of the schema may be, in a few words; mappings lead to the table of their keys."""
    if len(node.get("enum", ())) > _MOST_NAMES:
        return "name"
    if "enum" in node:
        return " \\| ".join(f"`{value}`" for value in node["enum"])
    if "const" in node:
        return f"`{node['const']}`"
    if "$ref" in node or "oneOf" in node or "properties" in node:
        return f"[mapping](#{anchor(node)})"
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
    return names.get(node.get("type", ""), node.get("type", "any"))


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
def anchors() -> Mapping[str, str]:
    """Find where the keys of each mapping are, by the names of definitions, or by the schema of what is in none."""
    found = {"Material": "materials", "Texture": "textures"}
    for title, _, family in FAMILIES:
        found |= dict.fromkeys(map(definition_name, family.specs().values()), title.lower())
    for nested in nested_mappings(scene_schema()):
        for form, name in zip(nested.forms, nested.names, strict=True):
            found[name or json.dumps(form)] = nested.key
    return found


def anchor(node: Mapping[str, Any]) -> str:
    """Find the heading under which the keys of a mapping are; of several kinds, that of their family."""
    first = node["oneOf"][0] if "oneOf" in node else node
    return anchors()[first["$ref"].rpartition("/")[2] if "$ref" in first else json.dumps(first)]


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
    found: Mapping[str, Any] = scene_schema()["$defs"][definition_name(spec)]
    return found


def specs_by_name() -> dict[str, type[Spec]]:
    """Find all classes of mappings of a scene, by what the schema calls them."""
    found, left = {}, [Spec]
    while left:
        left += (spec := left.pop()).__subclasses__()
        found[definition_name(spec)] = spec
    return found


def within(nested: Nested, shown: set[str]) -> Iterator[str]:
    """Write the section of a mapping within others.

    shown : the modules whose example is in the reference already, to which this one's is added.
    """
    yield f"### {nested.key}\n"
    # Groups hold what the list of objects does.
    places = dict.fromkeys(place.replace("groups.NAME[]", "objects[]").rstrip("[]") for place in nested.places)
    yield f"Of {', '.join(f'`{place}`' for place in places)}.\n"
    known = specs_by_name()
    specs = [None if name is None else known[name] for name in nested.names]
    for spec in specs:
        if spec is not None and spec.__doc__:
            yield words(spec.__doc__) + "\n"
            text = sys.modules[spec.__module__].__doc__ or ""
            if "In a scene:" in text and spec.__module__ not in shown and nested.key not in DETAILS:
                shown.add(spec.__module__)
                yield f"```yaml\n{snippet(text)}\n```\n"
    if nested.key in DETAILS:
        yield DETAILS[nested.key]
    if nested.key == "sensor":
        yield "The formats, any of which may stand in place of the mapping:\n"
        yield from formats()
    for number, (spec, form) in enumerate(zip(specs, nested.forms, strict=True)):
        if number:
            yield "or:\n"
        yield from table(spec, form)


def reference() -> str:
    """The text of docs/scenes.md."""
    parts = [INTRODUCTION, "## The file\n"]
    parts += table(SceneSpec, scene_schema())
    for title, spec in (("film", Film), ("render", Render)):
        parts += [f"### {title}\n", words(spec.__doc__) + "\n", *table(spec, definition(spec))]

    # Keys that every object has, from any of the shapes.
    common = frozenset(ShapeSpec.model_fields) - {"type"}
    shape = next(iter(SHAPES.specs().values()))
    parts += ["### objects\n", "Every object may have these keys; those of its shape are [below](#shapes).\n"]
    parts += table(shape, definition(shape), frozenset(shape.model_fields) - common)
    parts += ["### groups\n", GROUPS]

    normal_mapping = frozenset(MaterialSpec.model_fields) - {"type"}
    material = next(iter(MATERIALS.specs().values()))
    own = frozenset(material.model_fields) - normal_mapping
    parts += ["### normal mapping\n", NORMAL_MAPPING, *table(material, definition(material), own)]

    hidden = {SHAPES: common, MATERIALS: normal_mapping}
    for title, introduction, family in FAMILIES:
        if specs := family.specs():
            parts += [f"## {title}\n", introduction + "\n"]
            for name, spec in specs.items():
                parts += kind(name, spec, hidden.get(family, frozenset()))

    shown = {spec.__module__ for _, _, family in FAMILIES for spec in family.specs().values()}
    parts += ["## Mappings within others\n", WITHIN_INTRODUCTION + "\n"]
    for nested in nested_mappings(scene_schema()):
        if not {Film.__name__, Render.__name__} & set(nested.names):
            parts += within(nested, shown)
    return "\n".join(parts).rstrip() + "\n"


if __name__ == "__main__":
    OUTPUT.write_text(reference(), encoding="utf-8")
