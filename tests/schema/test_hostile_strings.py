"""Texts made to take all time or memory, or to be printed raw: each would hang its test, or swamp a sentence."""

import math

import pytest

from raytracer.analysis.sweep.parse_values import parse_value, parse_value_text
from raytracer.cli.base.app import main
from raytracer.optics.glass import parse_glass
from raytracer.scene.assets import read_lens
from raytracer.scene.load import build, load
from raytracer.schema import yaml_parser
from raytracer.schema.units import parse_bytes, parse_duration, parse_percentage, parse_quantity
from raytracer.util.errors import InputError, closest_name, one_line

HEAD = "camera: {type: pinhole, look_from: [0, 0, 4], vfov: 40}\nfilm: {width: 8, height: 6}\n"
BALL = "objects: [{type: sphere, name: ball, center: [0, 0, 0], radius: 1}]\n"
MANY = 100_000


def complaint(work):
    with pytest.raises((InputError, ValueError)) as refused:
        work()
    return str(refused.value)


def told(text):
    sentence = complaint(lambda: build(text, "f.yaml"))
    assert sentence.startswith("f.yaml:")
    assert len(sentence) < 2500
    assert sentence.isprintable()
    return sentence


# ---- Sizes

_MATERIALS = "materials:\n  m0: {type: metal}\n"
_HUGE = "".join(chr(0x4E00 + i % 5000) for i in range(MANY))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        # Each of two of the one before: 2^60 in the end.
        (
            _MATERIALS + "".join(f"  m{i}: {{type: mixture, materials: [m{i - 1}, m{i - 1}]}}\n" for i in range(1, 60)),
            "makes one material of more than 10,000",
        ),
        (
            "materials:\n"
            + "".join(f"  m{i}: {{type: cutout, material: m{i + 1}}}\n" for i in range(2000))
            + "  m2000: {type: metal}\n",
            "more than 64 levels deep",
        ),
        ("a: &a {" + ",".join(f"k{i}: 1" for i in range(1000)) + "}\nb:\n" + "  <<: *a\n" * MANY, "<< is given twice"),
        ("".join(f"key{i}: 1\n" for i in range(20_000)), "f.yaml:4: key0: unknown key 'key0'"),
        ("lights:\n" + "  - {type: pont}\n" * 20_000, "f.yaml:5: lights[0].type: unknown type of light 'pont'"),
        ("materials:\n" + "".join(f"  m{i}: {{type: mtal}}\n" for i in range(5000)), "materials.m0.type: unknown type"),
        # To compare the letters of two long names takes the product of their lengths.
        (f"medium: {_HUGE}\nmedia:\n  ? {_HUGE[1:]}\n  : {{type: homogeneous, absorption: 1}}\n", "unknown medium"),
        (f"? {_HUGE}\n: 1\n", "unknown key"),
        ("render: {clamp: 0x" + "f" * MANY + "}\n", "render.clamp: must be finite"),
        ("render: {spp: " + "9" * MANY + "}\n", "render.spp: must be an integer"),
        ('render: {clamp: "' + "1" * MANY + 'x"}\n', "render.clamp: must be a number"),
        ('render: {clamp: "' + " " * MANY + 'x"}\n', "render.clamp: must be a number"),
        ("x: " + "{a: " * MANY, "nested more than 64 levels deep"),
        ("render: {clamp: ١٢}\n", "render.clamp: must be a number"),
    ],
)
def test_what_would_take_all_time_is_refused(text, words):
    assert words in told(HEAD + BALL + text)


def test_a_file_of_more_values_than_anybody_waits_for_is_refused(monkeypatch):
    monkeypatch.setattr(yaml_parser, "MAX_VALUES", 1000)
    build(HEAD + BALL, "f.yaml")
    assert "f.yaml:3: this is one of more than 1,000 values" in told(HEAD + "objects: [" + "1, " * 1000 + "]")


@pytest.mark.parametrize(
    "definition",
    [
        "a." * MANY + "a=1",
        f"objects[{'9' * 5000}].radius=1",
        "objects[١].radius=1",
        "camera.vfov=" + "[" * MANY,
        "camera.vfov=\x1b[2J",
        "camera.vfov=\udcff",
        "a\0b=1",
    ],
)
def test_options_are_no_safer_than_files(tmp_path, capsys, definition):
    (tmp_path / "f.yaml").write_text(HEAD + BALL)

    assert main(["explain", str(tmp_path / "f.yaml"), "-D", definition]) == 2

    sentence = capsys.readouterr().err
    assert sentence.startswith("rt: -D ")
    assert sentence.removesuffix("\n").isprintable()
    assert len(sentence) < 2500


# ---- Numbers


