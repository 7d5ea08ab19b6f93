"""Warnings before a render: each is given for a scene that deserves it, names object and line, and for no other."""

import gc
import weakref
from pathlib import Path

import numpy as np
import pytest

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

FLOOR = "type: quad, name: floor, corner: [-5, 0, 5], edges: [[10, 0, 0], [0, 0, -10]], material: grey"
BALL = "type: sphere, name: ball, center: [0, 2, 0], radius: 1, material: grey"
WALL = "type: quad, name: wall, corner: [-5, 0, -2], edges: [[10, 0, 0], [0, 10, 0]], material: grey"
POSTER = "type: quad, name: poster, corner: [0, 1, -2], edges: [[1, 0, 0], [0, 1, 0]], material: red"
CRATE = "type: box, name: crate, min: [0, 0, 0], max: [1, 1, 1], material: red"
TUBE = "type: quad, name: tube, corner: [0, 3, 0], edges: [[1, 0, 0], [0, 0, 1]], material: lamp"
POOL = "type: box, name: pool, min: [-1, 0, -1], max: [1, 1, 1], material: water"
BEAD = "type: sphere, name: bead, center: [0, 0.5, 0], radius: 0.2, material: glass"
NEEDLE = "type: box, name: needle, min: [0, 1, 0], max: [1, 1.0000003, 3.0e-7]"
STAR = "type: sphere, name: star, center: [0, 5000, 5000], radius: 0.001, material: lamp"
PANE = "type: box, name: pane, min: [-50, 1, -50], max: [50, 1.0001, 50], material: glass"
TURNED = "transform: [{rotate: {axis: [1, 2, 3], angle: 33}}]"


def found(*objects, eye="[0, 1.5, 6]", more="", base=None):
    """Return the warnings of a scene of these objects."""
    text = HEAD.replace("EYE", eye) + more + "objects:\n" + "".join(f"  - {{{item}}}\n" for item in objects)
    return find_warnings(pack(build(text, "s.yaml", base=base)))


def dark(text):
    return text.replace("environment: {type: constant, radiance: 1}\n", "")


CLEAN = {
    "a floor and a ball": (FLOOR, BALL),
    "the ground of One Weekend": (
        "type: sphere, center: [0, -1000, 0], radius: 1000",
        "type: sphere, center: [0, 0.2, 0], radius: 0.2",
    ),
    "a crate on a floor": (FLOOR, CRATE),
    "a crate on a crate": (CRATE, "type: box, min: [0, 1, 0], max: [1, 2, 1], material: grey"),
    "a poster a tenth of a millimetre off": (WALL, POSTER.replace("-2]", "-1.9999]")),
    "a poster of the wall's own material": (WALL, POSTER.replace("red", "grey")),
    "a poster beside the wall": (WALL, POSTER.replace("corner: [0", "corner: [5")),
    "a poster beside the wall, both turned": (
        f"{WALL}, {TURNED}",
        f"{POSTER.replace('corner: [0', 'corner: [5')}, {TURNED}",
    ),
    "hollow glass": (
        "type: sphere, center: [0, 2, 0], radius: 1, material: glass",
        "type: sphere, center: [0, 2, 0], radius: -0.9, material: glass",
    ),
    "a lamp above": (FLOOR, TUBE),
    "glass that has a priority in water": (POOL, BEAD.replace("glass", "marble")),
    "glass beside water": (POOL, BEAD.replace("[0,", "[1.3,")),
    "glass beside water that is turned, in its box": (
        f"{POOL}, transform: [{{rotate: {{axis: [0, 1, 0], angle: 45}}}}]",
        BEAD.replace("[0, 0.5, 0]", "[0.9, 0.5, 0.9]"),
    ),
    "glass a millimetre above water": (POOL, BEAD.replace("0.5", "1.201")),
    "glass that is made for clear water": (
        POOL,
        BEAD.replace("material: glass", "material: {type: dielectric, ior: 1.5, outside_ior: 1.33}"),
    ),
    "a hollow in water, and a bead in it": (
        POOL,
        BEAD.replace("bead", "hollow").replace("glass", "{type: dielectric, ior: 1.33}").replace("0.2", "-0.4"),
        BEAD,
    ),
    "an opaque ball in water": (POOL, BEAD.replace("glass", "red")),
    "glass in glass, none of which has a priority": (POOL.replace("water", "glass"), BEAD),
    "a blade a tenth of a millimetre wide": (FLOOR, "type: triangle, vertices: [[0, 1, 0], [1, 1, 0], [0, 1.0001, 0]]"),
    "a plate that is thin": (FLOOR, NEEDLE.replace("3.0e-7]", "1]")),
    "a far lamp that is only aimed at": (FLOOR, BALL, STAR),
    "a sun that is only aimed at": (FLOOR, BALL, STAR.replace("5000", "1.0e11").replace("0.001", "5.0e8")),
    "a window pane": (PANE.replace("1.0001", "1.003"),),
    "an opaque sheet": (PANE.replace("glass", "grey"),),
    "a lentil": (FLOOR, BALL.replace("grey", "grey, transform: [{scale: [1, 1, 1.0e-3]}]")),
    "glass in glass made for it, 24 deep": tuple(
        f"type: sphere, center: [0, 2, 0], radius: {1.0 - 0.005 * k}, material: {{type: dielectric, outside_ior: 1.5}}"
        for k in range(24)
    ),
    "a lamp inside of a room": (
        "type: sphere, name: room, center: [0, 0, 0], radius: -20, material: grey",
        "type: sphere, center: [0, 3, 0], radius: 0.3, material: lamp",
    ),
}


