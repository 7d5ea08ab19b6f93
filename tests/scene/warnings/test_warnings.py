"""Warnings before a render: each is given for a scene that deserves it, names object and line, and for no other."""

import gc
import json
import weakref
from pathlib import Path

import numpy as np
import pytest
import yaml

import raytracer as rt
from raytracer.cli.base.app import main
from raytracer.core.primitives.base import interface as primitives
from raytracer.rendering.render import render
from raytracer.scene.load import build, load
from raytracer.scene.pack.scene import pack
from raytracer.scene.warnings import find_warnings, warning_messages
from raytracer.scene.warnings.base.kind import MAX_PER_KIND
from raytracer.scene.warnings.base.primitive_points import coordinate_extents, outline
from raytracer.scene.warnings.base.survey import SceneSurvey
from raytracer.util.errors import InputError, StrictError
from tests.scene.assets.test_meshes import obj_text

ROOT = Path(__file__).parents[3]

HEAD = """\
camera: {type: pinhole, look_from: EYE, look_at: [0.1, 0.5, 0], vfov: 40}
film: {width: 8, height: 6}
environment: {type: constant, radiance: 1}
materials:
  grey: {type: lambertian, albedo: 0.5}
  red: {type: lambertian, albedo: [0.5, 0, 0]}
  glass: {type: dielectric, ior: 1.5}
  lamp: {type: emitter, radiance: 3}
  water: {type: dielectric, ior: 1.33, priority: 1}
  ink: {type: dielectric, ior: 1.33, priority: 1, absorption: 2}
  marble: {type: dielectric, ior: 1.5, priority: 2}
"""

CASES = yaml.safe_load(Path(__file__).with_name("cases.yaml").read_text(encoding="utf-8"))
FLOOR, BALL, WALL, POSTER, CRATE, TUBE, POOL, BEAD, NEEDLE, STAR, PANE, TURNED = CASES["objects"].values()


def listed(objects):
    """Objects of a scene file, a line each; JSON is YAML."""
    return "objects:\n" + "".join(f"  - {json.dumps(item)}\n" for item in objects)


def warnings_of(text, base=None):
    return find_warnings(pack(build(text, "s.yaml", base=base)))


def found(*objects, eye="[0, 1.5, 6]", more="", base=None):
    """Return the warnings of a scene of these objects."""
    return warnings_of(HEAD.replace("EYE", eye) + more + listed(objects), base)


def beads(count, **keys):
    return [BEAD | {"name": f"bead{k}", "radius": 1.0 - 0.005 * k} | keys for k in range(count)]


def test_glass_in_glass_made_for_it_is_no_concern():
    assert found(*beads(24, material={"type": "dielectric", "outside_ior": 1.5})) == []


@pytest.mark.parametrize("objects", CASES["right"].values(), ids=CASES["right"])
def test_what_is_right_is_no_concern(objects):
    assert found(*objects) == []


DEEP = {
    "glass in glass, 30 deep": [
        "lies within 29 clear objects, so light goes straight through 60 surfaces, and paths end after 50 segments",
        *beads(30),
    ],
    "glass in glass, 80 deep": ["lies within 79 clear objects whose materials have no `priority`", *beads(80)],
}
WARNED = CASES["warned"] | DEEP


@pytest.mark.parametrize(("words", "objects"), [(row[0], row[1:]) for row in WARNED.values()], ids=WARNED)
def test_a_concern_names_its_object(words, objects):
    (concern,) = found(*objects)
    number = len(objects) - 1
    label = f' "{objects[-1]["name"]}"' if "name" in objects[-1] else ""
    assert concern.text.startswith(f"s.yaml:{13 + number}: objects[{number}]{label}: ")
    assert words in concern.text


@pytest.mark.parametrize(
    ("eye", "words"),
    [
        ("[0, 2, 0.5]", 'is inside objects[1] "ball", which is opaque and holds no light'),
        ("[2, 0, 4]", 'lies on the surface of objects[0] "floor"'),
        ("[0, 3.0000000001, 0]", 'lies on the surface of objects[1] "ball"'),
    ],
)
def test_a_camera_that_sees_nothing(eye, words):
    (concern,) = found(FLOOR, BALL, eye=eye)
    assert concern.text.startswith("s.yaml:1: camera.look_from: ")
    assert words in concern.text


def test_a_camera_in_a_box_sees_what_is_lit_in_there():
    room = {"type": "box", "name": "room", "min": [-3, -1, -3], "max": [3, 4, 3]}
    lamp = BALL | {"center": [0, 3, 0], "radius": 0.2, "material": "lamp"}
    lights = "lights: [{type: point, position: [0, 3, 0], intensity: 1}]\n"
    for objects, more, lit in (
        ([room], "", False),
        ([room, lamp], "", True),
        ([room], lights, True),
        ([room], lights.replace("[0, 3, 0]", "[0, 5, 0]"), False),
        ([room | {"material": "glass"}], "", True),
    ):
        told = ["" if lit else concern.text for concern in found(*objects, eye="[0, 1, 2]", more=more)]
        assert len(told) == (not lit)
        assert all('is inside objects[0] "room"' in text for text in told)


