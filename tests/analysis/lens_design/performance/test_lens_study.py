"""The whole study: every shipped lens, and lenses that lack something."""

import json
import math
from pathlib import Path
from typing import Any

import pytest

from raytracer.analysis.lens_design.performance.lens_study import LensStudy, study_lens
from raytracer.analysis.lens_design.performance.results import Settings
from raytracer.optics.glass import AIR, constant_index_glass
from raytracer.scene.assets.lenses import read_lens
from tests.analysis.lens_design.benches import SHIPPED, cylinder_pair, lens_of, plano_convex, sensor

QUICK = Settings(steps=9, rays=16, fields=(0.0, 0.7, 1.0))


def nones(value: Any) -> int:
    if isinstance(value, dict):
        return sum(map(nones, value.values()))
    if isinstance(value, list):
        return sum(map(nones, value))
    return int(value is None)


def check(found: LensStudy) -> dict[str, Any]:
    """Numbers that JSON can hold, and a reason for each that is missing."""
    given = found.as_dict(points=True)
    assert json.loads(json.dumps(given, allow_nan=False)) == given
    told = {note["topic"] for note in given["notes"]}
    for topic, value in given.items():
        assert not nones(value) or topic in told, topic
    return given


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_shipped_lenses(path: Path) -> None:
    given = check(study_lens(read_lens(path), QUICK))
    for row in given["first_order"]:
        assert row["half_field_deg"] > 5.0 if "telephoto" not in path.name else row["half_field_deg"] > 1.0
    assert given["spots"][0]["rms_um"] is not None
    assert "points_um" not in study_lens(read_lens(path), QUICK).as_dict()["spots"][0]["spots"][0]


@pytest.mark.slow
@pytest.mark.parametrize("f_number", [8.0, 22.0])
@pytest.mark.parametrize("distance", [math.inf, 3000.0])
@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_shipped_lenses_stopped_down_and_near(path: Path, f_number: float, distance: float) -> None:
    lens = read_lens(path)
    near = distance if lens.focal_length is None or lens.focal_length < 200.0 else 2.0 * distance
    given = check(study_lens(lens, QUICK._replace(f_number=f_number, focus_distance_mm=near)))
    assert given["first_order"][0]["f_number"] == pytest.approx(f_number, rel=0.1)
    assert all(value is not None for value in given["illumination"][0]["relative"])


def test_a_lens_without_a_stop() -> None:
    given = check(study_lens(plano_convex(), QUICK))
    assert any("acts as one" in note["reason"] for note in given["notes"])


def test_a_lens_with_cylinders_has_two_of_each_and_no_seidel_sums() -> None:
    found = study_lens(cylinder_pair(), QUICK._replace(sensor_mm=(8.0, 6.0)))
    given = check(found)
    assert [row["meridian"] for row in given["distortion"]] == ["y", "x"]
    assert given["seidel"] is None
    assert any(note["topic"] == "seidel" for note in given["notes"])


def test_a_lens_that_is_dark_before_the_corner() -> None:
    # A long tube: the largest field is where light ends, and is said.
    tube = (0.0, 60.0, AIR, 4.0, {"kind": "flat"})
    lens = lens_of(tube, (0.01, 1.0, constant_index_glass(1.5), 4.0, {"is_stop": True}), (-0.01, 0.0, AIR, 4.0))
    given = check(study_lens(lens, QUICK._replace(sensor_mm=sensor(60.0))))
    assert given["first_order"][0]["half_field_image_height_mm"] < 30.0
    assert any("it is dark there" in note["reason"] for note in given["notes"])


def test_a_pinhole_of_a_stop() -> None:
    given = check(study_lens(plano_convex(), QUICK._replace(f_number=1000.0)))
    assert given["first_order"][0]["working_f_number"] == pytest.approx(1000.0, rel=1e-3)


def test_a_telecentric_lens_and_one_that_ends_in_glass() -> None:
    glass = constant_index_glass(1.5)
    stop = (0.0, 50.0, AIR, 2.0, {"kind": "flat", "is_stop": True})
    check(study_lens(lens_of(stop, (0.02, 1e-6, glass, 14.0), (-0.02, 0.0, AIR, 14.0)), QUICK))
    check(study_lens(lens_of((0.05, 10.0, glass, 5.0)), QUICK))


def test_one_wavelength_is_enough() -> None:
    check(study_lens(plano_convex(), QUICK._replace(wavelengths_nm=(550.0,))))
    with pytest.raises(ValueError, match="at least one wavelength"):
        study_lens(plano_convex(), QUICK._replace(wavelengths_nm=()))


def test_what_is_impossible_is_said() -> None:
    with pytest.raises(ValueError, match="opens"):
        study_lens(plano_convex(), QUICK._replace(f_number=0.5))
    glass = constant_index_glass(1.5)
    one, other = (
        ((0.02, 1e-6, glass, 10.0), (-0.02, 100.0 - 1e-6, AIR, 10.0)),
        ((0.02, 1e-6, glass, 10.0), (-0.02, 0.0, AIR, 10.0)),
    )
    with pytest.raises(ValueError, match="makes no image"):
        study_lens(lens_of(*one, *other), QUICK)
    with pytest.raises(ValueError, match="upright"):
        study_lens(lens_of(one[0], (-0.02, 150.0, AIR, 10.0), *other), QUICK)
    with pytest.raises(ValueError, match="nearest"):
        study_lens(plano_convex(), QUICK._replace(focus_distance_mm=90.0))
