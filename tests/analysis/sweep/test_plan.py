"""From texts and files to axes, and from axes to points: lists, ranges, stops, names, and what is wrong."""

import itertools
import math

import numpy as np
import pytest

from raytracer.analysis.sweep.exposure_stops import STOP_SCALES
from raytracer.analysis.sweep.parse_values import parse_value, parse_value_text
from raytracer.analysis.sweep.plan import enumerate_points, make_plan, parse_definitions
from raytracer.analysis.sweep.results import Axis, PointResult, Sweep
from raytracer.scene.load import load
from raytracer.util.errors import InputError, SceneError

SCENE = """\
camera: {type: thin_lens, look_from: [0, 0, 5], look_at: [0, 0, 0], sensor: full_frame, focal_length: 50 mm}
film: {width: 8, height: 6}
environment: {type: constant, radiance: 1}
objects: [{type: sphere, name: ball, center: [0, 0, 0], radius: 1, material: {type: lambertian, albedo: 0.5}}]
"""


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE)
    return path


def sweep_file(scene, text):
    path = scene.parent / "sweep.yaml"
    path.write_text(text)
    return path


def test_single_values_are_the_same_for_all_points(scene):
    for given in (scene, load(scene)):
        plan = make_plan(given, {"camera.f_number": "2,4", "film.width": "16", "film.height": 12})
        assert [(axis.key, axis.values) for axis in plan.axes] == [("camera.f_number", (2, 4))]
        assert (plan.spec.film.width, plan.spec.film.height) == (16, 12)


def test_a_file_of_a_sweep(scene):
    axes = "{camera.f_number: 1.4..4, camera.focus_distance: [4, 1/2 m, inf]}"
    define = "{film.width: 16, camera.look_at: [0, 1, 0]}"
    plan = make_plan(sweep_file(scene, f"{{scene: scene.yaml, define: {define}, sweep: {axes}, zip: false}}"), {})
    assert plan.spec.film.width == 16
    assert plan.spec.camera.look_at == (0.0, 1.0, 0.0)
    assert [axis.labels for axis in plan.axes] == [("1.4", "2", "2.8", "4"), ("4", "1/2 m", "inf")]
    assert plan.name == str(scene)
    assert not plan.zipped


def test_options_stand_in_place_of_what_the_file_says(scene):
    path = sweep_file(scene, "{scene: scene.yaml, sweep: {camera.f_number: '1.4,2'}, zip: true}")
    plan = make_plan(path, {"camera.f_number": "8,11", "camera.focus_distance": "1,2"})
    assert [axis.values for axis in plan.axes] == [(8, 11), (1, 2)]
    assert plan.zipped


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("scene: scene.yaml\nsweep:\n  camera.f_number: 2:10\n", r"sweep\.yaml:3: sweep\.camera\.f_number: .* count"),
        ("scene: scene.yaml\nsweep: {camera.f_number: []}\n", r"sweep\.yaml:2: sweep\.camera\.f_number: has no values"),
        ("scene: scene.yaml\nsweep:\n  a: [1, 2]\nzp: true\n", r"sweep\.yaml:4: zp: .* did you mean 'zip'"),
        ("scene: scene.yaml\nsweep: [1]\n", r"sweep\.yaml:2: sweep: must be a mapping"),
        ("sweep: {a: [1, 2]}\n", r"sweep\.yaml:1: scene: is missing"),
        ("sweep: {a: [1, 2]}\nscene: none.yaml\n", r"sweep\.yaml:2: scene: there is no file 'none.yaml'"),
        ("scene: scene.yaml\nsweep:\n  a..b: [1, 2]\n", r"sweep\.yaml:3: sweep\.a\.\.b: .* is not a path"),
        (
            "scene: scene.yaml\ndefine: {a: 1}\nsweep: {a: [1, 2]}\n",
            r"sweep\.yaml:3: sweep\.a: 'a' is under define too",
        ),
        ("scene: scene.yaml\ndefine: {film.with: 1}\nsweep: {film.height: [1, 2]}\n", r"did you mean 'width'"),
    ],
)
def test_errors_name_file_and_line(scene, text, says):
    with pytest.raises(SceneError, match=says):
        make_plan(sweep_file(scene, text), {})


