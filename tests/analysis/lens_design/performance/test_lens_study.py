"""The whole study: every shipped lens, and lenses that lack something."""

import json
import math

import pytest

from raytracer.analysis.lens_design.performance.lens_study import study_lens
from raytracer.optics.glass import AIR, constant_index_glass
from raytracer.scene.assets.lenses import read_lens
from tests.analysis.lens_design.benches import QUICK, SHIPPED, cylinder_pair, lens_of, plano_convex, sensor, stop


def nones(value):
    if isinstance(value, dict):
        return sum(map(nones, value.values()))
    if isinstance(value, list):
        return sum(map(nones, value))
    return int(value is None)


def check(found):
    """Numbers that JSON can hold, and a reason for each that is missing."""
    given = found.as_dict(points=True)
    assert json.loads(json.dumps(given, allow_nan=False)) == given
    told = {note["topic"] for note in given["notes"]}
    for topic, value in given.items():
        assert not nones(value) or topic in told, topic
    return given


def test_a_lens_with_cylinders_has_two_of_each_and_no_seidel_sums():
    found = study_lens(cylinder_pair(), QUICK._replace(sensor_mm=(8.0, 6.0)))
    given = check(found)
    assert [row["meridian"] for row in given["distortion"]] == ["y", "x"]
    assert given["seidel"] is None
    assert any(note["topic"] == "seidel" for note in given["notes"])


def test_a_lens_that_is_dark_before_the_corner():
    # A long tube: the largest field is where light ends, and is said.
    tube = (0.0, 60.0, AIR, 4.0, {"kind": "flat"})
    lens = lens_of(tube, (0.01, 1.0, constant_index_glass(1.5), 4.0, {"is_stop": True}), (-0.01, 0.0, AIR, 4.0))
    given = check(study_lens(lens, QUICK._replace(sensor_mm=sensor(60.0))))
    assert given["first_order"][0]["half_field_image_height_mm"] < 30.0
    assert any("it is dark there" in note["reason"] for note in given["notes"])


def test_a_pinhole_of_a_stop():
    given = check(study_lens(plano_convex(), QUICK._replace(f_number=1000.0, wavelengths_nm=(550.0,))))
    assert given["first_order"][0]["working_f_number"] == pytest.approx(1000.0, rel=1e-3)
    assert any("acts as one" in note["reason"] for note in given["notes"])


GLASS = constant_index_glass(1.5)
FLAT = {"kind": "flat"}
FRONT, REAR = (0.02, 1e-6, GLASS, 10.0), (-0.02, 0.0, AIR, 10.0)


@pytest.mark.parametrize(
    "surfaces",
    [[stop(50.0, 2.0), (0.02, 1e-6, GLASS, 14.0), (-0.02, 0.0, AIR, 14.0)], [(0.05, 10.0, GLASS, 5.0)]],
    ids=["telecentric", "ends in glass"],
)
def test_lenses_that_lack_something(surfaces):
    check(study_lens(lens_of(*surfaces), QUICK))


@pytest.mark.parametrize(
    ("lens", "settings", "words"),
    [
        (plano_convex(), {"f_number": 0.5}, "opens"),
        (plano_convex(), {"focus_distance_mm": 90.0}, "nearest"),
        (plano_convex(), {"wavelengths_nm": ()}, "at least one wavelength"),
        (lens_of((0.0, 5.0, GLASS, 10.0, FLAT), (0.0, 0.0, AIR, 10.0, FLAT)), {}, "makes no image"),
        (lens_of(FRONT, (-0.02, 100.0 - 1e-6, AIR, 10.0), FRONT, REAR), {}, "makes no image"),
        (lens_of(FRONT, (-0.02, 150.0, AIR, 10.0), FRONT, REAR), {}, "upright"),
    ],
)
def test_what_is_impossible_is_said(lens, settings, words):
    with pytest.raises(ValueError, match=words):
        study_lens(lens, QUICK._replace(**settings))


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_shipped_lenses(path):
    lens = read_lens(path)
    found = study_lens(lens, QUICK._replace(steps=5, rays=8, fields=(0.0, 1.0)))
    first = found.first_order[0]
    assert first.focal_length_mm == pytest.approx(lens.focal_length, rel=5e-3)
    assert first.focal_length_traced_mm == pytest.approx(first.focal_length_mm, rel=1e-6)
    assert first.back_focus_traced_mm == pytest.approx(first.back_focus_mm, rel=1e-6)
    given = check(found)
    for row in given["first_order"]:
        assert row["half_field_deg"] > 5.0 if "telephoto" not in path.name else row["half_field_deg"] > 1.0
    assert given["spots"][0]["rms_um"] is not None
    assert "points_um" not in found.as_dict()["spots"][0]["spots"][0]


@pytest.mark.slow
@pytest.mark.parametrize("f_number", [8.0, 22.0])
@pytest.mark.parametrize("distance", [math.inf, 3000.0])
@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_shipped_lenses_stopped_down_and_near(path, f_number, distance):
    lens = read_lens(path)
    near = distance if lens.focal_length is None or lens.focal_length < 200.0 else 2.0 * distance
    given = check(study_lens(lens, QUICK._replace(f_number=f_number, focus_distance_mm=near)))
    assert given["first_order"][0]["f_number"] == pytest.approx(f_number, rel=0.1)
    assert all(value is not None for value in given["illumination"][0]["relative"])
