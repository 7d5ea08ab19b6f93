"""YAML to values: the core schema of YAML 1.2, places, aliases, and what is refused."""

import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from raytracer.schema import yaml_parser
from raytracer.schema.yaml_nodes import Node, SourceLocation, locate, override, parse_path, path_text
from raytracer.schema.yaml_parser import MAX_BYTES, parse, read
from raytracer.util.errors import SceneError


def value(text):
    root = parse(text, "f.yaml")
    assert root is not None
    return root.plain()


def complaint(text):
    with pytest.raises(SceneError) as caught:
        parse(text, "f.yaml")
    assert "\n" not in str(caught.value)
    return str(caught.value)


SCALARS = {
    float: "1e-3 = 0.001, 1. = 1.0, .5 = 0.5, inf = inf, .inf = inf, -.INF = -inf",
    int: "12 = 12, -12 = -12, 010 = 10, 0o10 = 8, 0x1F = 31, -0 = 0",
    str: "1:30 = 1:30, 1_000 = 1_000, 1/125 s = 1/125 s, 2026-01-01 = 2026-01-01, on = on, yes = yes, No = No, "
    "'12' = 12, \"true\" = true, + = +, infinity = infinity",
}


@pytest.mark.parametrize("kind", SCALARS)
def test_plain_scalars_follow_yaml_1_2(kind):
    for scalar in SCALARS[kind].split(", "):
        text, expected = scalar.split(" = ")
        result = value(f"a: {text}")["a"]
        assert result == kind(expected), text
        assert type(result) is kind


def test_truths_and_nothing():
    assert value("[true, False, ~, null]") == [True, False, None, None]


def test_nan_and_huge_integers_reach_the_checks_as_floats():
    assert math.isnan(value("a: .nan")["a"])
    assert value("a: 1" + "0" * 5000)["a"] == math.inf


TEXTS = st.text(st.characters(exclude_categories=["C", "Zl", "Zp"]), max_size=8)
PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | TEXTS,
    lambda below: st.lists(below, max_size=4) | st.dictionaries(TEXTS, below, max_size=4),
    max_leaves=20,
)


@given(PLAIN)
def test_json_is_yaml(data):
    assert value(json.dumps(data, ensure_ascii=False)) == data


def test_every_value_keeps_its_line():
    root = parse("a:\n  b: 1\n  c:\n    - 2\n    - {d: 3}\n", "f")
    assert root is not None
    lines = {path: locate(root, path)[0].line for path in [("a", "b"), ("a", "c", 0), ("a", "c", 1, "d"), ("a", "x")]}
    assert lines == {("a", "b"): 2, ("a", "c", 0): 4, ("a", "c", 1, "d"): 5, ("a", "x"): 1}


def test_type_names_that_are_no_keys_drop_out_of_a_path():
    root = parse("objects:\n- {type: sphere, radius: 1}\n- {type: box, box: 2}\n", "f")
    assert root is not None
    assert locate(root, ("objects", 0, "sphere", "radius"))[1] == ("objects", 0, "radius")
    assert locate(root, ("objects", 1, "box", "box"))[1] == ("objects", 1, "box")


def test_aliases_and_merges_expand():
    text = "base: &b {x: 1, y: 2}\nother: &o {y: 5, z: 6}\none: *b\ntwo: {<<: *b, y: 3}\nthree: {<<: [*b, *o]}\n"
    data = value(text)
    assert data["one"] == {"x": 1, "y": 2}
    assert data["two"] == {"x": 1, "y": 3}
    assert data["three"] == {"x": 1, "y": 2, "z": 6}


def test_an_alias_does_not_tie_overrides_together():
    root = parse("a: &a {x: 1}\nb: *a\n", "f")
    assert root is not None
    assert override(root, ("a", "x"), Node(SourceLocation(0), 7)).plain() == {"a": {"x": 7}, "b": {"x": 1}}


BOMB = "a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]\n" + "".join(
    f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 30)
)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (BOMB, "f.yaml:6: aliases expand to more than 1,000,000 values"),
        ("a: &a [*a]", "f.yaml:1: the alias *a stands inside what it names"),
        ("a: 1\nb: *c", "f.yaml:2: the alias *c has no anchor"),
        ("a: " + "[" * 64 + "]" * 64, "nested more than 64 levels"),
        ("a: " + "[" * 100_000, "nested more than 64 levels"),
        ("a: 1\nb: 2\na: 3", "f.yaml:3: the key 'a' is given twice, first on line 1"),
        ("a: !!python/object/apply:os.system [ls]", "python/object/apply:os.system' is refused"),
        ("a: !mine 3", "'!mine' is refused"),
        ("a: 1\n---\nb: 2", "f.yaml:2: a second document"),
        ("a: [1, 2\nb: 3", "not valid YAML"),
        ("a:\n\tb: 1", "f.yaml:2: not valid YAML: a character that cannot start a value (a tab"),
        ("? [1]\n: 2", "a key must be a plain string"),
        ("a: {<<: 3}", "<< must name a mapping"),
        ("a: \x07", "control character"),
    ],
)
def test_what_is_not_one_plain_document_is_refused(text, words):
    assert words in complaint(text)


def test_depth_counts_through_aliases():
    # Forty levels below an anchor, which stands thirty levels deep where it is used.
    nested = "a: &a " + "[" * 40 + "]" * 40 + "\nb: " + "[" * 30 + "*a" + "]" * 30
    assert "nested more than 64 levels" in complaint(nested)


def test_a_long_list_without_aliases_is_no_bomb(monkeypatch):
    monkeypatch.setattr(yaml_parser, "MAX_EXPANDED", 100)
    assert len(value("a: [" + "1," * 1000 + "]")["a"]) == 1000
    assert len(value("a: &a [" + "1," * 60 + "]\nb: *a")["b"]) == 60
    assert "aliases expand" in complaint("a: &a [" + "1," * 60 + "]\nb: [*a, *a, *a]")


def test_paths_read_back():
    assert parse_path("objects[3].radius") == parse_path("objects.3.radius") == ("objects", "3", "radius")
    assert parse_path("objects.red ball.radius") == ("objects", "red ball", "radius")
    assert path_text(("objects", 3, "center", 0)) == "objects[3].center[0]"
    for wrong in ["", ".a", "a..b", "a[", "a[x]", "a.", "[]"]:
        with pytest.raises(ValueError, match="is not a path"):
            parse_path(wrong)


def test_a_mark_of_byte_order_is_no_text(tmp_path):
    (tmp_path / "bom").write_bytes(b"\xef\xbb\xbfa: 1")
    assert read(str(tmp_path / "bom")) == "a: 1"


def test_a_file_that_is_too_large_is_not_read_to_its_end(tmp_path):
    with open(tmp_path / "large", "wb") as stream:
        stream.truncate(MAX_BYTES + 1)
    with pytest.raises(SceneError, match="larger than 64 MB"):
        read(str(tmp_path / "large"))
