"""Tolerances: derivatives of thin lenses, depth of field, best focus."""

import math

import numpy as np
import pytest

from raytracer.analysis.lens_design.performance.tolerances import best_focus, tolerances
from raytracer.optics.glass import constant_index_glass
from tests.analysis.lens_design.benches import aspheric_pair, bench_at, plano_convex, thin_lens


def test_derivatives_of_a_thin_lens():
    # 1/f = (n - 1) (1/R1 - 1/R2): df/dR1 = f^2 (n - 1) / R1^2, df/dR2 = -f^2 (n - 1) / R2^2, df/dn = -f / (n - 1).
    n, f = 1.6, 80.0
    bench = bench_at(thin_lens(f, 0.4, constant_index_glass(n), 4.0))
    rows = {(row.surface, row.parameter): row for row in tolerances(bench).sensitivities}
    r1, r2 = (1.0 / float(element.curvature) for element in bench.lens.elements)
    assert rows[1, "radius"].back_focus_per_unit == pytest.approx(f**2 * (n - 1.0) / r1**2, rel=1e-6)
    assert rows[2, "radius"].back_focus_per_unit == pytest.approx(-(f**2) * (n - 1.0) / r2**2, rel=1e-6)
    assert rows[1, "index"].back_focus_per_unit == pytest.approx(-f / (n - 1.0), rel=1e-6)
    # A step of 0.1 % of a radius, and of 0.001 of the index, by the same formulas.
    assert rows[1, "radius"].back_focus_mm == pytest.approx(1e-3 * f**2 * (n - 1.0) / r1, rel=2e-3)
    assert rows[1, "index"].back_focus_mm == pytest.approx(f * ((n - 1.0) / (n - 0.999) - 1.0), rel=1e-6)


def test_depth_of_field_is_that_of_the_camera_truths_and_depth_of_focus_circle_times_f_number():
    # 50 mm at f/2.8, c = 0.03 mm, 3 m: 2729.5 and 3330.1 mm.
    bench = bench_at(
        thin_lens(50.0, 0.5, constant_index_glass(1.5), 50.0 / 5.6),
        focus_distance_mm=3000.0,
        circle_of_confusion_mm=0.03,
    )
    found = tolerances(bench)
    assert found.near_limit_mm == pytest.approx(2729.5, abs=0.1)
    assert found.far_limit_mm == pytest.approx(3330.1, abs=0.1)
    # Focused at infinity the near limit is f^2 / (N c) from the lens, and there is no far one.
    far = tolerances(bench_at(bench.lens, circle_of_confusion_mm=0.03))
    assert far.near_limit_mm == pytest.approx(50.0**2 / (2.8 * 0.03), rel=1e-5)
    assert math.isinf(far.far_limit_mm)
    slow = bench_at(thin_lens(100.0, 0.7, constant_index_glass(1.5), 2.0), circle_of_confusion_mm=0.02)
    assert tolerances(slow).depth_of_focus_mm == pytest.approx(0.02 * 25.0, rel=2e-3)


def test_best_focus_of_third_order_spherical_aberration():
    # The mean square over the pupil of r^3 - d r is least for d = 2/3: two thirds of the way to the marginal focus.
    bench = bench_at(plano_convex(radius=4.0))
    found = tolerances(bench)
    marginal = -4.5 * 4.0**2 / 100.0
    assert found.best_focus_mm == pytest.approx(2.0 / 3.0 * marginal, rel=0.03)
    # And a third as large as at the paraxial focus.
    assert found.rms_on_axis_best_um == pytest.approx(found.rms_on_axis_um / 3.0, rel=0.02)


def test_the_way_between_two_lenses():
    # Back focus of two thin lenses d apart: f2 (f1 - d) / (f1 + f2 - d), here by the real lens's own matrices.
    bench = bench_at(aspheric_pair())
    found = tolerances(bench)
    rss = math.sqrt(sum(row.back_focus_mm**2 for row in found.sensitivities))
    assert found.rss_back_focus_mm == pytest.approx(rss)
    for row in found.sensitivities:
        step = row.step if row.unit != "%" else 1e-2 * row.step / float(bench.lens.elements[row.surface - 1].curvature)
        assert row.back_focus_mm == pytest.approx(row.back_focus_per_unit * step, rel=0.05, abs=1e-9)


def test_a_first_radius_before_a_flat_is_no_error_for_light_that_it_does_not_bend():
    rows = {(row.surface, row.parameter): row for row in tolerances(bench_at(plano_convex())).sensitivities}
    assert (1, "radius") not in rows
    assert rows[1, "thickness"].back_focus_mm == 0.0
    assert abs(rows[1, "thickness"].spot_um) < 1e-9


def test_best_focus_is_the_least_of_a_scan():
    rng = np.random.default_rng(5)
    places, slopes = rng.normal(size=(400, 2)), rng.normal(size=(400, 2))
    _, least, way = best_focus(places, slopes)
    scan = [math.sqrt(float(((places + z * slopes) ** 2).sum(axis=1).mean())) for z in np.linspace(-0.5, 0.5, 2001)]
    assert least == pytest.approx(min(scan), rel=1e-6)
    assert way == pytest.approx(np.linspace(-0.5, 0.5, 2001)[int(np.argmin(scan))], abs=5e-4)
