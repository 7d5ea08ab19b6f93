"""Distortion: lenses that have none, and known projections."""

import math

import numpy as np
import pytest

from raytracer.analysis.lens_design.performance.chief_rays import chief_rays_at_fields, chief_rays_at_heights
from raytracer.analysis.lens_design.performance.field_aberrations import distortion
from raytracer.analysis.lens_design.performance.first_order import first_order
from raytracer.analysis.lens_design.performance.optical_bench import set_up_bench
from raytracer.optics.glass import AIR, constant_index_glass
from raytracer.scene.assets.lenses import read_lens
from tests.analysis.lens_design.benches import SHIPPED, bench_at, cylinder_pair, lens_of, sensor, stop, symmetric_lens


def test_a_symmetric_lens_at_life_size_has_none() -> None:
    # The chief ray leaves it as it comes in, upside down: so object and image are alike.
    lens = symmetric_lens()
    focal_length = first_order(bench_at(lens)).focal_length_mm
    bench = bench_at(lens, focus_distance_mm=2.0 * focal_length, sensor_mm=sensor(10.0))
    assert first_order(bench).magnification == pytest.approx(-1.0, rel=1e-9)
    assert np.abs(distortion(bench).percent).max() < 1e-9
    # At another distance it has.
    assert np.abs(distortion(bench_at(lens, sensor_mm=sensor(10.0))).percent).max() > 0.01


def test_a_ball_with_its_stop_in_the_middle_is_a_pinhole() -> None:
    # Chief rays meet all its surfaces at right angles.
    glass = constant_index_glass(1.5)
    lens = lens_of(
        (1.0 / 10.0, 10.0, glass, 9.0),
        (0.0, 10.0, glass, 1.0, {"kind": "flat", "is_stop": True}),
        (-1.0 / 10.0, 0.0, AIR, 9.0),
    )
    bench = bench_at(lens, sensor_mm=sensor(9.0))
    found = distortion(bench)
    np.testing.assert_allclose(found.image_height_mm, 15.0 * np.tan(np.radians(found.field_deg)), rtol=1e-12)
    assert np.abs(found.percent).max() < 1e-10
    assert found.projection == "f tan"


def test_a_stop_before_a_lens_makes_barrels_behind_it_cushions() -> None:
    # Smith 2008, sec. 5.4: the sign of the distortion follows the place of the stop.
    glass = constant_index_glass(1.5)
    rows = [(0.02, 4.0, glass, 20.0), (-0.02, 0.0, AIR, 20.0)]
    before = bench_at(lens_of(stop(10.0, 2.0), *rows), sensor_mm=sensor(15.0))
    behind = bench_at(lens_of(rows[0], (-0.02, 10.0, AIR, 20.0), stop(0.0, 2.0)), sensor_mm=sensor(15.0))
    assert distortion(before).percent[-1] < -1.0
    assert distortion(behind).percent[-1] > 1.0


@pytest.mark.parametrize("distance", [math.inf, 400.0])
@pytest.mark.parametrize("meridian", ["y", "x"])
def test_cylinders_have_none_near_the_axis(meridian: str, distance: float) -> None:
    bench = bench_at(cylinder_pair(), focus_distance_mm=distance, sensor_mm=(8.0, 8.0), steps=81)
    percent = np.abs(distortion(bench, meridian).percent)
    # It grows with the square of the field.
    assert percent[-1] > 1e-3
    assert percent[4] == pytest.approx(percent[8] / 4.0, rel=0.01)


def test_chief_rays_are_found_by_height_and_by_field() -> None:
    bench = bench_at(symmetric_lens(), sensor_mm=sensor(12.0))
    heights = np.linspace(0.0, 12.0, 7)
    rays = chief_rays_at_heights(bench, "y", bench.primary, heights)
    np.testing.assert_allclose(rays.height, heights, rtol=0.0, atol=1e-12)
    again = chief_rays_at_fields(bench, "y", bench.primary, rays.field_deg)
    np.testing.assert_allclose(again.height, heights, rtol=0.0, atol=1e-11)
    assert np.isnan(chief_rays_at_heights(bench, "y", bench.primary, np.array([1e6])).height).all()


def test_the_fisheye_is_nearly_f_theta() -> None:
    path = next(path for path in SHIPPED if "fisheye" in path.name)
    bench = set_up_bench(read_lens(path))
    found = distortion(bench)
    assert found.projection != "f tan"
    assert np.abs(found.f_theta_percent).max() < 5.0
    assert found.percent[-1] < -50.0


def test_fields_behind_the_lens() -> None:
    # A strong negative meniscus far before the stop: it sees more than half of the world.
    glass = constant_index_glass(1.7)
    lens = lens_of(
        (1.0 / 100.0, 2.0, glass, 45.0),
        (1.0 / 22.0, 40.0, AIR, 21.9),
        (1.0 / 200.0, 4.0, glass, 12.0),
        (-1.0 / 40.0, 3.0, AIR, 12.0),
        stop(3.0, 1.0),
        (1.0 / 200.0, 3.0, glass, 14.0),
        (-1.0 / 18.0, 0.0, AIR, 14.0),
    )
    bench = bench_at(lens, sensor_mm=sensor(17.5))
    found = distortion(bench)
    assert found.field_deg[-1] > 90.0
    beyond = found.field_deg >= 90.0
    assert np.isnan(found.percent[beyond]).all()
    assert np.isfinite(found.f_theta_percent).all()
    assert np.isfinite(found.image_height_mm).all()
