"""Spherical aberration, the sine condition, and Seidel sums against real rays, to which they are the limit."""

import math

import numpy as np
import pytest

from raytracer.analysis.lens_design.performance.beams import aim_fan, field_points, film_points
from raytracer.analysis.lens_design.performance.chief_rays import chief_rays_at_fields
from raytracer.analysis.lens_design.performance.field_aberrations import axial_shift_mm, distortion, field_curvature
from raytracer.analysis.lens_design.performance.ray_aberrations import seidel, spherical
from raytracer.optics.glass import AIR, constant_index_glass, glass_from_abbe
from tests.analysis.lens_design.benches import (
    aspheric_pair,
    bench_at,
    lens_of,
    limit,
    plano_convex,
    sensor,
    stop,
    thin_lens,
)


def test_the_plano_convex_lens_of_the_lecture():
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


def test_a_hyperboloid_has_none():
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


def test_the_doublet_of_the_book():
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
def test_offence_against_the_sine_condition_is_sagittal_coma(conic, turned):
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
    side = aim_fan(focused, point.beam, np.array([1.0 - 1e-6]), up=False)
    places, weights = film_points(focused, point.beam, np.zeros(1), side, focused.primary)
    assert weights[0] > 0.0
    assert (places[0, 0] - point.height) / point.height == pytest.approx(axis.sine_condition[-1], rel=2e-2)


@pytest.mark.parametrize("shape", [-1.0, 0.6, 2.0])
@pytest.mark.parametrize(
    ("n", "distance", "conjugate"), [(1.5, math.inf, -1.0), (1.8, 200.0, 0.0), (1.5, 300.0, -1.0 / 3.0)]
)
def test_sums_of_a_thin_lens(n, shape, distance, conjugate):
    # Welford 1986, ch. 12; conjugate = (m + 1) / (m - 1) with m the magnification, -1 for infinity.
    sums = seidel(bench_at(thin_lens(100.0, shape, constant_index_glass(n), 5.0), focus_distance_mm=distance))
    bend = shape + 2.0 * (n * n - 1.0) / (n + 2.0) * conjugate
    square = (n / (n - 1.0)) ** 2 + (n + 2.0) / (n * (n - 1.0) ** 2) * bend**2 - n / (n + 2.0) * conjugate**2
    assert sums.total_spherical == pytest.approx(5.0**4 * 0.01**3 / 4.0 * square, rel=1e-6)
    # Stop at the lens: astigmatism H^2 power, Petzval H^2 power / n, no distortion.
    power = sums.lagrange_mm**2 / 100.0
    assert sums.total_astigmatism == pytest.approx(power, rel=1e-6)
    assert sums.total_petzval == pytest.approx(power / n, rel=1e-6)
    assert abs(sums.total_distortion) < 1e-7 * power


def bench_and_sums(lens, largest, aperture, distance):
    """Bench, its sums, and the slope of the marginal ray behind the lens."""
    bench = bench_at(lens.stopped_down(aperture), sensor_mm=sensor(largest), focus_distance_mm=distance, steps=5)
    sums = seidel(bench)
    return bench, sums, float(bench.marginal_ray(bench.surfaces()).slopes[-1])


def ratios_of_spherical(size, distance):
    bench, sums, slope = bench_and_sums(aspheric_pair(), 1e-3, size, distance)
    return [spherical(bench).longitudinal_mm[0, -1] / (-sums.total_spherical / (2.0 * slope**2))]


def ratios_of_coma(size, distance):
    # Half of what the two ends of a fan are off from the chief ray: 3 S2 / (2 n' u') along the field, a third across.
    bench, sums, slope = bench_and_sums(aspheric_pair(), 0.02 * size, size, distance)
    point = field_points(bench, "y", np.ones(1))[0]
    ends, still = np.array([1.0, -1.0]) * (1.0 - 1e-9), np.zeros(2)
    for up in (True, False):
        ways = aim_fan(bench, point.beam, ends, up=up)
        places, _ = film_points(bench, point.beam, *((ways, still) if up else (still, ways)), bench.primary)
        coma = float(places[:, 0].mean()) - point.height
        yield coma / (-sums.total_coma / (2.0 * slope)) / (3.0 if up else 1.0)


