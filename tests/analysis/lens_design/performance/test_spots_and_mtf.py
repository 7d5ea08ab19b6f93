"""Spots and geometric MTF: perfect lenses, discs, and what diffraction leaves of a perfect lens."""

import math

import numpy as np
import pytest
from scipy.special import j1

from raytracer.analysis.lens_design.performance.ray_aberrations import spherical
from raytracer.analysis.lens_design.performance.spots import (
    FREQUENCIES_PER_MM,
    axis_point,
    diffraction_limit,
    geometric_mtf,
    mtf,
    mtf_over_field,
    perfect_mtf,
    spots,
    trace_field_point,
)
from raytracer.optics.glass import AIR, constant_index_glass
from tests.analysis.lens_design.benches import bench_at, cylinder_pair, lens_of, plano_convex, sensor, stop


def hyperbolic(radius):
    """Sharp for light along its axis, whatever its aperture: f = 100."""
    shape = {"kind": "conic", "conic": -2.25, "is_stop": True}
    return lens_of(
        (0.0, 5.0, constant_index_glass(1.5), radius + 2.0, {"kind": "flat"}), (-0.02, 0.0, AIR, radius, shape)
    )


def test_the_mtf_does_not_depend_on_where_a_spot_is():
    # Two points d apart: |1 + exp(2 pi i f d)| / 2 = |cos(pi f d)|.
    for place in (0.0, 0.004):
        contrast = geometric_mtf(place + np.array([0.0, 0.01]), np.ones(2), FREQUENCIES_PER_MM)
        np.testing.assert_allclose(contrast, np.abs(np.cos(math.pi * 0.01 * FREQUENCIES_PER_MM)), rtol=0.0, atol=1e-12)
    assert np.isnan(geometric_mtf(np.empty(0), np.empty(0), FREQUENCIES_PER_MM)).all()


def test_a_perfect_lens_has_a_point_and_an_mtf_of_one():
    bench = bench_at(hyperbolic(15.0), fields=(0.0,))
    spot = spots(bench)[0]
    assert spot.largest_um < 1e-9
    assert [part.transmitted for part in spot.spots] == [1.0, 1.0, 1.0]
    for curve in (mtf(bench)[0].tangential, mtf(bench)[0].sagittal):
        np.testing.assert_allclose(curve, 1.0, rtol=0.0, atol=1e-12)


def test_a_defocused_point_is_a_disc():
    # A film d off at f/N is lit on a disc of the diameter d / N, evenly, whose transform is 2 J1(x) / x.
    bench = bench_at(hyperbolic(2.5), film=105.0 + 1.0, fields=(0.0,), rays=160)
    spot = spots(bench)[0]
    diameter = 1.0 / 20.0
    assert spot.largest_um == pytest.approx(500.0 * diameter, rel=1e-2)
    assert spot.rms_um == pytest.approx(500.0 * diameter / math.sqrt(2.0), rel=2e-3)
    x = math.pi * diameter * FREQUENCIES_PER_MM[1:]
    expected = np.abs(2.0 * j1(x) / x)
    found = mtf(bench)[0]
    for curve in (found.tangential, found.sagittal):
        assert curve[0] == pytest.approx(1.0, abs=1e-12)
        np.testing.assert_allclose(curve[1:], expected, rtol=0.0, atol=2e-3)


def test_the_diffraction_limit():
    # Smith 2008, ch. 15: (2 / pi) (acos v - v sqrt(1 - v^2)), 0.391 in the middle.
    np.testing.assert_allclose(perfect_mtf(np.array([0.0, 0.5, 1.0, 2.0])), [1.0, 0.391002, 0.0, 0.0], atol=1e-6)
    found = diffraction_limit(bench_at(hyperbolic(2.5)))
    assert found.f_number == pytest.approx(20.0, rel=2e-3)
    assert found.cutoff_per_mm == pytest.approx(1.0 / (587.5618e-6 * 20.0), rel=2e-3)


def test_mtf_over_the_field_agrees_with_that_of_the_fields():
    bench = bench_at(
        plano_convex(), fields=(0.0, 0.5, 1.0), steps=3, sensor_mm=sensor(3.0), frequencies_per_mm=(2.0, 4.0)
    )
    over, single = mtf_over_field(bench), mtf(bench)
    for row, frequency in enumerate(over.frequencies_per_mm):
        column = int(np.flatnonzero(frequency == FREQUENCIES_PER_MM)[0])
        for number, curve in enumerate(single):
            assert over.tangential[row, number] == pytest.approx(curve.tangential[column], abs=0.02)
            assert over.sagittal[row, number] == pytest.approx(curve.sagittal[column], abs=0.02)


def test_light_of_a_near_point_is_the_solid_angle_of_the_pupil():
    # A stop of radius 10 mm in front, seen from 20 mm: 2 pi (1 - cos a) with tan a = 1/2.
    lens = lens_of(stop(1.0, 10.0), (0.001, 1.0, constant_index_glass(1.5), 40.0), (-0.001, 0.0, AIR, 40.0))
    bench = bench_at(lens, film=30.0, focus_distance_mm=20.0, rays=256)
    weights = trace_field_point(bench, axis_point(bench, "y"), 256)[0][1]
    assert weights.sum() == pytest.approx(2.0 * math.pi * (1.0 - 1.0 / math.sqrt(1.25)), rel=3e-3)
    # The middle of the pupil is seen under the greatest angle: cos^3 of the rim's, which is what is left of it there.
    assert weights.min() / weights.max() == pytest.approx(1.25**-1.5, rel=2e-2)


def test_the_size_of_the_spot_is_that_of_the_aberration():
    bench = bench_at(plano_convex(), fields=(0.0, 0.5), sensor_mm=sensor(10.0))
    axis = spots(bench)[0]
    assert axis.largest_um == pytest.approx(np.abs(spherical(bench).transverse_um).max(), rel=0.05)
    # For a transverse aberration of the third order, T r^3, the mean square over the pupil is T^2 / 4.
    assert axis.rms_um == pytest.approx(np.abs(spherical(bench).transverse_um).max() / 2.0, rel=0.05)


def test_an_astigmatic_lens_blurs_one_direction():
    # The film in the focus of one of two crossed cylinders: a line along the other's field.
    bench = bench_at(cylinder_pair(), film=95.0, fields=(0.0,))
    spot = spots(bench, "y")[0].spots[0]
    width, height = (float(np.ptp(spot.points_um[:, way])) for way in (0, 1))
    assert width != pytest.approx(height, rel=0.5)
    # The same spot in either meridian, with its axes exchanged.
    across = spots(bench, "x")[0].spots[0]
    assert float(np.ptp(across.points_um[:, 1])) == pytest.approx(width, rel=0.05)


def test_a_grid_twice_as_fine_sees_the_same_spot():
    bench = bench_at(plano_convex(), sensor_mm=sensor(10.0))
    sizes = []
    for rays in (48, 96):
        places, weights = trace_field_point(bench, axis_point(bench, "y"), rays)[0]
        sizes.append((float(weights.sum()), float((weights * (places**2).sum(axis=1)).sum() / weights.sum())))
    # The light that gets through is that of the pupil's area.
    assert sizes[1][0] == pytest.approx(math.pi * 10.0**2, rel=3e-3)
    assert sizes[0] == pytest.approx(sizes[1], rel=2e-2)