@pytest.mark.parametrize("objects", CLEAN.values(), ids=CLEAN)
def test_what_is_right_is_no_concern(objects):
    assert found(*objects) == []


WARNED = {
    "a pea a kilometre away": (
        (FLOOR, BALL, "type: sphere, name: pea, center: [0, 1, -1000], radius: 0.001"),
        's.yaml:15: objects[2] "pea": ',
        "is 1e+06 of its radii (0.001 m) away from the camera",
    ),
    "a pebble on a planet": (
        (
            "type: sphere, name: planet, center: [0, -1000000, 0], radius: 1000000",
            "type: sphere, name: pebble, center: [0, 0.1, 0], radius: 0.1",
            "type: sphere, name: balloon, center: [0, 30, 0], radius: 0.1",
        ),
        's.yaml:14: objects[1] "pebble": ',
        'lies on objects[0] "planet", which rays leave 0.95 m off its surface',
    ),
    "a dome of stars": (
        (FLOOR, BALL, "type: sphere, name: dome, center: [0, 0, 0], radius: -1e7, material: lamp"),
        's.yaml:14: objects[1] "ball": ',
        'is 2 m large, and objects[2] "dome" 2e+07 m, 1e+07 times as much',
    ),
    "a face that is nothing in float32": (
        (FLOOR, "type: triangle, name: speck, vertices: [[3, 1, 0], [4, 1, 0], [5, 1.00000001, 0]]"),
        's.yaml:14: objects[1] "speck": ',
        "it has no area once its coordinates are rounded to float32",
    ),
    "a poster in the wall": (
        (WALL, POSTER),
        's.yaml:14: objects[1] "poster": ',
        'coincides with one of objects[0] "wall"',
    ),
    "a poster less than an offset off": (
        (WALL, POSTER.replace("-2]", "-1.999999]")),
        's.yaml:14: objects[1] "poster": ',
        "to within 4.8e-06 m, where they overlap: which of the two is seen is left to rounding",
    ),
    "a disc in a wall, both turned": (
        (
            f"{WALL}, {TURNED}",
            f"type: disc, center: [0, 1, -2], normal: [0, 0, 1], radius: 0.5, material: red, {TURNED}",
        ),
        "s.yaml:14: objects[1]: ",
        'coincides with one of objects[0] "wall"',
    ),
    "a triangle in a wall": (
        (WALL, "type: triangle, vertices: [[0, 1, -2], [1, 1, -2], [0, 2, -2]], material: red"),
        "s.yaml:14: objects[1]: ",
        'coincides with one of objects[0] "wall"',
    ),
    "a lamp in the wall": (
        (WALL, POSTER.replace("red", "lamp")),
        's.yaml:14: objects[1] "poster": ',
        'coincides with one of objects[0] "wall"',
    ),
    "boxes with flush tops": (
        (CRATE, "type: box, name: inlay, min: [0.2, 0.5, 0.2], max: [0.8, 1, 0.8], material: grey"),
        's.yaml:14: objects[1] "inlay": ',
        'coincides with one of objects[0] "crate"',
    ),
    "glass on a floor": (
        (FLOOR, CRATE.replace("red", "glass")),
        's.yaml:14: objects[1] "crate": ',
        "light goes into one of them",
    ),
    "glass on glass of the same kind": (
        (CRATE.replace("red", "glass"), "type: box, name: lid, min: [0, 1, 0], max: [1, 2, 1], material: glass"),
        's.yaml:14: objects[1] "lid": ',
        "light goes into one of them",
    ),
    "a ball twice": (
        (BALL, BALL.replace("ball", "twin").replace("grey", "red")),
        's.yaml:14: objects[1] "twin": ',
        'coincides with one of objects[0] "ball"',
    ),
    "glass in water": (
        (POOL, BEAD),
        's.yaml:14: objects[1] "bead": ',
        'is clear, and lies within objects[0] "pool", whose material has a `priority`, as its own has not',
    ),
    "frosted glass that reaches into water": (
        (POOL, BEAD.replace("[0,", "[1.1,").replace("glass", "{type: rough_dielectric, ior: 1.5}")),
        's.yaml:14: objects[1] "bead": ',
        'is clear, and overlaps objects[0] "pool", whose material has a `priority`',
    ),
    "glass around water": (
        (POOL, BEAD.replace("0.2", "3")),
        's.yaml:14: objects[1] "bead": ',
        'is clear, and overlaps objects[0] "pool"',
    ),
    "a glass rod through water": (
        (POOL, "type: box, name: rod, min: [-0.1, -2, -0.1], max: [0.1, 3, 0.1], material: glass"),
        's.yaml:14: objects[1] "rod": ',
        'is clear, and overlaps objects[0] "pool"',
    ),
    "glass that is made for water, in ink": (
        (
            POOL.replace("water", "ink"),
            BEAD.replace("material: glass", "material: {type: dielectric, ior: 1.5, outside_ior: 1.33}"),
        ),
        's.yaml:14: objects[1] "bead": ',
        'lies within objects[0] "pool"',
    ),
    "a cutout of glass in water": (
        (POOL, BEAD.replace("glass", "{type: cutout, opacity: 0.5, material: glass}")),
        's.yaml:14: objects[1] "bead": ',
        'lies within objects[0] "pool"',
    ),
    "a sliver": (
        (FLOOR, "type: triangle, name: sliver, vertices: [[0, 1, 0], [1, 1, 0], [0, 1.0000005, 0]]"),
        's.yaml:14: objects[1] "sliver": ',
        "is as narrow as 4.8e-07 m, and below 2.6e-06 m",
    ),
    "a needle": ((FLOOR, NEEDLE), 's.yaml:14: objects[1] "needle": ', "6 of its 6 faces are as narrow as 2"),
    "a far lamp before the camera": (
        (FLOOR, STAR.replace("5000, 5000", "1, -5000")),
        's.yaml:14: objects[1] "star": ',
        "is 5e+06 of its radii (0.001 m) away from the camera",
    ),
    "a far lamp and glass": (
        (FLOOR, STAR, BEAD.replace("0.5", "2")),
        's.yaml:14: objects[1] "star": ',
        "of its radii (0.001 m) away from the camera",
    ),
    "a pane as thin as its offset": (
        (PANE,),
        's.yaml:13: objects[0] "pane": ',
        "is 0.0001 m thick, light goes into it, and rays leave its faces 0.00012 m off them",
    ),
    "a ball that is flattened": (
        (FLOOR, BALL.replace("grey", "grey, transform: [{scale: [1, 1, 1.0e-6]}]")),
        's.yaml:14: objects[1] "ball": ',
        "of its radii (1 m) away from the camera, as seen where its transform has not made it 1e+06 times thinner",
    ),
    "glass in glass, 30 deep": (
        tuple(BEAD.replace("bead", f"bead{k}").replace("0.2", str(1.0 - 0.01 * k)) for k in range(30)),
        's.yaml:42: objects[29] "bead29": ',
        "lies within 29 clear objects, so light goes straight through 60 surfaces, and paths end after 50 segments",
    ),
    "glass in glass, 80 deep": (
        tuple(BEAD.replace("bead", f"bead{k}").replace("0.2", str(1.0 - 0.01 * k)) for k in range(80)),
        's.yaml:92: objects[79] "bead79": ',
        "lies within 79 clear objects whose materials have no `priority`",
    ),
    "an emitter that gives nothing": (
        (FLOOR, "type: quad, corner: [0, 3, 0], edges: [[1, 0, 0], [0, 0, 1]], material: {type: emitter, radiance: 0}"),
        "s.yaml:14: objects[1]: ",
        "is made of an emitter that gives no light: its radiance is 0",
    ),
    "a lamp to the ceiling": (
        (FLOOR, TUBE.replace("[1, 0, 0], [0, 0, 1]", "[0, 0, 1], [1, 0, 0]")),
        's.yaml:14: objects[1] "tube": ',
        "gives light to the side of its normal only",
    ),
    "a bulb inside out": (
        (FLOOR, "type: sphere, name: bulb, center: [0, 3, 0], radius: -0.3, material: lamp"),
        's.yaml:14: objects[1] "bulb": ',
        "has a negative radius, so it gives light to its inside only",
    ),
}


