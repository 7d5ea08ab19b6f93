"""From axes to points, and what their files are called."""

import pytest

from raytracer.analysis.sweep.parse_values import parse_value_text
from raytracer.analysis.sweep.plan import enumerate_points
from raytracer.analysis.sweep.results import Axis, PointResult, Sweep
from raytracer.util.errors import InputError


def _axes(**texts):
    return [parse_value_text(key.replace("__", "."), text, "").axis for key, text in texts.items()]


def test_all_combinations_the_last_axis_fastest():
    points = enumerate_points(_axes(camera__f_number="1.4,2", camera__focus_distance="1,2,3"))
    assert [point.index for point in points] == [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2)]
    assert points[4].values == {"camera.f_number": 2, "camera.focus_distance": 2}
    assert points[4].name == "f_number=2_focus_distance=2"


def test_pairs():
    points = enumerate_points(_axes(camera__shutter="1/1000..1/125", camera__iso="800..100"), zipped=True)
    assert [point.index for point in points] == [(0, 0), (1, 1), (2, 2), (3, 3)]
    assert points[3].name == "shutter=1-125s_iso=100"


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
        enumerate_points(_axes(**axes), **options)
    assert len(enumerate_points(_axes(a="1:2:1001"), most=1001)) == 1001


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
        ([labelled(f"camera.key_{i}", "x" * 40) for i in range(5)], ["point_1_1_1_1_1"]),
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
