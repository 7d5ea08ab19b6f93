"""Reports in words: every number is the study's."""

import re

import pytest

from raytracer.analysis.lens_design import text
from raytracer.analysis.lens_design.performance.lens_study import study_lens
from tests.analysis.lens_design.benches import QUICK, cylinder_pair, shipped


@pytest.fixture(scope="module")
def gauss():
    return study_lens(shipped("double-gauss-50mm"), QUICK)


def number(line):
    return float(re.search(r"[−-]?\d+\.?\d*", line)[0].replace("−", "-"))


def test_the_summary_is_the_study(gauss):
    rows = (re.split(r"  +", line.strip(), maxsplit=1) for line in text.summary(gauss).splitlines())
    said = {row[0]: number(row[1]) for row in rows if len(row) > 1 and re.search(r"\d", row[1])}
    said |= {row[0]: number(row[1]) for row in text.aberrations(gauss)}
    first = gauss.first_order[0]
    for name, value, error in (
        ("focal length", first.focal_length_mm, 1e-5),
        ("back focus", first.back_focus_mm, 1e-5),
        ("front focal point F", first.front_focus_z_mm, 1e-5),
        ("entrance pupil's diameter", first.entrance_pupil_diameter_mm, 1e-5),
        ("working f-number", first.working_f_number, 1e-3),
        ("field of view, diagonal", first.field_of_view_diagonal_deg, 1e-4),
        ("longitudinal colour", gauss.colour[0].axial_between_ends_mm, 0.01),
        ("distortion", gauss.distortion[0].percent[-1], 0.01),
        ("focus, sagittal", gauss.field_curvature[0].sagittal_mm[0, -1], 0.01),
        ("relative illumination", 100.0 * gauss.illumination[0].relative[-1], 0.01),
    ):
        assert said[name] == pytest.approx(value, rel=error), name
    head, *spots = text.spots(gauss)
    assert len(spots) == 3
    assert number(spots[1][head.index("RMS")]) == pytest.approx(gauss.spots[1].rms_um, rel=0.01)


def test_the_sums_are_under_their_surfaces(gauss):
    table = text.seidel(gauss)
    columns = [[number(row.cells[column]) for row in table.rows] for column in range(7)]
    for column in columns:
        assert sum(column[:-1]) == pytest.approx(column[-1], abs=0.01 * len(column))
    assert columns[0][-1] == pytest.approx(1000.0 * gauss.seidel.total_spherical, abs=0.006)


def test_a_lens_with_cylinders_has_two_of_each_but_no_sums():
    found = study_lens(cylinder_pair(), QUICK)
    assert text.seidel(found) is None
    said = text.summary(found)
    assert "\nSeidel sums: not defined" in said
    for meridian, distortion in zip("yx", found.distortion, strict=True):
        for title in ("First order", "Aberrations", "Spots, of all wavelengths together"):
            assert f"\n{title}, in the plane of {meridian}\n" in said
        rows = {row[0]: row[1] for row in text.aberrations(found, meridian)}
        assert number(rows["distortion"]) == pytest.approx(distortion.percent[-1], rel=0.01)