def test_a_scene_without_light_is_black():
    dark = HEAD.replace("EYE", "[0, 1, 6]").replace("environment: {type: constant, radiance: 1}\n", "") + listed(
        [FLOOR]
    )
    (concern,) = warnings_of(dark)
    assert concern.text.startswith("s.yaml:11: objects: nothing gives light")
    point = "lights: [{type: point, position: [0, 3, 0], intensity: 0}]\n"
    first, second = warnings_of(point + dark)
    assert first.text == "s.yaml:1: lights[0]: gives no light: its intensity is 0"
    assert second.keys == ("objects",)
    assert warnings_of(point.replace("intensity: 0", "intensity: [0, 0, 1]") + dark) == []


def test_a_shift_that_is_a_million_metres_changes_no_concern():
    # Coordinates are judged as they are packed, near the origin.
    far = {"transform": [{"translate": [1e6, -1e6, 1e6]}]}
    head = HEAD.replace("EYE", "[1e6, -999999, 1000006]").replace("[0.1, 0.5, 0]", "[1000000.1, -999999.5, 1e6]")
    for objects, kinds in (((FLOOR, BALL), 0), ((WALL, POSTER), 1)):
        assert len(warnings_of(head + listed([item | far for item in objects]))) == kinds


def grouped(name, *objects):
    return f"groups:\n  {name}:\n" + "".join(f"    - {json.dumps(item)}\n" for item in objects)


def placed(name, of, *steps):
    return {"type": "instance", "name": name, "of": of, "transform": list(steps)}


def test_what_instances_place_is_held_against_the_rest():
    group = grouped("pictures", POSTER | {"name": "picture", "corner": [0, 1, 0]})
    (concern,) = found(WALL, placed("hung", "pictures", {"translate": [2, 0, -2]}), more=group)
    expected = 's.yaml:17: objects[1] "hung": a surface of it coincides with one of objects[0] "wall"'
    assert concern.text.startswith(expected)
    assert found(WALL, placed("hung", "pictures", {"translate": [2, 0, -1.99]}), more=group) == []


GROUND = {"type": "quad", "name": "ground", "corner": [-1e6, 0, 1e6], "edges": [[2e6, 0, 0], [0, 0, -2e6]]}
SLAB = {"type": "box", "name": "ground", "min": [-1e6, -1, -1e6], "max": [1e6, 0, 1e6]}
PEBBLES = [
    {"type": "sphere", "name": "a", "center": [0, 0.003, 0], "radius": 0.003},
    {"type": "sphere", "name": "b", "center": [0.03, 0.01, 0], "radius": 0.01},
]
LOW = "[0, 0.05, 0.15]"
DROWN = "objects that drown in what they lie on"


def kinds(*objects, eye):
    return {concern.kind for concern in found(*objects, eye=eye)}


@pytest.mark.parametrize("ground", [GROUND, SLAB])
def test_a_huge_ground_that_is_cut_is_no_concern(ground):
    assert found(ground, *PEBBLES, eye=LOW) == []
    assert found(ground, CRATE, eye="[0, 1.6, 5]") == []
    # The offset there is 4 * 2^-23 of the reach of a part, which is 2^-20 of the ground's at least.
    (concern,) = found(ground, *PEBBLES, eye="[0, 1e-6, 0.15]")
    assert 'lies on the surface of objects[0] "ground", to within 1' in concern.text
    # Pebbles of which rays 20 km off leave the ground farther than they are large do drown, though it is cut.
    assert DROWN in kinds(ground, PEBBLES[1] | {"center": [20000, 0.01, 0]}, eye=LOW)


CHECKERED = {"type": "lambertian", "albedo": {"type": "checker", "scale": 1, "even": 0.5, "odd": 0.7}}


@pytest.mark.parametrize(
    "why",
    [{"transform": [{"rotate": {"axis": [1, 0, 1], "angle": 3}}]}, {"material": CHECKERED}],
    ids=["tilted", "textured"],
)
def test_a_huge_ground_that_is_not_cut_is_one(why):
    assert kinds(GROUND | why, *PEBBLES, eye=LOW) == {DROWN, "cameras without a view"}
    high = CRATE | {"min": [0, 50, 0], "max": [1, 51, 1]}
    assert kinds(GROUND | why, high, eye="[0, 40, 5]") == {"sizes that are too far apart"}


