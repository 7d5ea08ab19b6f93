"""Chromatic aberration, distortion and field curvature: closed forms, and real rays close to the chief ray."""

import math

import numpy as np
import pytest

from raytracer.analysis.lens_design.performance.chief_rays import (
    chief_rays_at_fields,
    chief_rays_at_heights,
    object_points,
)
from raytracer.analysis.lens_design.performance.field_aberrations import (
    axial_shift_mm,
    chromatic_aberration,
    distortion,
    field_curvature,
)
from raytracer.analysis.lens_design.performance.first_order import first_order
from raytracer.analysis.lens_design.performance.optical_bench import MERIDIANS, set_up_bench
from raytracer.optics.glass import AIR, CATALOGUE, LINE_C, LINE_D, LINE_F, constant_index_glass
from raytracer.optics.lens_system.ray_tracing import trace_rays
from tests.analysis.lens_design.benches import (
    THIN,
    aspheric_pair,
    bench_at,
    closest,
    cylinder_pair,
    lens_of,
    rays_close_to,
    sensor,
    shipped,
    stop,
    symmetric_lens,
    thin_lens,
)


@pytest.mark.parametrize("name", ["N-BK7", "N-SF11"])
def test_a_singlet_spreads_its_focus_by_f_over_v(name):
    glass = CATALOGUE[name]
    found = chromatic_aberration(bench_at(thin_lens(100.0, 0.5, glass, 10.0)))
    # Exactly, f (n_d - 1) (1 / (n_F - 1) - 1 / (n_C - 1)).
    d, f, c = (float(glass.ior(line)) - 1.0 for line in (LINE_D, LINE_F, LINE_C))
    assert found.axial_between_ends_mm == pytest.approx(100.0 * d * (1.0 / f - 1.0 / c), rel=1e-6)
    # Which is f / V, but for what the yellow is off the middle of a glass that disperses much.
    assert found.axial_between_ends_mm == pytest.approx(-100.0 / glass.abbe(), rel=0.02 if name == "N-BK7" else 0.03)
    # Blue is bent most.
    assert (np.diff(found.axial_mm) > 0.0).all()
    # The stop is at the lens: all chief rays go straight through.
    assert np.abs(found.lateral_um).max() < 1e-4


def test_an_achromat_brings_its_two_colours_together():
    # Thin, cemented: powers V1 / (V1 - V2) and -V2 / (V1 - V2) of a hundredth.
    crown, flint = CATALOGUE["N-BK7"], CATALOGUE["N-SF11"]
    v1, v2 = crown.abbe(), flint.abbe()
    c1 = 0.5 * 0.01 * v1 / (v1 - v2) / (float(crown.ior()) - 1.0)
    c3 = -c1 + 0.01 * v2 / (v1 - v2) / (float(flint.ior()) - 1.0)
    lens = lens_of((c1, THIN, crown, 5.0, {"is_stop": True}), (-c1, THIN, flint, 5.0), (c3, 0.0, AIR, 5.0))
    bench = bench_at(lens)
    found = chromatic_aberration(bench)
    assert abs(found.axial_between_ends_mm) < 1e-6
    # Both are behind the yellow: the secondary spectrum, about f / 2000.
    assert 0.02 < axial_shift_mm(bench, 486.1327) < 0.1


def test_a_stop_before_a_thin_lens_makes_blue_images_smaller():
    glass, before = CATALOGUE["N-BK7"], 20.0
    lens = thin_lens(100.0, 0.0, glass, 30.0).elements
    bench = bench_at(lens_of(stop(before, 5.0), *(row[:4] for row in lens)), sensor_mm=sensor(1.0))
    found = chromatic_aberration(bench)
    # A ray that meets the lens at the height y is bent by y / f, and goes on to the film at 100 mm.
    height = before * np.tan(np.radians(found.field_deg))
    for row, line in enumerate((LINE_D, LINE_F, LINE_C)):
        power = 0.01 * (float(glass.ior(line)) - 1.0) / (float(glass.ior()) - 1.0)
        expected = -1e3 * 100.0 * height * (power - 0.01)
        np.testing.assert_allclose(found.lateral_um[row], expected, rtol=1e-3, atol=1e-9)
    assert found.lateral_um[1, -1] < -1.0


def test_a_ball_with_its_stop_in_the_middle_is_a_pinhole():
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


def test_a_stop_before_a_lens_makes_barrels_behind_it_cushions():
    # Smith 2008, sec. 5.4: the sign of the distortion follows the place of the stop.
    glass = constant_index_glass(1.5)
    rows = [(0.02, 4.0, glass, 20.0), (-0.02, 0.0, AIR, 20.0)]
    before = bench_at(lens_of(stop(10.0, 2.0), *rows), sensor_mm=sensor(15.0))
    behind = bench_at(lens_of(rows[0], (-0.02, 10.0, AIR, 20.0), stop(0.0, 2.0)), sensor_mm=sensor(15.0))
    assert distortion(before).percent[-1] < -1.0
    assert distortion(behind).percent[-1] > 1.0