@pytest.mark.parametrize("section", ["sweep", "define"])
def test_a_file_of_thousands_of_keys_is_refused_at_once(scene, section):
    keys = ", ".join(f"camera.k{i}: 1" for i in range(20_000))
    other = "define" if section == "sweep" else "sweep"
    path = sweep_file(scene, f"scene: scene.yaml\n{section}: {{{keys}}}\n{other}: {{camera.f_number: [2, 4]}}\n")
    with pytest.raises(SceneError, match=rf"sweep\.yaml:2: {section}: must hold at most 1000 values"):
        make_plan(path, {})


def test_a_scene_that_needs_a_key_may_get_it_from_an_axis(scene):
    scene.write_text(SCENE.replace("width: 8, ", ""))
    with pytest.raises(SceneError, match=r"film\.width: is missing"):
        load(scene)
    assert make_plan(scene, {"film.width": "8,16"}).spec.film.width == 8


def test_options_that_are_none(scene):
    for definitions, says in ((["camera.vfov"], "must be key.path=values"), (["a=1,2", "a=3"], "a is given twice")):
        with pytest.raises(InputError, match=says):
            parse_definitions(definitions)
    with pytest.raises(InputError, match=r"^-D camera.f_number=2:10: is a range without a count"):
        make_plan(scene, {"camera.f_number": "2:10"})
    with pytest.raises(InputError, match=r"^-D camera..f_number=2,3: 'camera..f_number' is not a path"):
        make_plan(scene, {"camera..f_number": "2,3"})


def axes_of(**texts):
    return [parse_value_text(key.replace("__", "."), text, "").axis for key, text in texts.items()]


def test_all_combinations_the_last_axis_fastest():
    points = enumerate_points(axes_of(camera__f_number="1.4,2", camera__focus_distance="1,2,3"))
    assert [point.index for point in points] == [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2)]
    assert points[4].values == {"camera.f_number": 2, "camera.focus_distance": 2}
    assert points[4].name == "f_number=2_focus_distance=2"
    pairs = enumerate_points(axes_of(camera__shutter="1/1000..1/125", camera__iso="800..100"), zipped=True)
    assert [point.index for point in pairs] == [(0, 0), (1, 1), (2, 2), (3, 3)]
    assert pairs[3].name == "shutter=1-125s_iso=100"


def test_a_sweep_says_in_a_line_what_it_is():
    axes = (Axis("camera.f_number", (1.4, 2), ("1.4", "2")), Axis("camera.vfov", (20,), ("20",)))
    first, second = enumerate_points(axes)
    taken = (PointResult(first, "done"), PointResult(second, "failed", "no lens"))
    assert repr(Sweep("a.yaml", axes, False, taken)) == (
        "<rt.Sweep of a.yaml: 2 camera.f_number x 1 camera.vfov, 1 done, 1 failed>"
    )


@pytest.mark.parametrize(
    ("axes", "options", "says"),
    [
        ({"a": "1,2", "b": "1,2,3"}, {"zipped": True}, r"a has 2, b has 3"),
        ({}, {}, "nothing to sweep"),
        ({"a": "1:2:1001"}, {}, r"1,001 points, more than the 1,000 that --max-points allows"),
        ({"a": "1:2:100", "b": "1:2:100"}, {}, r"10,000 points \(100 x 100\)"),
    ],
)
def test_what_makes_no_points_is_said(axes, options, says):
    with pytest.raises(InputError, match=says):
        enumerate_points(axes_of(**axes), **options)
    assert len(enumerate_points(axes_of(a="1:2:1001"), most=1001)) == 1001


def labelled(key, *labels):
    return Axis(key, labels, labels)


