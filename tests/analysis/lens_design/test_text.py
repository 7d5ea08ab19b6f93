"""Reports in words: every number is the study's."""

import re

import pytest

from raytracer.analysis.lens_design import text
from raytracer.analysis.lens_design.performance.lens_study import LensStudy, study_lens
from raytracer.analysis.lens_design.performance.results import Settings
from raytracer.scene.assets.lenses import read_lens
from tests.analysis.lens_design.benches import SHIPPED, cylinder_pair

QUICK = Settings(steps=9, rays=12, fields=(0.0, 0.7, 1.0))
GAUSS = next(path for path in SHIPPED if path.stem == "double-gauss-50mm")


@pytest.fixture(scope="module")
def gauss() -> LensStudy:
    return study_lens(read_lens(GAUSS), QUICK)


def number(line: str) -> float:
    found = re.search(r"[−-]?\d+\.?\d*", line)
    assert found
    return float(found[0].replace("−", "-"))


def test_the_summary_says_the_first_order(gauss: LensStudy) -> None:
    first = gauss.first_order[0]
    rows = (re.split(r"  +", line.strip(), maxsplit=1) for line in text.summary(gauss).splitlines())
    lines = {row[0]: row[1] for row in rows if len(row) > 1}
    assert number(lines["focal length"]) == pytest.approx(first.focal_length_mm, rel=1e-5)
    assert number(lines["back focus"]) == pytest.approx(first.back_focus_mm, rel=1e-5)
    assert number(lines["front focal point F"]) == pytest.approx(first.front_focus_z_mm, rel=1e-5)
    assert number(lines["entrance pupil's diameter"]) == pytest.approx(first.entrance_pupil_diameter_mm, rel=1e-5)
    assert number(lines["working f-number"]) == pytest.approx(first.working_f_number, rel=1e-3)
    assert number(lines["field of view, diagonal"]) == pytest.approx(first.field_of_view_diagonal_deg, abs=0.006)


def test_the_summary_says_the_aberrations(gauss: LensStudy) -> None:
    rows = {row[0]: number(row[1]) for row in text.aberrations(gauss)}
    assert rows["longitudinal colour"] == pytest.approx(gauss.colour[0].axial_between_ends_mm, rel=0.01)
    assert rows["distortion"] == pytest.approx(gauss.distortion[0].percent[-1], rel=0.01)
    assert rows["focus, sagittal"] == pytest.approx(gauss.field_curvature[0].sagittal_mm[0, -1], rel=0.01)
    assert rows["relative illumination"] == pytest.approx(100.0 * gauss.illumination[0].relative[-1], rel=0.01)
    head, *spots = text.spots(gauss)
    assert len(spots) == 3
    assert number(spots[1][head.index("RMS")]) == pytest.approx(gauss.spots[1].rms_um, rel=0.01)


def test_the_sums_are_under_their_surfaces(gauss: LensStudy) -> None:
    table = text.seidel(gauss)
    assert table is not None
    columns = [[number(row.cells[column]) for row in table.rows] for column in range(7)]
    for column in columns:
        assert sum(column[:-1]) == pytest.approx(column[-1], abs=0.01 * len(column))
    assert gauss.seidel is not None
    assert columns[0][-1] == pytest.approx(1000.0 * gauss.seidel.total_spherical, abs=0.006)


def test_a_lens_with_cylinders_has_two_of_each_but_no_sums() -> None:
    found = study_lens(cylinder_pair(), QUICK)
    assert [table.title[-1] for table in text.first_order(found)] == ["y", "x"]
    assert text.seidel(found) is None
    said = text.summary(found)
    for title in ("First order", "Aberrations", "Spots, of all wavelengths together"):
        assert f"\n{title}, in the plane of y\n" in said
        assert f"\n{title}, in the plane of x\n" in said
    for meridian, distortion in zip("yx", found.distortion, strict=True):
        rows = text.aberrations(found, meridian)
        assert len({row[0] for row in rows}) == len(rows)
        assert len(text.spots(found, meridian)) == 1 + len(QUICK.fields)
        assert number({row[0]: row[1] for row in rows}["distortion"]) == pytest.approx(distortion.percent[-1], rel=0.01)
    assert "\nSeidel sums: not defined" in said