@pytest.mark.parametrize(("meridian", "distance"), [("y", math.inf), ("x", 400.0)])
def test_cylinders_have_none_near_the_axis(meridian, distance):
    bench = bench_at(cylinder_pair(), focus_distance_mm=distance, sensor_mm=(8.0, 8.0), steps=41)
    percent = np.abs(distortion(bench, meridian).percent)
    # It grows with the square of the field.
    assert percent[-1] > 1e-3
    assert percent[2] == pytest.approx(percent[4] / 4.0, rel=0.01)


def test_fields_behind_the_lens():
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


def foci(bench, meridian, field_deg):
    """Tangential and sagittal focus along the axis, from the film, of pairs of rays on both sides of the chief ray."""
    chief = chief_rays_at_fields(bench, meridian, bench.primary, np.array([field_deg]))
    origin, toward = chief.origin[0], chief.toward[0]
    near = not math.isinf(bench.distance)
    start = object_points(bench, chief.origin, -chief.toward)[0] if near else origin
    column = MERIDIANS[meridian]
    across = np.eye(3)[1 - column]
    found = []
    for along in (np.cross(toward, across), across):
        apart = 1e-2 if not near else 1e-2 / bench.distance
        origins, directions = rays_close_to(start, toward, along, apart, parallel=not near)
        weights, points, onward = trace_rays(bench.without_rims(), origins, directions)
        assert (weights > 0.0).all()
        found.append(closest(points, onward)[2] - bench.film)
    return found


def assert_foci(found, bench, meridian, fields):
    for row in fields:
        tangential, sagittal = foci(bench, meridian, float(found.field_deg[row]))
        assert found.tangential_mm[0, row] == pytest.approx(tangential, abs=1e-4)
        assert found.sagittal_mm[0, row] == pytest.approx(sagittal, abs=1e-4)


@pytest.mark.parametrize("distance", [math.inf, 300.0])
@pytest.mark.parametrize(("make", "meridian"), [(aspheric_pair, "y"), (cylinder_pair, "y"), (cylinder_pair, "x")])
def test_foci_are_where_real_rays_meet(make, meridian, distance):
    bench = bench_at(make(), sensor_mm=sensor(10.0), focus_distance_mm=distance, steps=5)
    assert_foci(field_curvature(bench, meridian), bench, meridian, range(5))


def test_foci_of_the_fisheye_out_to_its_rim():
    bench = set_up_bench(shipped("fisheye-10mm"))
    assert_foci(field_curvature(bench), bench, "y", (10, 25, 38))


def test_symmetry_leaves_no_lateral_colour_at_life_size():
    glass = CATALOGUE["N-SF11"]
    lens = symmetric_lens()
    dispersing = lens_of(
        *(
            (*row[:2], glass if row.glass.name != "air" else AIR, *row[3:4], {"is_stop": row.is_stop})
            for row in lens.elements
        )
    )
    distance = 2.0 * first_order(bench_at(dispersing)).focal_length_mm
    bench = bench_at(dispersing, focus_distance_mm=distance, sensor_mm=sensor(8.0))
    found = chromatic_aberration(bench)
    # Chief rays of all colours go through the middle of the stop, and so leave as they came.
    assert np.abs(found.lateral_um).max() < 1e-6
    assert np.abs(chromatic_aberration(bench_at(dispersing, sensor_mm=sensor(8.0))).lateral_um).max() > 1.0


def test_no_dispersion_no_colour():
    found = chromatic_aberration(bench_at(thin_lens(100.0, 0.5, constant_index_glass(1.5), 10.0)))
    assert not found.axial_mm.any()
    assert not found.lateral_um.any()


def test_a_symmetric_lens_at_life_size_has_none():
    # The chief ray leaves it as it comes in, upside down: so object and image are alike.
    lens = symmetric_lens()
    focal_length = first_order(bench_at(lens)).focal_length_mm
    bench = bench_at(lens, focus_distance_mm=2.0 * focal_length, sensor_mm=sensor(10.0))
    assert first_order(bench).magnification == pytest.approx(-1.0, rel=1e-9)
    assert np.abs(distortion(bench).percent).max() < 1e-9
    # At another distance it has.
    assert np.abs(distortion(bench_at(lens, sensor_mm=sensor(10.0))).percent).max() > 0.01


def test_chief_rays_are_found_by_height_and_by_field():
    bench = bench_at(symmetric_lens(), sensor_mm=sensor(12.0))
    heights = np.linspace(0.0, 12.0, 7)
    rays = chief_rays_at_heights(bench, "y", bench.primary, heights)
    np.testing.assert_allclose(rays.height, heights, rtol=0.0, atol=1e-12)
    again = chief_rays_at_fields(bench, "y", bench.primary, rays.field_deg)
    np.testing.assert_allclose(again.height, heights, rtol=0.0, atol=1e-11)
    assert np.isnan(chief_rays_at_heights(bench, "y", bench.primary, np.array([1e6])).height).all()


def test_the_fisheye_is_nearly_f_theta():
    bench = set_up_bench(shipped("fisheye-10mm"))
    found = distortion(bench)
    assert found.projection != "f tan"
    assert np.abs(found.f_theta_percent).max() < 5.0
    assert found.percent[-1] < -50.0