@pytest.mark.parametrize(
    ("axes", "names"),
    [
        # Letters that every file system takes.
        ([labelled("a.b", "[-1, 0, 2.5]", "C:\\x/y?*", "..", "-inf m")], ["b=-1,0,2.5", "b=C-x-y", "b=.3", "b=-infm"]),
        # Keys that end alike are named in full.
        (
            [labelled("objects[3].radius", "1"), labelled("objects[4].radius", "1"), labelled("x.y", "2")],
            ["objects.3.radius=1_objects.4.radius=1_y=2"],
        ),
        # A name that no file could have is a number.
        (
            [*(labelled(f"a.b{i}", "x" * 50) for i in range(4)), labelled("a.c", "x", "y")],
            ["point_1_1_1_1_1", "point_1_1_1_1_2"],
        ),
    ],
)
def test_names_of_files(axes, names):
    assert [point.name for point in enumerate_points(axes)] == names


@pytest.mark.parametrize(
    "axes",
    [
        [labelled("camera.focus_on", "Ball", "ball", "a/b", "a-b")],
        [labelled("camera.focus_on", "ball", "Ball", "ball.1")],
        [labelled("x.a", "1", "1_b=2"), labelled("x.b", "3", "2_b=3")],
    ],
)
def test_names_differ_whatever_values_are_called(axes):
    names = [point.name.casefold() for point in enumerate_points(axes)]
    assert len(set(names)) == len(names)


def axis_of(text, key="camera.focus_distance"):
    return parse_value_text(key, text, f"-D {key}={text}").axis


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("1.4,2,2.8", (1.4, 2, 2.8)),
        ("1/125 s,1/60 s", ("1/125 s", "1/60 s")),
        ("ball, cube", ("ball", "cube")),
        ("[1, 0, 0],[0,1,0]", ([1, 0, 0], [0, 1, 0])),
        ("{type: linear},{type: filmic, white: 4}", ({"type": "linear"}, {"type": "filmic", "white": 4})),
        ("'a,b',\"c:d\"", ("a,b", "c:d")),
        ("true,false", (True, False)),
        ("../a.hdr,b.hdr", ("../a.hdr", "b.hdr")),
        ("it's,that's", ("it's", "that's")),
        # Exact decimals: binary steps would give 0.30000000000000004.
        ("0.1:0.7:7", (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7)),
        ("10:2:5", (10, 8, 6, 4, 2)),
        ("0:1:4", (0, 1 / 3, 2 / 3, 1)),
        ("5:5:1", (5,)),
        ("-1:1:3", (-1, 0, 1)),
        ("1/4:1/2:2", (0.25, 0.5)),
        ("1:1000:4:log", (1, 10, 100, 1000)),
        ("-1:-100:3:log", (-1, -10, -100)),
        ("1:4:4,inf", (1, 2, 3, 4, math.inf)),
        ("1 cm:5 cm:3", ("1 cm", "3 cm", "5 cm")),
        ("1:5cm:3", ("1 cm", "3 cm", "5 cm")),
        ("50 mm:2 m:3", ("0.05 m", "1.025 m", "2 m")),
    ],
)
def test_a_text_stands_for_these_values(text, values):
    found = axis_of(text).values
    assert found == values
    assert [type(value) for value in found] == [type(value) for value in values]


@pytest.mark.parametrize(
    ("text", "labels"),
    [
        ("1.40,2.0,1e-3", ("1.40", "2.0", "1e-3")),
        ("0:1:4", ("0", "0.3333", "0.6667", "1")),
        ("1000:1001:3", ("1000", "1000.5", "1001")),
        # As many digits as tell them apart.
        ("1:1.000002:3", ("1", "1.000001", "1.000002")),
        ("1 cm:2 cm:4", ("1 cm", "1.333 cm", "1.667 cm", "2 cm")),
        ("[1,0,0],[0,1,0]", ("[1, 0, 0]", "[0, 1, 0]")),
        ("'a b',c", ("a b", "c")),
    ],
)
def test_labels_are_as_written_or_short(text, labels):
    assert axis_of(text).labels == labels


