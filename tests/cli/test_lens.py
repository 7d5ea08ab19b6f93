"""`rt lens`: what it prints and writes, and what it refuses."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from raytracer.cli.base.app import main
from raytracer.scene.assets.lenses import read_lens
from tests.analysis.lens_design.benches import SHIPPED

LENSES = {path.stem: str(path) for path in SHIPPED}
GAUSS = LENSES["double-gauss-50mm"]

SINGLET = """\
name: singlet
surfaces:
  - {type: flat, thickness: 5, material: 1.5, aperture: 20}
  - {type: spherical, radius: -50, aperture: 20}
"""

DAT = """\
# D-GAUSS F/2 22deg HFOV
# radius\taxpos\tN\taperture
29.475\t3.76\t1.67\t25.2
84.83\t0.12\t1\t25.2
0\t4.5\t0\t17.1
-39.73\t0\t1\t20
"""


PAGE = (Path(__file__).parents[2] / "docs" / "lenses.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("command", "lens"),
    [("lens LENS", "double-gauss-50mm"), ("lens distortion LENS --width 1920 -o wide.json", "wide-22mm")],
)
def test_the_page_on_lenses_shows_what_is_printed(command, lens, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(command.replace("LENS", LENSES[lens]).split()) == 0
    printed = _lines(capsys.readouterr().out)
    blocks = [text for language, text in re.findall(r"^```(\w*)\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)]
    (shown,) = (lines for lines in map(_lines, blocks) if lines[0] == printed[0])
    assert [line for line in shown if line not in {*printed, "..."}] == []
    assert command.replace("LENS", f"scenes/lenses/{lens}.yaml").partition(" -o ")[0] in PAGE


def _lines(text):
    """Split into lines, without the widths of columns, and without differences that rounding alone makes."""
    # A fit by least squares has six digits on every machine.
    rounded = re.sub(r"-?\d+\.\d{7,}", lambda number: f"{float(number[0]):.6g}", text)
    return [" ".join(re.sub(r"\S+e−1\d", "", line).split()) for line in rounded.splitlines()]


@pytest.fixture
def singlet(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "singlet.yaml").write_text(SINGLET)
    return "singlet.yaml"


def test_a_summary(singlet, capsys):
    assert main(["lens", singlet]) == 0
    out = capsys.readouterr().out
    assert out.startswith("singlet\n")
    assert re.search(r"^  focal length +100\.000 mm +100\.000 mm", out, re.MULTILINE)
    assert "Spots, of all wavelengths together" in out


def test_files_of_all_kinds(singlet, capsys):
    names = ["a/report.html", "section.svg", "section.png", "numbers.json"]
    assert main(["lens", singlet, *(part for name in names for part in ("-o", name))]) == 0
    captured = capsys.readouterr()
    assert captured.err.splitlines() == [f"wrote {name}" for name in names]
    starts = [b"<!doctype html>", b"<?xml", b"\x89PNG", b"{"]
    assert [Path(name).read_bytes()[: len(start)] for name, start in zip(names, starts, strict=True)] == starts
    # Of the spots' points only the file has them.
    points = json.loads(Path("numbers.json").read_text())["spots"][0]["spots"][0]["points_um"]
    assert len(points) > 100
    assert not list(Path().glob("**/.*.tmp"))


def test_json_is_all_of_the_output(capsys):
    arguments = ["--f-number", "4", "--focus-distance", "2m", "--sensor", "aps_c", "--wavelengths", "550, f ,656.3nm"]
    assert main(["lens", GAUSS, *arguments, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["settings"]["focus_distance_mm"] == 2000.0
    assert found["settings"]["sensor_mm"] == [23.6, 15.8]
    assert found["settings"]["wavelengths_nm"] == [550.0, 486.1327, 656.3]
    first = found["first_order"][0]
    assert first["f_number"] == pytest.approx(4.0, rel=0.02)
    assert first["magnification"] == pytest.approx(-50.0 / 1950.0, rel=0.05)


def test_a_small_lens_is_seen_on_a_small_film(capsys):
    assert main(["lens", "distortion", "--json", LENSES["phone-3.7mm"]]) == 0
    circle = read_lens(Path(LENSES["phone-3.7mm"])).image_circle
    assert circle is not None
    found = json.loads(capsys.readouterr().out)
    assert np.hypot(*found["sensor_mm"]) == pytest.approx(circle)
    assert found["film_mm"][-1] == pytest.approx(0.5 * circle, rel=1e-3)
    assert found["ideal_mm"][-1] is not None


def test_the_f_number_that_is_engraved_is_wide_open(capsys):
    """The double Gauss is called f/2, and opens to f/2.004."""
    assert main(["lens", "distortion", GAUSS, "--f-number", "2", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["f_number"] is None
    assert main(["lens", "distortion", GAUSS, "--f-number", "1.9"]) == 2
    assert "the lens opens to f/2.00" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ([], "Missing argument 'FILE'"),
        (["none.yaml"], "none.yaml: no such file"),
        (["singlet.yaml", "-o", "a.xyz"], "a.xyz: unknown suffix '.xyz' for a report on a lens; known: .html, .pdf"),
        (["singlet.yaml", "-o", "a"], "a: no suffix for a report on a lens"),
        (["singlet.yaml", "-o", "folder.html"], "folder.html: is a folder, not a file"),
        (["singlet.yaml", "--f-number", "0.5"], "singlet.yaml: the lens opens to f/"),
        (["singlet.yaml", "--f-number", "-1"], "--f-number -1: must be greater than 0"),
        (["singlet.yaml", "--focus-distance", "0"], "--focus-distance 0: must be greater than 0"),
        (["singlet.yaml", "--focus-distance", "3kg"], "--focus-distance 3kg: has the unknown unit 'kg'"),
        (["singlet.yaml", "--focus-distance", "5cm"], "singlet.yaml: the lens cannot focus at 50 mm"),
        (["singlet.yaml", "--sensor", "ful_frame"], "--sensor ful_frame: unknown sensor 'ful_frame'; did you mean"),
        (["singlet.yaml", "--sensor", "36x0"], "--sensor 36x0: must be larger than 0"),
        (["singlet.yaml", "--sensor", "36xa"], "--sensor a: must be a length in millimetres"),
        (["singlet.yaml", "--wavelengths", "d,x"], "--wavelengths d,x: must be wavelengths in nm, or the lines"),
        (["singlet.yaml", "--wavelengths", "200"], "--wavelengths 200: must be from 300 to 2500 nm"),
        (["singlet.yaml", "--wavelengths", "d,d"], "--wavelengths d,d: has d twice"),
        (["import", "singlet.yaml"], "singlet.yaml: is no lens of another program"),
        (["import", "none.dat"], "none.dat: no such file"),
        (["import", "gauss.dat", "-o", "a.txt"], "a.txt: a lens file is written as .yaml"),
        (["import", "a.zmx", "--thickness", "after"], "--thickness after: goes with tables, .dat; a.zmx says itself"),
        (["import", "gauss.dat", "--thickness", "both"], "Invalid value for '--thickness': 'both' is not"),
        (["import", "gauss.dat", "--glass", "SK16"], "--glass: must be NAME=INDEX/ABBE"),
        (["distortion", "singlet.yaml", "-o", "map.png"], "map.png: unknown suffix '.png' for a map of distortion"),
        (["distortion", "singlet.yaml", "--ideal", "round"], "Invalid value for '--ideal': 'round' is not"),
        (["distortion", "singlet.yaml", "--width", "1"], "Invalid value for '--width'"),
    ],
)
def test_what_is_wrong_is_one_sentence(singlet, arguments, sentence, capsys):
    Path("gauss.dat").write_text(DAT)
    Path("folder.html").mkdir()
    before = sorted(Path().iterdir())
    assert main(["lens", *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    (line,) = captured.err.splitlines()
    assert line.startswith(f"rt: {sentence}")
    assert sorted(Path().iterdir()) == before


def test_what_cannot_be_written_is_one_sentence(singlet, monkeypatch, capsys):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", full)
    assert main(["lens", singlet, "-o", "report.svg"]) == 1
    assert capsys.readouterr().err == "rt: report.svg: cannot be written: No space left on device\n"
    assert not list(Path().glob("*.svg")) + list(Path().glob(".*.tmp"))


def test_an_interrupt_ends_it_quietly(singlet, monkeypatch, capsys):
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("raytracer.analysis.lens_design.performance.lens_study.study_lens", interrupt)
    assert main(["lens", singlet, "-o", "report.svg"]) == 130
    assert capsys.readouterr().err == "rt: interrupted\n"
    assert not Path("report.svg").exists()


@pytest.mark.parametrize("command", [[], ["import"], ["distortion"]])
def test_help_shows_an_example(command, capsys):
    assert main(["lens", *command, "--help"]) == 0
    out = capsys.readouterr().out
    assert "Example" in out
    assert f"  rt lens {' '.join(command)}".rstrip() in out


def test_the_list_of_commands_has_it(capsys):
    assert main(["--help"]) == 0
    assert "  lens " in capsys.readouterr().out


def test_an_imported_lens_is_the_same_lens(singlet, capsys):
    Path("gauss.dat").write_text(DAT)
    assert main(["lens", "import", "gauss.dat", "-o", "gauss.yaml"]) == 0
    out, err = capsys.readouterr()
    reading = "thickness is read as that after each surface, since the last is 0; it has a focal length of 65.6289 mm"
    assert (out, err) == ("", f"gauss.dat: {reading}\nwrote gauss.yaml\n")
    ours, theirs = read_lens(Path("gauss.yaml")), read_lens(Path("gauss.dat"))
    assert ours.elements == theirs.elements
    assert main(["lens", "import", "gauss.dat"]) == 0
    assert capsys.readouterr().out == Path("gauss.yaml").read_text()


def test_distortion_as_text_files_and_json(singlet, capsys):
    names = ["map.npz", "opencv.yaml", "numbers.json"]
    outputs = [part for name in names for part in ("-o", name)]
    assert main(["lens", "distortion", GAUSS, "--width", "150", *outputs]) == 0
    captured = capsys.readouterr()
    assert captured.err.splitlines() == [f"wrote {name}" for name in names]
    assert captured.out.startswith("Double Gauss 50 mm f/2\n150 x 100 pixels of 240 µm\n")
    assert "pinhole: off by" in captured.out
    with np.load("map.npz") as arrays:
        assert arrays["map_x"].shape == arrays["inverse_y"].shape == (100, 150)
        assert arrays["map_x"].dtype == np.float32
    assert Path("opencv.yaml").read_text().startswith("%YAML:1.0\n---\n")
    assert main(["lens", "distortion", GAUSS, "--width", "150", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == json.loads(Path("numbers.json").read_text())


@pytest.mark.parametrize("command", [["lens"], ["lens", "import"], ["lens", "distortion", "--width", "90"]])
def test_a_table_that_is_read_the_wrong_way_is_warned_of(singlet, command, capsys):
    Path("gauss.dat").write_text(DAT)
    assert main(["lens", "import", "gauss.dat", "--thickness", "before", "-o", "wrong.yaml"]) == 0
    warning = "surfaces 1 and 2 go through each other within their apertures"
    assert f"rt: warning: gauss.dat: {warning}" in capsys.readouterr().err
    # As nobody says where it stands, a number in the last row leaves it to the surfaces.
    Path("filmed.dat").write_text(DAT.replace("-39.73\t0", "-39.73\t36"))
    for file, said in (("filmed.dat", "thickness is read as that after each surface, for"), ("wrong.yaml", warning)):
        if file.endswith(".dat") or command[-1] != "import":
            assert main([*command, file, "--quiet"]) == 0
            assert f"rt: warning: {file}: {said}" in capsys.readouterr().err


def test_a_warning_is_told_once_on_a_terminal_and_is_in_each_report(singlet, capsys):
    Path("gauss.dat").write_text(DAT)
    assert main(["lens", "import", "gauss.dat", "--thickness", "before", "-o", "wrong.yaml", "-q"]) == 0
    capsys.readouterr()
    warning = "surfaces 1 and 2 go through each other"
    assert main(["lens", "wrong.yaml", "-o", "wrong.json"]) == 0
    out, err = capsys.readouterr()
    assert (err.count(warning), " ".join(out.split()).count(warning)) == (1, 0)
    assert Path("wrong.json").read_text().count(warning) == 1
    assert main(["lens", "wrong.yaml", "--json"]) == 0
    out, err = capsys.readouterr()
    assert (err.count(warning), out.count(warning)) == (1, 1)
