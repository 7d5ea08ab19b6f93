"""`rt lens`: what it prints and writes, and what it refuses."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from raytracer.analysis.lens_design import page
from raytracer.cli import lens as command_of
from raytracer.scene.assets.lenses import read_lens
from tests.analysis.lens_design.benches import QUICK, SHIPPED

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
def test_the_page_on_lenses_shows_what_is_printed(command, lens, here, rt):
    printed = _lines(rt(command.replace("LENS", LENSES[lens])).out)
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
def coarse(monkeypatch):
    """Study lenses by few rays, and draw the first group of charts alone."""
    fit, groups = command_of._fit_settings, page.chart_groups
    few = {name: getattr(QUICK, name) for name in ("steps", "rays", "fields")}
    monkeypatch.setattr(command_of, "_fit_settings", lambda *given: fit(*given)._replace(**few))
    monkeypatch.setattr(page, "chart_groups", lambda study: groups(study)[:1])


@pytest.fixture
def singlet(here, coarse):
    (here / "singlet.yaml").write_text(SINGLET)
    (here / "gauss.dat").write_text(DAT)


def test_files_of_all_kinds_beside_a_summary(singlet, rt):
    names = ["a/report.html", "section.svg", "section.png", "numbers.json"]
    captured = rt("lens", "singlet.yaml", *(part for name in names for part in ("-o", name)))
    assert captured.err.splitlines() == [f"wrote {name}" for name in names]
    assert captured.out.startswith("singlet\n")
    assert re.search(r"^  focal length +100\.000 mm +100\.000 mm", captured.out, re.MULTILINE)
    assert "Spots, of all wavelengths together" in captured.out
    starts = [b"<!doctype html>", b"<?xml", b"\x89PNG", b"{"]
    assert [Path(name).read_bytes()[: len(start)] for name, start in zip(names, starts, strict=True)] == starts
    # Of the spots' points only the file has them.
    points = json.loads(Path("numbers.json").read_text())["spots"][0]["spots"][0]["points_um"]
    assert len(points) > 100
    assert not list(Path().glob("**/.*.tmp"))


def test_json_is_all_of_the_output(coarse, rt):
    arguments = "--f-number 4 --focus-distance 2m --sensor aps_c --wavelengths '550, f ,656.3nm'"
    found = json.loads(rt(f"lens {GAUSS} {arguments} --json").out)
    assert found["settings"]["focus_distance_mm"] == 2000.0
    assert found["settings"]["sensor_mm"] == [23.6, 15.8]
    assert found["settings"]["wavelengths_nm"] == [550.0, 486.1327, 656.3]
    first = found["first_order"][0]
    assert first["f_number"] == pytest.approx(4.0, rel=0.02)
    assert first["magnification"] == pytest.approx(-50.0 / 1950.0, rel=0.05)


def test_a_small_lens_is_seen_on_a_small_film(rt):
    circle = read_lens(Path(LENSES["phone-3.7mm"])).image_circle
    found = json.loads(rt(f"lens distortion --json {LENSES['phone-3.7mm']}").out)
    assert np.hypot(*found["sensor_mm"]) == pytest.approx(circle)
    assert found["film_mm"][-1] == pytest.approx(0.5 * circle, rel=1e-3)
    assert found["ideal_mm"][-1] is not None


def test_the_f_number_that_is_engraved_is_wide_open(rt, refused):
    """The double Gauss is called f/2, and opens to f/2.004."""
    assert json.loads(rt(f"lens distortion {GAUSS} --width 90 --f-number 2 --json").out)["f_number"] is None
    assert "the lens opens to f/2.00" in refused(f"lens distortion {GAUSS} --f-number 1.9")


@pytest.mark.parametrize(
    ("error", "status", "said"),
    [
        (OSError(28, "No space left on device"), 1, "report.svg: cannot be written: No space left on device"),
        (KeyboardInterrupt, 130, "interrupted"),
    ],
)
def test_what_cannot_be_written_is_one_sentence(singlet, error, status, said, monkeypatch, refused):
    def fail(*_):
        raise error

    monkeypatch.setattr("os.replace", fail)
    assert refused("lens singlet.yaml -o report.svg", status=status) == f"rt: {said}\n"


def test_an_imported_lens_is_the_same_lens(singlet, rt):
    out, err = rt("lens import gauss.dat -o gauss.yaml")
    reading = "thickness is read as that after each surface, since the last is 0; it has a focal length of 65.6289 mm"
    assert (out, err) == ("", f"gauss.dat: {reading}\nwrote gauss.yaml\n")
    ours, theirs = read_lens(Path("gauss.yaml")), read_lens(Path("gauss.dat"))
    assert ours.elements == theirs.elements
    assert rt("lens import gauss.dat").out == Path("gauss.yaml").read_text()


def test_distortion_as_text_files_and_json(singlet, rt):
    names = ["map.npz", "opencv.yaml", "numbers.json"]
    captured = rt(f"lens distortion {GAUSS} --width 150 -o map.npz -o opencv.yaml -o numbers.json")
    assert captured.err.splitlines() == [f"wrote {name}" for name in names]
    assert captured.out.startswith("Double Gauss 50 mm f/2\n150 x 100 pixels of 240 µm\n")
    assert "pinhole: off by" in captured.out
    with np.load("map.npz") as arrays:
        assert arrays["map_x"].shape == arrays["inverse_y"].shape == (100, 150)
        assert arrays["map_x"].dtype == np.float32
    assert Path("opencv.yaml").read_text().startswith("%YAML:1.0\n---\n")
    printed = rt(f"lens distortion {GAUSS} --width 150 --json").out
    assert json.loads(printed) == json.loads(Path("numbers.json").read_text())


def test_a_table_that_is_read_the_wrong_way_is_warned_of_once(singlet, rt):
    crossing = "surfaces 1 and 2 go through each other within their apertures"
    said = rt("lens import gauss.dat --thickness before -o wrong.yaml").err
    assert f"rt: warning: gauss.dat: {crossing}" in said
    said = rt("lens distortion --width 90 wrong.yaml --quiet").err
    assert f"rt: warning: wrong.yaml: {crossing}" in said
    # On a terminal once, and in each report.
    out, err = rt("lens wrong.yaml -o wrong.json")
    assert (err.count(crossing), " ".join(out.split()).count(crossing)) == (1, 0)
    assert Path("wrong.json").read_text().count(crossing) == 1
    out, err = rt("lens wrong.yaml --json")
    assert (err.count(crossing), out.count(crossing)) == (1, 1)
    # As nobody says where it stands, a number in the last row leaves it to the surfaces.
    Path("filmed.dat").write_text(DAT.replace("-39.73\t0", "-39.73\t36"))
    for command in ("lens", "lens import", "lens distortion --width 90"):
        reading = "rt: warning: filmed.dat: thickness is read as that after each surface, for"
        assert reading in rt(f"{command} filmed.dat --quiet").err
