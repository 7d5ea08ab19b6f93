"""Spherical aberration and the sine condition."""

import math

import numpy as np
import pytest

from raytracer.analysis.lens_design.performance.beams import aim_fan, field_points, film_points
from raytracer.analysis.lens_design.performance.ray_aberrations import seidel, spherical
from raytracer.optics.glass import AIR, constant_index_glass
from tests.analysis.lens_design.benches import bench_at, lens_of, plano_convex, sensor, thin_lens


def test_the_plano_convex_lens_of_the_lecture() -> None:
    # Back focus at h: h / tan(asin(n h / R) - asin(h / R)) - (R - sqrt(R^2 - h^2)), 95.41798 mm at h = 10 mm.
    bench = bench_at(plano_convex())
    found = spherical(bench)
    assert found.height_mm[-1] == pytest.approx(10.0, abs=1e-7)
    assert found.longitudinal_mm[0, -1] == pytest.approx(-4.58202, abs=1e-5)
    h = found.height_mm[1:]
    back = h / np.tan(np.arcsin(1.5 * h / 50.0) - np.arcsin(h / 50.0)) - (50.0 - np.sqrt(2500.0 - h**2))
    np.testing.assert_allclose(found.longitudinal_mm[0, 1:], back - 100.0, rtol=0.0, atol=1e-9)
    # 4.5 h^2 / f in the limit.
    np.testing.assert_allclose(found.third_order_mm, -4.5 * found.height_mm**2 / 100.0, rtol=1e-7, atol=1e-12)


def test_third_order_is_the_limit_of_small_zones() -> None:
    found = spherical(bench_at(plano_convex(), steps=101))
    off = found.longitudinal_mm[0, 1:] / found.third_order_mm[1:] - 1.0
    # What is left is of the order of the square of the height.
    assert abs(off[4]) < 1e-3
    assert off[19] / off[9] == pytest.approx(4.0, rel=0.01)


def test_a_hyperboloid_has_none() -> None:
    # Flat side first, conic -n^2: all rays from infinity to one point (Descartes).
    shape = {"kind": "conic", "conic": -2.25}
    lens = lens_of((0.0, 8.0, constant_index_glass(1.5), 22.0, {"kind": "flat"}), (-0.02, 0.0, AIR, 20.0, shape))
    bench = bench_at(lens)
    found = spherical(bench)
    assert np.abs(found.longitudinal_mm).max() < 1e-10
    assert np.abs(found.third_order_mm).max() < 1e-12
    # But the sine condition is not met: the focal length of a zone is h / sin u', not the same for all.
    away = bench.film - (8.0 + np.array([lens.elements[1].sag(0.0, h) for h in found.height_mm[1:]]))
    zones = np.hypot(found.height_mm[1:], away) / 100.0
    np.testing.assert_allclose(found.sine_condition[1:], zones - 1.0, rtol=1e-6, atol=1e-12)


def test_the_doublet_of_the_book() -> None:
    # Kingslake, Johnson 2010, sec. 2.5: back focus 11.28584, and 11.2939 of the ray at 2 mm.
    bench = bench_at(
        lens_of(
            (1.0 / 7.3895, 1.05, constant_index_glass(1.517), 2.0, {"is_stop": True}),
            (-1.0 / 5.1784, 0.40, constant_index_glass(1.649), 3.0),
            (-1.0 / 16.2225, 0.0, AIR, 3.0),
        )
    )
    assert bench.film - 1.45 == pytest.approx(11.28584, abs=5e-5)
    found = spherical(bench)
    assert found.height_mm[-1] == pytest.approx(2.0, abs=1e-8)
    assert found.longitudinal_mm[0, -1] == pytest.approx(11.2939 - 11.28584, abs=1e-4)