def test_glass_in_water_that_groups_and_meshes_hold(tmp_path):
    corners = [[x, y, z] for x in (-1, 1) for y in (0, 1) for z in (-1, 1)]
    sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    triangles = [[side[0], side[k], side[k + 1]] for side in sides for k in (1, 2)]
    obj(tmp_path / "pool.obj", corners, triangles)
    # Of a surface and one wall nothing is inside.
    obj(tmp_path / "open.obj", corners, triangles[6:8] + triangles[10:])

    def told(*objects, more=""):
        return [concern.text for concern in found(*objects, more=more, base=tmp_path)]

    pool = {"type": "mesh", "name": "pool", "file": "pool.obj", "material": "water"}
    (text,) = told(pool, BEAD)
    assert 'objects[1] "bead": is clear, and lies within objects[0] "pool"' in text
    assert told(pool, BEAD | {"center": [1.3, 0.5, 0]}) == []
    assert told(pool | {"file": "open.obj"}, BEAD) == []

    group = grouped("beads", BEAD)
    away, near = (placed(name, "beads", {"scale": 0.5}, {"translate": [x, 0, 0]}) for name, x in (("a", 5), ("b", 0.5)))
    (text,) = told(pool, away, near, more=group)
    assert 'objects[2] "b": is clear, and lies within objects[0] "pool"' in text
    assert told(pool, away, more=group) == []

    # The pool is in another place than in its group.
    group, put = grouped("pools", pool), placed("put", "pools", {"translate": [7, 0, 0]})
    (text,) = told(put, BEAD | {"center": [7, 0.5, 0]}, more=group)
    assert 'objects[1] "bead": is clear, and lies within objects[0] "put"' in text
    assert told(put, BEAD, more=group) == []


def obj(path, vertices, faces):
    path.write_bytes(obj_text(faces, vertices))


def test_triangles_without_an_area_are_counted(tmp_path):
    vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0], [3, 1, 0]]
    obj(tmp_path / "rock.obj", vertices, [[0, 1, 2], [0, 1, 3], [1, 4, 2], [4, 4, 4]])
    (concern,) = found({"type": "mesh", "file": "rock.obj"}, base=tmp_path)
    assert "its file has 2 triangles without an area (the first is number 1, counted from 0)" in concern.text
    # A file that is fine may become too fine for float32 where it is placed: every second triangle is 1e-9 m high.
    heights = [[x, 1.0 + (x % 2) * (1e-9 if x < 6 else 1.0), 0.0] for x in range(12)]
    obj(tmp_path / "fine.obj", heights, [[k, k + 1, k + 2] for k in range(10)])
    (concern,) = found({"type": "mesh", "file": "fine.obj"}, base=tmp_path)
    assert "5 of its 10 faces have no area once its coordinates are rounded to float32" in concern.text


def test_pixels_too_small_for_float32():
    for vfov, kinds in (("0.001", []), ("0.0001", ["pixels too small for float32"])):
        text = HEAD.replace("EYE", "[0, 1.5, 6]").replace("vfov: 40", f"vfov: {vfov}") + listed([FLOOR])
        assert [item.kind for item in warnings_of(text)] == kinds


def test_slivers_with_neighbours_are_no_concern(tmp_path):
    # A wire of 1000 sides, each 1.9e-6 m wide: float32 displaces an edge for both of its faces alike.
    count = 1000
    angle = 2.0 * np.pi * np.arange(count) / count
    circle = 3e-4 * np.column_stack([np.zeros(count), np.cos(angle), np.sin(angle)]) + [0.0, 1.0, 0.0]
    ends = [[0.0, 1.0, 0.0], [1.0, 1.0, 0.0]]
    here, there = np.arange(count), np.roll(np.arange(count), -1)
    sides = [(here, there, there + count), (here, there + count, here + count)]
    caps = [(there, here, np.full(count, 2 * count)), (here + count, there + count, np.full(count, 2 * count + 1))]
    faces = np.concatenate([np.column_stack(part) for part in (*sides, *caps)])
    vertices = np.concatenate([circle, circle + np.eye(3)[0], ends])
    obj(tmp_path / "wire.obj", vertices, faces.tolist())
    assert found({"type": "mesh", "file": "wire.obj"}, base=tmp_path) == []
    # Every second side left out, the others are ribbons.
    obj(tmp_path / "ribbons.obj", vertices, [face for face in faces.tolist() if min(face) % 2])
    (concern,) = found({"type": "mesh", "file": "ribbons.obj"}, base=tmp_path)
    assert "faces are as narrow as 1.8e-06 m" in concern.text


def test_of_many_alike_ten_are_told():
    narrow = {"type": "quad", "edges": [[0.4, 0, 0], [0, 1, 0]], "material": "red"}
    posters = [narrow | {"corner": [x, 1, -2]} for x in np.arange(-4.8, 4.2, 0.5)]
    sentences = warning_messages(found(WALL, *posters))
    assert len(sentences) == MAX_PER_KIND + 1
    assert sentences[-1] == f"and {len(posters) - MAX_PER_KIND} more surfaces that coincide"