def test_labels_of_long_values_differ():
    labels = axis_of(f"{'a' * 60}b,{'a' * 60}c").labels
    assert len(set(labels)) == 2
    assert all(len(label) < 60 for label in labels)


def test_one_value_is_no_axis():
    for text in ("2", "ball", "[1, 0, 0]", "{type: box}", "1/125 s", ""):
        assert parse_value_text("camera.vfov", text, "").fixed
    for text in ("2,3", "2:2:1", "1:2:2"):
        assert not parse_value_text("camera.vfov", text, "").fixed


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("2:10", "a count: start:stop:count"),
        ("2:10:5:lin", "only 'log' may follow"),
        ("2:10:1", "different ends but a count of 1"),
        ("2:10:0", "empty range"),
        ("2:10:2.5", "must be an integer"),
        ("2:2:3", "equal ends"),
        ("2:x:5", "'x' is no finite number"),
        ("2:inf:5", "'inf' is no finite number"),
        ("2:1e400:3", "'1e400' is no finite number"),
        ("2:1e1000000000:3", "'1e1000000000' is no finite number"),
        ("1/1e999999999:2:3", "'1/1e999999999' is no finite number"),
        ("2:1/1e-999999999:3", "divides by zero"),
        ("2:1e200/1e-200:3", "too large, or too far apart"),
        ("1e-300:1e300:3:log", "too large, or too far apart"),
        ("1:2:1000000000", "more than 100000 values"),
        ("-1:1:3:log", "logarithmic"),
        ("0:1:3:log", "logarithmic"),
        ("1/0:3:3", "divides by zero"),
        ("2 m:3 s:3", "no units of one kind"),
        ("1,,2", "empty value"),
        ("1,2,", "empty value"),
        ("2,2.0", "the value 2.0 twice"),
        ("1:3:3,2", "the value 2 twice"),
        ("ball,ball", "the value ball twice"),
    ],
)
def test_what_is_wrong_is_said(text, says):
    with pytest.raises(ValueError, match=says.replace("(", r"\(")):
        axis_of(text)


def test_a_value_that_is_not_yaml_names_its_option():
    with pytest.raises(SceneError, match=r"-D camera.look_from=\[1,0: not valid YAML"):
        axis_of("[1,0", "camera.look_from")


def test_lists_arrays_and_ranges_of_python_are_axes():
    assert parse_value("k", np.linspace(0.0, 1.0, 3), "k").axis.values == (0.0, 0.5, 1.0)
    assert parse_value("k", range(3), "k").axis.values == (0, 1, 2)
    assert parse_value("k", ("2 m", [1, 0, 0], None), "k").axis.labels == ("2 m", "[1, 0, 0]", "null")
    assert parse_value("k", ["1:2:3", "a,b"], "k").axis.values == ("1:2:3", "a,b")
    assert parse_value("k", 1.0 / 3.0, "k").fixed
    with pytest.raises(ValueError, match="no values"):
        parse_value("k", [], "k")


