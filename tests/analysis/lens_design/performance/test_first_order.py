"""First order: known lenses, and real rays near the axis."""

import math

import pytest

from raytracer.analysis.lens_design.performance.first_order import first_order
from raytracer.optics.glass import AIR, constant_index_glass
from raytracer.optics.lens_system.first_order import cardinal_points, exit_pupil
from tests.analysis.lens_design.benches import bench_at, cylinder_pair, lens_of, plano_convex, thin_lens


def test_the_plano_convex_lens():
    # R = 50, n = 1.5: f = R / (n - 1); principal planes at the curved vertex and t / n behind the flat one.
    found = first_order(bench_at(plano_convex()))
    assert found.focal_length_mm == pytest.approx(100.0, rel=1e-14)
    assert found.back_focus_mm == pytest.approx(100.0, rel=1e-14)
    assert found.rear_principal_z_mm == pytest.approx(5.0, abs=1e-12)
    assert found.front_principal_z_mm == pytest.approx(5.0 / 1.5, abs=1e-12)
    # In air nodal points are principal points.
    assert found.rear_nodal_z_mm == pytest.approx(found.rear_principal_z_mm, abs=1e-12)
    assert found.front_nodal_z_mm == pytest.approx(found.front_principal_z_mm, abs=1e-12)
    # Petzval's radius of one glass: -n f.
    assert found.petzval_radius_mm == pytest.approx(-150.0, rel=1e-12)


@pytest.mark.parametrize("meridian", ["x", "y"])
def test_each_plane_of_crossed_cylinders_is_a_lens_by_itself(meridian):
    # Plano-convex cylinders of n = 1.5 with R = 50 (power across y) and 25 (across x).
    bench = bench_at(cylinder_pair())
    found = first_order(bench, meridian)
    peer = cardinal_points(bench.surfaces(), meridian)
    assert found.focal_length_mm == pytest.approx({"y": 100.0, "x": 50.0}[meridian], rel=1e-14)
    assert found.focal_length_mm == pytest.approx(peer.focal_length, rel=1e-14)
    assert found.rear_focus_z_mm == pytest.approx(peer.rear_focus, rel=1e-13)
    assert found.front_principal_z_mm == pytest.approx(peer.front_principal, abs=1e-11)
    assert found.exit_pupil_z_mm == pytest.approx(exit_pupil(bench.surfaces(), meridian).z, rel=1e-12)
    # As real rays near the axis have it.
    assert abs(found.focal_length_difference) < 1e-9
    assert abs(found.back_focus_difference) < 1e-9


def test_nodal_points_of_a_lens_before_water():
    # f' = n' f: the nodal points are moved from the principal points by f' - f, towards the denser side.
    lens = lens_of((1.0 / 20.0, 0.0, constant_index_glass(4.0 / 3.0), 5.0, {"is_stop": True}))
    found = first_order(bench_at(lens))
    assert found.focal_length_mm == pytest.approx(60.0, rel=1e-14)
    assert found.rear_focus_z_mm == pytest.approx(80.0, rel=1e-14)
    # One surface has its nodal points in its centre, its principal points in its vertex.
    assert found.rear_nodal_z_mm == pytest.approx(20.0, rel=1e-13)
    assert found.front_nodal_z_mm == pytest.approx(20.0, rel=1e-13)
    assert found.rear_principal_z_mm == pytest.approx(0.0, abs=1e-12)


def test_pupils_and_f_numbers_of_a_thin_lens():
    found = first_order(bench_at(thin_lens(80.0, 0.3, constant_index_glass(1.6), 10.0)))
    assert found.f_number == pytest.approx(4.0, rel=1e-8)
    assert (found.entrance_pupil_z_mm, found.exit_pupil_z_mm) == pytest.approx((0.0, 0.0), abs=1e-7)
    assert found.exit_pupil_diameter_mm == pytest.approx(20.0, rel=1e-8)
    # Distortion-free through its middle: the field is that of a pinhole.
    angles = (found.field_of_view_width_deg, found.field_of_view_height_deg, found.field_of_view_diagonal_deg)
    for angle, size in zip(angles, (36.0, 24.0, math.hypot(36.0, 24.0)), strict=True):
        assert angle == pytest.approx(2.0 * math.degrees(math.atan(size / 160.0)), rel=1e-7)
    # 1 / s' = 1 / f - 1 / s: at 3 f the image is half as large, and upside down.
    near = first_order(bench_at(thin_lens(50.0, 0.0, constant_index_glass(1.5), 2.0), focus_distance_mm=150.0))
    assert near.magnification == pytest.approx(-0.5, rel=1e-7)
    assert near.film_z_mm == pytest.approx(75.0, rel=1e-7)


def test_a_stop_in_the_focal_plane_is_seen_from_infinity():
    # The stop a focal length before a thin lens: telecentric behind it.
    glass = constant_index_glass(1.5)
    lens = lens_of(
        (0.0, 40.0, AIR, 4.0, {"kind": "flat", "is_stop": True}),
        (0.05 / 2.0, 1e-9, glass, 15.0),
        (-0.05 / 2.0, 0.0, AIR, 15.0),
    )
    found = first_order(bench_at(lens))
    assert abs(found.exit_pupil_z_mm) > 1e9
    assert found.f_number == pytest.approx(5.0, rel=1e-6)