def ratios_of_foci(size, distance):
    # Foci of narrow pencils: -(3 S3 + S4) / (2 n' u'^2) and -(S3 + S4) / (2 n' u'^2).
    bench, sums, slope = bench_and_sums(aspheric_pair(), 0.5 * size, 1.0, distance)
    found = field_curvature(bench)
    assert found.petzval_mm[-1] == pytest.approx(-sums.total_petzval / (2.0 * slope**2), rel=1e-9)
    # The Petzval sum is one of the glass alone: S4 = H^2 sum of power / (n n').
    surfaces = aspheric_pair().packed()
    n = surfaces.ior
    petzval = float((surfaces.curvature * np.diff(n) / (n[1:] * n[:-1])).sum())
    assert sums.total_petzval / sums.lagrange_mm**2 == pytest.approx(petzval, rel=1e-12)
    for curve, times in ((found.tangential_mm, 3.0), (found.sagittal_mm, 1.0)):
        expected = -(times * sums.total_astigmatism + sums.total_petzval) / (2.0 * slope**2)
        yield float(curve[0, -1]) / expected


def ratios_of_distortion(size, distance):
    # The chief ray lands S5 / (2 n' u') off, of the height H / (n' u').
    bench, sums, _ = bench_and_sums(aspheric_pair(), size, 1.0, distance)
    return [float(distortion(bench).percent[-1]) / (100.0 * sums.total_distortion / (2.0 * sums.lagrange_mm))]


@pytest.mark.parametrize("distance", [math.inf, 250.0])
@pytest.mark.parametrize(
    ("ratios", "error"),
    [(ratios_of_spherical, 2e-3), (ratios_of_coma, 5e-3), (ratios_of_foci, 2e-3), (ratios_of_distortion, 2e-3)],
)
def test_sums_are_the_limit_of_small_aberrations(ratios, error, distance):
    sizes = (2.0, 1.0)
    for column in zip(*(ratios(size, distance) for size in sizes), strict=True):
        assert limit(sizes, column) == pytest.approx(1.0, abs=error)


def test_sums_of_colour():
    # Axial: the focus of the blue end minus that of the red is -C1 / (n' u'^2); lateral: C2 / (n' u') over the field.
    weak = glass_from_abbe(1.6, 4000.0), glass_from_abbe(1.7, 3000.0)
    lens = lens_of(
        (0.02, 4.0, weak[0], 12.0),
        (-0.01, 6.0, constant_index_glass(1.0), 12.0),
        stop(4.0, 3.0),
        (0.01, 3.0, weak[1], 12.0),
        (-0.01, 0.0, constant_index_glass(1.0), 12.0),
    )
    bench, sums, slope = bench_and_sums(lens, 0.1, 3.0, math.inf)
    _, blue, red = bench.settings.wavelengths_nm
    spread = axial_shift_mm(bench, blue) - axial_shift_mm(bench, red)
    assert spread == pytest.approx(-sums.total_axial_colour / slope**2, rel=1e-3)
    point = field_points(bench, "y", np.ones(1))[0]
    heights = [
        float(chief_rays_at_fields(bench, "y", end, np.array([point.field_deg])).height[0]) for end in (blue, red)
    ]
    # On the film of the primary colour chief rays of others land off by what their images are larger or smaller.
    assert heights[0] - heights[1] == pytest.approx(-sums.total_lateral_colour / slope, rel=1e-3)


def test_aplanatic_points_of_a_sphere():
    # Light that converges to n r behind the centre of a sphere of glass is brought to r / n behind it, sharp and free
    # of coma for all apertures (Born, Wolf 1999, sec. 4.2.3).
    n, r = 1.5, 30.0
    lens = lens_of((1.0 / r, 0.0, constant_index_glass(n), 12.0, {"is_stop": True}))
    bench = bench_at(lens, film=r + r / n, focus_distance_mm=-(r + n * r))
    sums = seidel(bench)
    assert abs(sums.total_spherical) < 1e-15
    assert abs(sums.total_coma) < 1e-15