@pytest.mark.parametrize(("objects", "place", "words"), WARNED.values(), ids=WARNED)
def test_a_concern_names_its_object(objects, place, words):
    (concern,) = found(*objects)
    assert concern.text.startswith(place)
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
    room = "type: box, name: room, min: [-3, -1, -3], max: [3, 4, 3]"
    (concern,) = found(room, eye="[0, 1, 2]")
    assert 'is inside objects[0] "room"' in concern.text
    assert found(room, "type: sphere, center: [0, 3, 0], radius: 0.2, material: lamp", eye="[0, 1, 2]") == []
    lights = "lights: [{type: point, position: [0, 3, 0], intensity: 1}]\n"
    assert found(room, eye="[0, 1, 2]", more=lights) == []
    outside = lights.replace("[0, 3, 0]", "[0, 5, 0]")
    assert len(found(room, eye="[0, 1, 2]", more=outside)) == 1
    assert found(room.replace("room,", "room, material: glass,"), eye="[0, 1, 2]") == []


def test_a_scene_without_light_is_black():
    text = dark(HEAD.replace("EYE", "[0, 1, 6]")) + f"objects: [{{{FLOOR}}}]\n"
    (concern,) = find_warnings(pack(build(text, "s.yaml")))
    assert concern.text.startswith("s.yaml:11: objects: nothing gives light")
    point = "lights: [{type: point, position: [0, 3, 0], intensity: 0}]\n"
    first, second = find_warnings(pack(build(point + text, "s.yaml")))
    assert first.text == "s.yaml:1: lights[0]: gives no light: its intensity is 0"
    assert second.keys == ("objects",)
    assert find_warnings(pack(build(point.replace("intensity: 0", "intensity: [0, 0, 1]") + text, "s.yaml"))) == []


