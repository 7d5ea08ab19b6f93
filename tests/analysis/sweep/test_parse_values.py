"""Texts that stand for values: lists, ranges, and their errors."""

import math

import numpy as np
import pytest

from raytracer.analysis.sweep.parse_values import parse_value, parse_value_text
from raytracer.util.errors import SceneError


def _axis(text, key="camera.focus_distance"):
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
        ("it's,that's", ("it's", "that's")),
        # Exact decimals: binary steps would give 0.30000000000000004.
        ("0.1:0.7:7", (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7)),
        ("10:2:5", (10, 8, 6, 4, 2)),
        ("0:1:4", (0, 1 / 3, 2 / 3, 1)),
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
    found = _axis(text).values
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
    assert _axis(text).labels == labels


def test_labels_of_long_values_differ():
    labels = _axis(f"{'a' * 60}b,{'a' * 60}c").labels
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
        ("2:1e1000000000:3", "'1e1000000000' is no finite number"),
        ("1/1e999999999:2:3", "'1/1e999999999' is no finite number"),
        ("2:1/1e-999999999:3", "divides by zero"),
        ("2:1e200/1e-200:3", "too large, or too far apart"),
        ("1:2:1000000000", "more than 100000 values"),
        ("-1:1:3:log", "logarithmic"),
        ("2 m:3 s:3", "no units of one kind"),
        ("1,,2", "empty value"),
        ("2,2.0", "the value 2.0 twice"),
        ("1:3:3,2", "the value 2 twice"),
    ],
)
def test_what_is_wrong_is_said(text, says):
    with pytest.raises(ValueError, match=says.replace("(", r"\(")):
        _axis(text)


def test_a_value_that_is_not_yaml_names_its_option():
    with pytest.raises(SceneError, match=r"-D camera.look_from=\[1,0: not valid YAML"):
        _axis("[1,0", "camera.look_from")


def test_lists_arrays_and_ranges_of_python_are_axes():
    assert parse_value("k", np.linspace(0.0, 1.0, 3), "k").axis.values == (0.0, 0.5, 1.0)
    assert parse_value("k", range(3), "k").axis.values == (0, 1, 2)
    assert parse_value("k", ("2 m", [1, 0, 0], None), "k").axis.labels == ("2 m", "[1, 0, 0]", "null")
    assert parse_value("k", 1.0 / 3.0, "k").fixed
    with pytest.raises(ValueError, match="no values"):
        parse_value("k", [], "k")


def test_a_list_of_python_holds_values_and_no_ranges():
    assert parse_value("k", ["1:2:3", "a,b"], "k").axis.values == ("1:2:3", "a,b")