@pytest.mark.parametrize(
    ("parse", "text"),
    [
        (parse_duration, "1/" + "9" * MANY),
        (parse_percentage, "9" * MANY + "%"),
        (parse_percentage, "٥%"),
        (parse_bytes, "1e400 GB"),
        (parse_bytes, "9" * MANY),
        (lambda text: parse_quantity(text, "length"), "٣ mm"),
        (lambda text: parse_quantity(text, "length"), "1" * MANY + " mm x"),
        (parse_glass, "N-BK" + "7" * MANY),
        (parse_glass, "1e-300/1e300"),
    ],
)
def test_numbers_that_are_none_are_refused_shortly(parse, text):
    assert len(complaint(lambda: parse(text))) < 500


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("1:1e9:1e-9", "must be an integer"),
        ("0:1:1000000000", "more than 100000 values"),
        ("1e308:1e-308:3:log", "too far apart"),
        ("1e-300..1e300", "too far apart"),
        ("1:" + "9" * MANY + "x:3", "none needs more than"),
        ("1.." + " " * MANY + "x", "none needs more than"),
        ('"' + "'" * MANY, ""),
        ("0:1:٣", "must be an integer"),
    ],
)
def test_ranges_are_counted_before_they_are_made(text, words):
    assert words in complaint(lambda: parse_value_text("camera.intensity", text, "-D"))


def test_many_values_are_counted_in_no_time():
    given = parse_value("objects.ball.material", ["x" * 50 + str(number) for number in range(50_000)], "-D")
    assert len(set(given.axis.labels)) == 50_000
    values = parse_value_text("x", "1e-150:1e150:3:log", "-D").axis.values
    assert [math.log10(value) for value in values] == pytest.approx([-150, 0, 150])


# ---- Texts


@pytest.mark.parametrize(
    "text", ["\ufeff" + HEAD + BALL, (HEAD + BALL).replace("\n", "\r\n"), (HEAD + BALL).replace("\n", "\r")]
)
def test_marks_and_ends_of_lines_of_other_systems_are_read(tmp_path, text):
    (tmp_path / "f.yaml").write_bytes(text.encode())
    assert load(tmp_path / "f.yaml") == build(HEAD + BALL, "f.yaml")


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-be", "utf-32"])
def test_other_encodings_are_told(tmp_path, encoding):
    (tmp_path / "f.yaml").write_bytes((HEAD + BALL).encode(encoding))
    assert "f.yaml: is a binary file" in complaint(lambda: load(tmp_path / "f.yaml"))


@pytest.mark.parametrize("text", ['"\\e[31m": 1\n', 'medium: "\\e]0;title\\a"\n', '"a\\u202eb": 1\n', '"a\\nb": 1\n'])
def test_what_a_terminal_would_act_upon_is_written_out(text):
    assert "\\" in told(HEAD + BALL + text)


@pytest.mark.parametrize(
    ("text", "without"),
    [
        (HEAD + BALL.replace("ball", '"\\e[31mred"'), "\\e"),
        (HEAD + BALL + 'materials: {"\\x9b31mred": {type: metal}}\n', "\\x9b"),
        (HEAD.replace("40}", '"\\x07"}') + BALL, "\\x07"),
    ],
)
def test_names_hold_nothing_that_a_terminal_would_act_upon(text, without):
    assert "holds the control character '\\x" in told(text)
    assert "holds the control character" not in told(text.replace(without, "") + "x: 1")


LENSES = {
    ".zmx": "NAME a\x1b[31mb\nSURF 0\n  DISZ INFINITY\nSURF 1\n  CURV 0.02\n  DISZ 5\n  GLAS N-BK7\n  DIAM 5\nSURF 2\n"
    "  CURV -0.02\n  DISZ 90\n  DIAM 5\nSURF 3\n  DISZ 0\n",
    ".dat": "# a\x1b[31mb\n50 5 1.5 10\n-50 90 1 10\n",
}


@pytest.mark.parametrize("suffix", LENSES)
def test_names_of_imported_lenses_neither(tmp_path, suffix):
    (tmp_path / f"lens{suffix}").write_text(LENSES[suffix])
    assert read_lens(tmp_path / f"lens{suffix}").name == "a [31mb"


def test_a_long_sentence_keeps_its_beginning_and_its_end():
    sentence = one_line("begin " + "x" * MANY + " end")
    assert sentence.startswith("begin xxx")
    assert sentence.endswith("xxx end")
    assert len(sentence) < 2100
    # The nearest of names is found among long ones.
    assert closest_name("gold", ["x" * MANY, "old", "cold fish"]) == "old"
    assert closest_name("x" * MANY, ["x" * MANY + "y"]) is None