def test_a_shift_that_is_a_million_metres_changes_no_concern():
    # Coordinates are judged as they are packed, near the origin.
    far = "transform: [{translate: [1e6, -1e6, 1e6]}]"
    eye, at = "[1e6, -999999, 1000006]", "[1000000.1, -999999.5, 1e6]"
    text = HEAD.replace("EYE", eye).replace("[0.1, 0.5, 0]", at)
    for objects, kinds in (((FLOOR, BALL), 0), ((WALL, POSTER), 1)):
        moved = "".join(f"  - {{{item}, {far}}}\n" for item in objects)
        assert len(find_warnings(pack(build(f"{text}objects:\n{moved}", "s.yaml")))) == kinds


def test_what_instances_place_is_held_against_the_rest():
    picture = POSTER.replace("-2]", "0]").replace("poster", "picture")
    group = f"groups:\n  pictures:\n    - {{{picture}}}\n"
    placed = "type: instance, name: hung, of: pictures, transform: [{translate: [2, 0, DEPTH]}]"
    (concern,) = found(WALL, placed.replace("DEPTH", "-2"), more=group)
    assert concern.text.startswith(
        's.yaml:17: objects[1] "hung": a surface of it coincides with one of objects[0] "wall"'
    )
    assert found(WALL, placed.replace("DEPTH", "-1.99"), more=group) == []


GROUND = "type: quad, name: ground, corner: [-1e6, 0, 1e6], edges: [[2e6, 0, 0], [0, 0, -2e6]]"
SLAB = "type: box, name: ground, min: [-1e6, -1, -1e6], max: [1e6, 0, 1e6]"
PEBBLES = (
    "type: sphere, name: a, center: [0, 0.003, 0], radius: 0.003",
    "type: sphere, name: b, center: [0.03, 0.01, 0], radius: 0.01",
)
BOX = "type: box, name: box, min: [-0.5, 0, -0.5], max: [0.5, 1, 0.5]"
LOW = "[0, 0.05, 0.15]"


def kinds(*objects, eye):
    return {concern.kind for concern in found(*objects, eye=eye)}