@pytest.mark.parametrize(("conic", "turned"), [(-2.25, False), (0.0, False), (0.0, True)])
def test_offence_against_the_sine_condition_is_sagittal_coma(conic: float, turned: bool) -> None:
    # For small fields: offence = sagittal coma / image height (Welford 1986, ch. 9), where the film is at the focus of
    # the zone.
    shape = {"kind": "conic" if conic else "spherical", "conic": conic}
    lens = lens_of(
        (0.0, 8.0, constant_index_glass(1.5), 12.0, {"kind": "flat"}),
        (-0.02, 0.0, AIR, 10.0, shape | {"is_stop": True}),
    )
    if turned:
        lens = lens_of(
            (0.02, 8.0, constant_index_glass(1.5), 10.0, {"is_stop": True}), (0.0, 0.0, AIR, 12.0, {"kind": "flat"})
        )
    bench = bench_at(lens, sensor_mm=sensor(0.01))
    axis = spherical(bench)
    focused = bench_at(lens, film=bench.film + float(axis.longitudinal_mm[0, -1]), sensor_mm=sensor(0.01))
    point = field_points(focused, "y", np.ones(1))[0]
    assert point.beam is not None
    side = aim_fan(focused, point.beam, np.array([1.0 - 1e-6]), up=False)
    places, weights = film_points(focused, point.beam, np.zeros(1), side, focused.primary)
    assert weights[0] > 0.0
    assert (places[0, 0] - point.height) / point.height == pytest.approx(axis.sine_condition[-1], rel=2e-2)


def test_aplanatic_points_of_a_sphere() -> None:
    # Light that converges to n r behind the centre of a sphere of glass is brought to r / n behind it, sharp and free
    # of coma for all apertures (Born, Wolf 1999, sec. 4.2.3).
    n, r = 1.5, 30.0
    lens = lens_of((1.0 / r, 0.0, constant_index_glass(n), 12.0, {"is_stop": True}))
    bench = bench_at(lens, film=r + r / n, focus_distance_mm=-(r + n * r))
    sums = seidel(bench)
    assert sums is not None
    assert abs(sums.total_spherical) < 1e-15
    assert abs(sums.total_coma) < 1e-15


def thin_spherical(n: float, shape: float, conjugate: float, height: float, power: float) -> float:
    """Of a thin lens: Welford 1986, ch. 12."""
    bend = shape + 2.0 * (n * n - 1.0) / (n + 2.0) * conjugate
    square = (n / (n - 1.0)) ** 2 + (n + 2.0) / (n * (n - 1.0) ** 2) * bend**2 - n / (n + 2.0) * conjugate**2
    return height**4 * power**3 / 4.0 * square


@pytest.mark.parametrize("n", [1.5, 1.8])
@pytest.mark.parametrize("shape", [-1.0, 0.0, 0.6, 2.0])
@pytest.mark.parametrize(("distance", "conjugate"), [(math.inf, -1.0), (200.0, 0.0), (300.0, -1.0 / 3.0)])
def test_thin_lens(n: float, shape: float, distance: float, conjugate: float) -> None:
    # conjugate = (m + 1) / (m - 1) with m the magnification, -1 for infinity.
    bench = bench_at(thin_lens(100.0, shape, constant_index_glass(n), 5.0), focus_distance_mm=distance)
    sums = seidel(bench)
    assert sums is not None
    expected = thin_spherical(n, shape, conjugate, 5.0, 0.01)
    assert sums.total_spherical == pytest.approx(expected, rel=1e-6)
    # Stop at the lens: astigmatism H^2 power, Petzval H^2 power / n, no distortion.
    power = sums.lagrange_mm**2 / 100.0
    assert sums.total_astigmatism == pytest.approx(power, rel=1e-6)
    assert sums.total_petzval == pytest.approx(power / n, rel=1e-6)
    assert abs(sums.total_distortion) < 1e-7 * power


def test_best_bending_of_a_thin_lens() -> None:
    # Least spherical aberration for infinity at the shape 2 (n^2 - 1) / (n + 2).
    n = 1.5
    best = 2.0 * (n * n - 1.0) / (n + 2.0)
    sums = [
        seidel(bench_at(thin_lens(100.0, best + off, constant_index_glass(n), 5.0))).total_spherical  # type: ignore[union-attr]
        for off in (-1e-2, 0.0, 1e-2)
    ]
    assert sums[1] < sums[0]
    assert sums[1] < sums[2]
    assert sums[0] == pytest.approx(sums[2], rel=1e-7)
