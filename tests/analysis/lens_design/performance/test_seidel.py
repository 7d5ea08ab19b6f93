"""Seidel sums against real rays, to which they are the limit of small apertures and fields."""

import math

import numpy as np
import pytest

from raytracer.analysis.lens_design.performance.beams import aim_fan, field_points, film_points
from raytracer.analysis.lens_design.performance.chief_rays import chief_rays_at_fields
from raytracer.analysis.lens_design.performance.field_aberrations import axial_shift_mm, distortion, field_curvature
from raytracer.analysis.lens_design.performance.optical_bench import OpticalBench
from raytracer.analysis.lens_design.performance.ray_aberrations import seidel, spherical
from raytracer.analysis.lens_design.performance.results import Seidel
from raytracer.optics.glass import constant_index_glass, glass_from_abbe
from raytracer.optics.lens_system.lens import Lens
from tests.analysis.lens_design.benches import aspheric_pair, bench_at, lens_of, limit, sensor, stop

DISTANCES = (math.inf, 250.0)


def bench_and_sums(lens: Lens, largest: float, aperture: float, distance: float) -> tuple[OpticalBench, Seidel, float]:
    """Bench, its sums, and the slope of the marginal ray behind the lens."""
    bench = bench_at(lens.stopped_down(aperture), sensor_mm=sensor(largest), focus_distance_mm=distance, steps=5)
    sums = seidel(bench)
    assert sums is not None
    return bench, sums, float(bench.marginal_ray(bench.surfaces()).slopes[-1])


@pytest.mark.parametrize("distance", DISTANCES)
def test_spherical(distance: float) -> None:
    sizes, ratios = (2.0, 1.0), []
    for size in sizes:
        bench, sums, slope = bench_and_sums(aspheric_pair(), 1e-3, size, distance)
        ratios.append(spherical(bench).longitudinal_mm[0, -1] / (-sums.total_spherical / (2.0 * slope**2)))
    assert limit(sizes, ratios) == pytest.approx(1.0, abs=2e-3)


@pytest.mark.parametrize("distance", DISTANCES)
def test_coma(distance: float) -> None:
    # Half of what the two ends of a fan are off from the chief ray: 3 S2 / (2 n' u') along the field, a third across.
    sizes = (2.0, 1.0)
    ratios: tuple[list[float], list[float]] = ([], [])
    for size in sizes:
        bench, sums, slope = bench_and_sums(aspheric_pair(), 0.02 * size, size, distance)
        point = field_points(bench, "y", np.ones(1))[0]
        assert point.beam is not None
        ends = np.array([1.0, -1.0]) * (1.0 - 1e-9)
        still = np.zeros(2)
        for found, up in zip(ratios, (True, False), strict=True):
            ways = aim_fan(bench, point.beam, ends, up=up)
            places, _ = film_points(bench, point.beam, *((ways, still) if up else (still, ways)), bench.primary)
            coma = float(places[:, 0].mean()) - point.height
            found.append(coma / (-sums.total_coma / (2.0 * slope)) / (3.0 if up else 1.0))
    for found in ratios:
        assert limit(sizes, found) == pytest.approx(1.0, abs=5e-3)


@pytest.mark.parametrize("distance", DISTANCES)
def test_astigmatism_and_petzval(distance: float) -> None:
    # Foci of narrow pencils: -(3 S3 + S4) / (2 n' u'^2) and -(S3 + S4) / (2 n' u'^2).
    sizes = (1.0, 0.5)
    ratios: tuple[list[float], list[float]] = ([], [])
    for size in sizes:
        bench, sums, slope = bench_and_sums(aspheric_pair(), size, 1.0, distance)
        found = field_curvature(bench)
        for column, curve, times in ((0, found.tangential_mm, 3.0), (1, found.sagittal_mm, 1.0)):
            expected = -(times * sums.total_astigmatism + sums.total_petzval) / (2.0 * slope**2)
            ratios[column].append(float(curve[0, -1]) / expected)
        assert found.petzval_mm[-1] == pytest.approx(-sums.total_petzval / (2.0 * slope**2), rel=1e-9)
    for column in ratios:
        assert limit(sizes, column) == pytest.approx(1.0, abs=2e-3)


@pytest.mark.parametrize("distance", DISTANCES)
def test_distortion(distance: float) -> None:
    # The chief ray lands S5 / (2 n' u') off, of the height H / (n' u').
    sizes, ratios = (2.0, 1.0), []
    for size in sizes:
        bench, sums, _ = bench_and_sums(aspheric_pair(), size, 1.0, distance)
        expected = 100.0 * sums.total_distortion / (2.0 * sums.lagrange_mm)
        ratios.append(float(distortion(bench).percent[-1]) / expected)
    assert limit(sizes, ratios) == pytest.approx(1.0, abs=2e-3)


def test_colour() -> None:
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


def test_sums_are_the_same_however_the_lens_is_focused() -> None:
    # The Petzval sum is one of the glass alone: S4 = H^2 sum of power / (n n').
    lens = aspheric_pair()
    surfaces = lens.packed()
    n = surfaces.ior
    petzval = float((surfaces.curvature * np.diff(n) / (n[1:] * n[:-1])).sum())
    for distance in DISTANCES:
        _, sums, _ = bench_and_sums(lens, 5.0, 3.0, distance)
        assert sums.total_petzval / sums.lagrange_mm**2 == pytest.approx(petzval, rel=1e-12)