@pytest.mark.parametrize("ground", [GROUND, SLAB])
def test_a_huge_ground_that_is_cut_is_no_concern(ground):
    assert found(ground, *PEBBLES, eye=LOW) == []
    assert found(ground, BOX, eye="[0, 1.6, 5]") == []
    # The offset there is 4 * 2^-23 of the reach of a part, which is 2^-20 of the ground's at least.
    (concern,) = found(ground, *PEBBLES, eye="[0, 1e-6, 0.15]")
    assert 'lies on the surface of objects[0] "ground", to within 1' in concern.text
    # Pebbles of which rays 20 km off leave the ground farther than they are large do drown, though it is cut.
    far = "type: sphere, name: far, center: [20000, 0.01, 0], radius: 0.01"
    assert "objects that drown in what they lie on" in kinds(ground, far, eye=LOW)


@pytest.mark.parametrize(
    "why",
    [
        "transform: [{rotate: {axis: [1, 0, 1], angle: 3}}]",
        "material: {type: lambertian, albedo: {type: checker, scale: 1, even: 0.5, odd: 0.7}}",
    ],
    ids=["tilted", "textured"],
)
def test_a_huge_ground_that_is_not_cut_is_one(why):
    assert kinds(f"{GROUND}, {why}", *PEBBLES, eye=LOW) == {
        "objects that drown in what they lie on",
        "cameras without a view",
    }
    high = BOX.replace("[-0.5, 0,", "[-0.5, 50,").replace("[0.5, 1,", "[0.5, 51,")
    assert kinds(f"{GROUND}, {why}", high, eye="[0, 40, 5]") == {"sizes that are too far apart"}


def test_glass_in_water_that_groups_and_meshes_hold(tmp_path):
    corners = [[x, y, z] for x in (-1, 1) for y in (0, 1) for z in (-1, 1)]
    sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    triangles = [[side[0], side[k], side[k + 1]] for side in sides for k in (1, 2)]
    obj(tmp_path / "pool.obj", corners, triangles)
    # Of a surface and one wall nothing is inside.
    obj(tmp_path / "open.obj", corners, triangles[6:8] + triangles[10:])
    pool = "type: mesh, name: pool, file: pool.obj, material: water"
    (concern,) = found(pool, BEAD, base=tmp_path)
    assert 'objects[1] "bead": is clear, and lies within objects[0] "pool"' in concern.text
    assert found(pool, BEAD.replace("[0,", "[1.3,"), base=tmp_path) == []
    assert found(pool.replace("pool.obj", "open.obj"), BEAD, base=tmp_path) == []

    group = f"groups:\n  beads:\n    - {{{BEAD}}}\n"
    placed = "type: instance, name: put, of: beads, transform: [{scale: 0.5}, {translate: [PLACE, 0, 0]}]"
    away = placed.replace("put", "away").replace("PLACE", "5")
    (concern,) = found(pool, away, placed.replace("PLACE", "0.5"), more=group, base=tmp_path)
    assert 'objects[2] "put": is clear, and lies within objects[0] "pool"' in concern.text
    assert found(pool, away, more=group, base=tmp_path) == []

    # The pool is in another place than in its group.
    group = group.replace("beads", "pools").replace(BEAD, pool)
    placed = "type: instance, name: put, of: pools, transform: [{translate: [7, 0, 0]}]"
    (concern,) = found(placed, BEAD.replace("[0,", "[7,"), more=group, base=tmp_path)
    assert 'objects[1] "bead": is clear, and lies within objects[0] "put"' in concern.text
    assert found(placed, BEAD, more=group, base=tmp_path) == []


def obj(path, vertices, faces):
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in np.asarray(vertices, float).tolist()]
    path.write_text("\n".join([*lines, *(f"f {a} {b} {c}" for a, b, c in (np.asarray(faces) + 1).tolist())]) + "\n")


def test_triangles_without_an_area_are_counted(tmp_path):
    vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0], [3, 1, 0]]
    obj(tmp_path / "rock.obj", vertices, [[0, 1, 2], [0, 1, 3], [1, 4, 2], [4, 4, 4]])
    (concern,) = found("type: mesh, file: rock.obj", base=tmp_path)
    assert "its file has 2 triangles without an area (the first is number 1, counted from 0)" in concern.text
    # A file that is fine may become too fine for float32 where it is placed: every second triangle is 1e-9 m high.
    heights = [[x, 1.0 + (x % 2) * (1e-9 if x < 6 else 1.0), 0.0] for x in range(12)]
    obj(tmp_path / "fine.obj", heights, [[k, k + 1, k + 2] for k in range(10)])
    (concern,) = found("type: mesh, file: fine.obj", base=tmp_path)
    assert "5 of its 10 faces have no area once its coordinates are rounded to float32" in concern.text