@pytest.mark.parametrize(
    ("key", "text", "first", "step", "marks"),
    [
        # Each value is 2 to the power of `first`, `first` + `step` ...
        ("camera.f_number", "1.4..22", 1 / 2, 1 / 2, "1.4 2 2.8 4 5.6 8 11 16 22"),
        ("camera.f_number", "2..5.6/3", 1, 1 / 6, "2 2.2 2.5 2.8 3.2 3.5 4 4.5 5 5.6"),
        ("camera.f_number", "5.6..2/2", 5 / 2, -1 / 4, "5.6 4.8 4 3.3 2.8 2.4 2"),
        # Full stops may start at a third: f/1.8 is 5/3 stops from f/1.
        ("camera.f_number", "1.8..7.1", 5 / 6, 1 / 2, "1.8 2.5 3.5 5 7.1"),
        # Of f/12.7 and f/13.5 the same is engraved.
        ("camera.f_number", "13..16/3", 22 / 6, 1 / 6, "13 14 16"),
        ("camera.f_number", "13..16/2", 15 / 4, 1 / 4, "13 16"),
        ("camera.shutter", "1/1000..1/30", -10, 1, "1/1000s 1/500s 1/250s 1/125s 1/60s 1/30s"),
        ("camera.shutter", "1/250 s..1/60 s", -8, 1, "1/250s 1/125s 1/60s"),
        # One over eight is a time, and not an eighth of a stop.
        ("camera.shutter", "1..1/8", 0, -1, "1s 1/2s 1/4s 1/8s"),
        ("camera.iso", "100..3200", math.log2(100), 1, "100 200 400 800 1600 3200"),
        ("camera.iso", "100..400/3", math.log2(100), 1 / 3, "100 125 160 200 250 320 400"),
        # What is not engraved counts from its start; f/0.95 to f/3.8 are four stops, and a light doubles at each.
        ("camera.f_number", "0.95..3.8", math.log2(0.95), 1 / 2, "0.95 1.344 1.9 2.687 3.8"),
        ("camera.aperture", "2..8", 1, 1 / 2, "2 2.828 4 5.657 8"),
        ("lights[0].intensity", "3..24", math.log2(3), 1, "3 6 12 24"),
    ],
)
def test_stops_are_exact_and_have_the_numbers_that_are_engraved(key, text, first, step, marks):
    axis = parse_value_text(key, text, "").axis
    assert [label.replace(" ", "") for label in axis.labels] == marks.split()
    assert axis.values == pytest.approx([2.0 ** (first + step * k) for k in range(len(axis.values))], rel=4e-15)


def test_stops_that_double_or_halve_are_exact():
    assert axis_of("1.4..22", "camera.f_number").values[1::2] == (2, 4, 8, 16)
    assert axis_of("1/1000..1/30", "camera.shutter").values == tuple(2.0**k for k in range(-10, -4))
    assert axis_of("100..3200", "camera.iso").values == (100, 200, 400, 800, 1600, 3200)


def test_values_with_units_keep_them():
    assert parse_value_text("camera.shutter", "8 ms..1 ms", "").axis.values == ("8 ms", "4 ms", "2 ms", "1 ms")
    assert len(parse_value_text("camera.shutter", "1/1000..1/30/3", "").axis.values) == 16


@pytest.mark.parametrize("key", ["f_number", "shutter", "iso"])
@pytest.mark.parametrize("parts", [1, 2, 3])
def test_what_is_engraved_is_near_what_it_stands_for(key, parts):
    """Within a seventh of a stop by the standards' roundings, and in rising order: a slip in a table would show."""
    scale = STOP_SCALES[key]
    first, marks = scale.marks[parts]
    numbers = [eval(mark) for mark in marks.split()]
    assert all(a < b for a, b in itertools.pairwise(numbers))
    for i, number in enumerate(numbers):
        exact = scale.value((first + i) / parts)
        off = abs(math.log2(number / exact)) / float(scale.power)
        # 0.3 s is engraved for 0.35 s, 10 s for 11.3 s and 20 s for 22.6 s.
        assert off < (0.25 if key == "shutter" and parts == 2 else 1.0 / 6.0), (number, exact)


@pytest.mark.parametrize(
    ("text", "key", "says"),
    [
        ("1.4..20", "camera.f_number", "7.67 stops, which is not an integer number of full stops; end at 16 or 22"),
        ("1.4..22/5", "camera.f_number", "halves or thirds"),
        ("2..2", "camera.f_number", "ends are equal"),
        ("0..2", "camera.f_number", "greater than 0"),
        ("2..x", "camera.f_number", "'x' is no finite number"),
        ("1..10", "lights[0].intensity", "end at 8 or 16"),
        ("1..8", "objects.ball.radius", "stops, which are known of f_number"),
        ("1.4..22", "camera.f_nmber", "not known of 'f_nmber'; did you mean 'f_number'"),
        ("1.4...22", "camera.f_number", "has three dots"),
    ],
)
def test_ranges_that_are_no_stops(text, key, says):
    with pytest.raises(ValueError, match=says):
        parse_value_text(key, text, "")