SHIPPED = sorted([*ROOT.glob("scenes/*.yaml"), *ROOT.glob("scenes/lecture/*.yaml")])

LIGHT = ("bokeh", "cornell", "cover", "fan", "glass", "nested", "smoke", "textures", "train")
"""Scenes that are packed in no time."""


@pytest.mark.parametrize(
    "path",
    [pytest.param(path, id=path.stem, marks=[] if path.stem in LIGHT else [pytest.mark.slow]) for path in SHIPPED],
)
def test_shipped_scenes_are_no_concern(path):
    assert [item.text for item in find_warnings(pack(load(path)))] == []


# ---- How it is told


def written(tmp_path, *objects):
    path = tmp_path / "scene.yaml"
    path.write_text(HEAD.replace("EYE", "[0, 1, 6]") + listed(objects))
    return path


def test_validate_warns_and_strict_refuses(tmp_path, capsys):
    bad = written(tmp_path, WALL, POSTER, BALL, BALL | {"name": "twin", "material": "red"})
    assert main(["validate", str(bad)]) == 0
    captured = capsys.readouterr()
    assert captured.out == f"{bad}: valid\n"
    assert captured.err.startswith(f'rt: warning: {bad}:14: objects[1] "poster": ')
    out = tmp_path / "a.npy"
    for command in (["validate"], ["render", "-o", str(out)]):
        assert main([*command, str(bad), "--strict"]) == 2
        assert not out.exists()
        captured = capsys.readouterr()
        assert captured.out == ""
        labels = [line.split(": ")[2] for line in captured.err.splitlines()]
        assert labels == ['objects[1] "poster"', 'objects[3] "twin"']
    with pytest.raises(StrictError, match=r'objects\[1\] "poster": .* \(and 1 more\)'):
        render(load(bad), strict=True)


def test_explain_and_python_warn(tmp_path, monkeypatch):
    bad = written(tmp_path, WALL, POSTER)
    (sentence,) = rt.explain(rt.load(bad)).warnings
    assert 'objects[1] "poster"' in sentence

    # The warning is at the line that asked for the picture.
    def stop(*_):
        raise InputError("far enough")

    monkeypatch.setattr("raytracer.rendering.render.check_development", stop)
    with pytest.warns(rt.SceneWarning, match="poster") as warned, pytest.raises(InputError, match="far enough"):
        rt.render(rt.load(bad))
    assert [item.filename for item in warned] == [__file__]


# ---- Tables


def test_every_kind_of_primitive_has_an_outline():
    assert set(primitives.geometry.registry) == set(outline.registry)


SHAPES = [
    {"type": "sphere", "center": [1, 2, 3], "radius": 0.5},
    {"type": "disc", "center": [1, 2, 3], "normal": [1, 2, 2], "radius": 0.5},
    {"type": "quad", "corner": [1, 2, 3], "edges": [[1, 0.3, 0], [0, 1, 2]]},
    {"type": "box", "min": [1, 2, 3], "max": [2, 4, 6]},
    {"type": "triangle", "vertices": [[1, 2, 3], [2, 2, 3], [1, 4, 2]]},
    {"type": "mesh", "file": "rock.obj", "smooth": True},
]


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape["type"])
def test_outlines_span_what_tables_hold(shape, tmp_path):
    obj(tmp_path / "rock.obj", [[1, 2, 3], [2, 2, 3], [1, 4, 2], [5, 5, 5]], [[0, 1, 2]])
    text = HEAD.replace("EYE", "[0, 1, 6]") + listed([shape])
    (table,) = pack(build(text, "s.yaml", base=tmp_path)).scene.primitives
    points = outline(table, 0, len(table.material))
    low, high = primitives.bounds(table)
    # A polygon in a disc falls short of its circle by 1 - cos(pi / 16).
    short = 0.02 * float(np.max(high - low)) if shape["type"] == "disc" else 0.0
    assert np.abs(points.min(axis=(0, 1)) - low).max() <= short
    assert np.abs(points.max(axis=(0, 1)) - high).max() <= short
    reach = coordinate_extents(table, 0, len(table.material))
    assert (reach >= np.abs(points).max(axis=(1, 2)) - short).all()


def test_a_scene_is_not_kept_by_what_was_derived_of_it(monkeypatch):
    surveys = []

    class Watched(SceneSurvey):
        def __init__(self, packed):
            super().__init__(packed)
            surveys.append(weakref.ref(self))

    monkeypatch.setattr("raytracer.scene.warnings.SceneSurvey", Watched)
    gc.disable()
    try:
        assert found(POOL, BEAD, STAR)
        assert [survey() for survey in surveys] == [None]
    finally:
        gc.enable()