def test_pixels_too_small_for_float32():
    for vfov, kinds in (("0.001", []), ("0.0001", ["pixels too small for float32"])):
        text = HEAD.replace("EYE", "[0, 1.5, 6]").replace("vfov: 40", f"vfov: {vfov}") + f"objects: [{{{FLOOR}}}]\n"
        assert [item.kind for item in find_warnings(pack(build(text, "s.yaml")))] == kinds


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
    obj(tmp_path / "wire.obj", vertices, faces)
    assert found("type: mesh, file: wire.obj", base=tmp_path) == []
    # Every second side left out, the others are ribbons.
    obj(tmp_path / "ribbons.obj", vertices, [face for face in faces.tolist() if min(face) % 2])
    (concern,) = found("type: mesh, file: ribbons.obj", base=tmp_path)
    assert "faces are as narrow as 1.8e-06 m" in concern.text


def test_of_many_alike_ten_are_told():
    posters = [POSTER.replace("name: poster, corner: [0", f"corner: [{x}") for x in np.arange(-4.8, 4.2, 0.5)]
    sentences = warning_messages(found(WALL, *(item.replace("[[1, 0, 0]", "[[0.4, 0, 0]") for item in posters)))
    assert len(sentences) == MAX_PER_KIND + 1
    assert sentences[-1] == f"and {len(posters) - MAX_PER_KIND} more surfaces that coincide"


def test_the_order_of_objects_does_not_matter():
    (concern,) = found(POSTER, WALL)
    assert concern.text.startswith(
        's.yaml:14: objects[1] "wall": a surface of it coincides with one of objects[0] "poster"'
    )


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
    path.write_text(HEAD.replace("EYE", "[0, 1, 6]") + "objects:\n" + "".join(f"  - {{{item}}}\n" for item in objects))
    return path


def test_validate_warns_and_strict_refuses(tmp_path, capsys):
    bad = written(tmp_path, WALL, POSTER)
    assert main(["validate", str(bad)]) == 0
    captured = capsys.readouterr()
    assert captured.out == f"{bad}: valid\n"
    assert captured.err.startswith(f'rt: warning: {bad}:14: objects[1] "poster": ')
    assert main(["validate", "--strict", str(bad)]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith(f'rt: {bad}:14: objects[1] "poster": ')
    assert captured.err.count("\n") == 1


def test_strict_ends_a_render_before_it_begins(tmp_path, capsys):
    bad, out = (
        written(tmp_path, WALL, POSTER, BALL, BALL.replace("ball", "twin").replace("grey", "red")),
        tmp_path / "a.npy",
    )
    assert main(["render", str(bad), "-o", str(out), "--strict"]) == 2
    captured = capsys.readouterr()
    assert [line.split(": ")[2] for line in captured.err.splitlines()] == ['objects[1] "poster"', 'objects[3] "twin"']
    assert not out.exists()
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
    "type: sphere, center: [1, 2, 3], radius: 0.5",
    "type: disc, center: [1, 2, 3], normal: [1, 2, 2], radius: 0.5",
    "type: quad, corner: [1, 2, 3], edges: [[1, 0.3, 0], [0, 1, 2]]",
    "type: box, min: [1, 2, 3], max: [2, 4, 6]",
    "type: triangle, vertices: [[1, 2, 3], [2, 2, 3], [1, 4, 2]]",
    "type: mesh, file: rock.obj, smooth: true",
]


@pytest.mark.parametrize("shape", SHAPES)
def test_outlines_span_what_tables_hold(shape, tmp_path):
    obj(tmp_path / "rock.obj", [[1, 2, 3], [2, 2, 3], [1, 4, 2], [5, 5, 5]], [[0, 1, 2]])
    text = HEAD.replace("EYE", "[0, 1, 6]") + f"objects: [{{{shape}}}]\n"
    (table,) = pack(build(text, "s.yaml", base=tmp_path)).scene.primitives
    points = outline(table, 0, len(table.material))
    low, high = primitives.bounds(table)
    # A polygon in a disc falls short of its circle by 1 - cos(pi / 16).
    short = 0.02 * float(np.max(high - low)) if "disc" in shape else 0.0
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
