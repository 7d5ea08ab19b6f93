"""Relative illumination: discs, small pupils, and the way round through the scene."""

import math

import numpy as np
import pytest

from raytracer.analysis.lens_design.performance.beams import field_points
from raytracer.analysis.lens_design.performance.first_order import first_order
from raytracer.analysis.lens_design.performance.illumination import illumination, largest_height, projected_solid_angle
from raytracer.analysis.lens_design.performance.optical_bench import set_up_bench
from raytracer.analysis.lens_design.performance.results import Settings
from raytracer.analysis.lens_design.performance.spots import axis_point, trace_field_point
from raytracer.optics.glass import AIR, constant_index_glass
from tests.analysis.lens_design.benches import bench_at, lens_of, sensor, shipped, thin_lens


def foote(angle_deg, f_number):
    """E / (pi L) of a disc at right angles to the axis, off that: Foote 1915, Bull. Bur. Standards 12."""
    p, t = math.tan(math.radians(angle_deg)), 1.0 / (2.0 * f_number)
    root = math.sqrt(p**4 + 2.0 * p**2 * (1.0 - t**2) + (1.0 + t**2) ** 2)
    return 0.5 * (1.0 - (1.0 + p**2 - t**2) / root)


@pytest.mark.parametrize(("angle", "f_number"), [(0.0, 1.4), (20.0, 1.4), (35.0, 2.0)])
def test_a_disc_is_as_foote_has_it(angle, f_number):
    # A lens of next to no power, whose rim is the pupil.
    lens = lens_of(
        (1e-12, 1e-9, constant_index_glass(1.5), 100.0 / (2.0 * f_number), {"is_stop": True}), (0.0, 0.0, AIR, 500.0)
    )
    bench = bench_at(lens, film=100.0, sensor_mm=sensor(80.0))
    height = 100.0 * math.tan(math.radians(angle))
    found = projected_solid_angle(bench, "y", height) / math.pi
    assert found == pytest.approx(foote(angle, f_number), rel=3e-4)
    if (angle, f_number) == (20.0, 1.4):
        assert found == pytest.approx(0.092460, rel=3e-4)


def test_a_small_pupil_gives_cos4():
    lens = thin_lens(50.0, 0.0, constant_index_glass(1.5), 0.1)
    found = illumination(bench_at(lens))
    angle = np.arctan(found.image_height_mm / 50.0)
    np.testing.assert_allclose(found.cos4, np.cos(angle) ** 4, rtol=1e-7)
    np.testing.assert_allclose(found.relative, found.cos4, rtol=1e-3)
    np.testing.assert_allclose(found.pupil, 1.0, rtol=1e-3)


@pytest.mark.parametrize("f_number", [None, 8.0])
def test_the_film_and_the_scene_agree(f_number):
    # The light of a field point is the cross-section of its beam; a ring of the scene of solid angle sin(a) da is
    # imaged to h dh: so E(h) = beam sin(a) / (h dh/da).  One side traces from the film, the other from the scene.
    bench = set_up_bench(shipped("double-gauss-50mm"), Settings(f_number=f_number))
    parts = np.array([0.4, 0.7, 0.95])
    step = 1e-4
    scene = field_points(bench, "y", np.concatenate([parts, parts + step, parts - step]))
    beam = [float(trace_field_point(bench, point, 128)[0][1].sum()) for point in scene[: len(parts)]]
    full = float(trace_field_point(bench, axis_point(bench, "y"), 128)[0][1].sum())
    focal_length = first_order(bench).focal_length_mm
    height = parts * largest_height(bench, "y")
    for row in range(len(parts)):
        above, below = scene[row + len(parts)], scene[row + 2 * len(parts)]
        slope = (above.height - below.height) / math.radians(above.field_deg - below.field_deg)
        angle = math.radians(scene[row].field_deg)
        there = beam[row] / full * math.sin(angle) / (height[row] * slope) * focal_length**2
        here = projected_solid_angle(bench, "y", height[row]) / projected_solid_angle(bench, "y", 0.0)
        # The film is off the paraxial focus by the aberrations of a lens wide open.
        assert here == pytest.approx(there, rel=0.01)


def test_the_curve_is_smooth():
    # No rings: second differences are small and even up to where rims begin to cut the pupil off, from where it falls.
    bench = set_up_bench(shipped("double-gauss-50mm"), Settings(f_number=5.6, steps=81))
    relative = illumination(bench).relative
    second = np.diff(relative[:72], 2)
    assert np.abs(second).max() < 2e-4
    assert np.abs(np.diff(second)).max() < 5e-6
    assert (np.diff(relative[72:]) < 0.0).all()


def test_beyond_the_rim_it_is_dark():
    # A tube before and behind a lens lets nothing through beyond some angle.
    lens = lens_of(
        (0.0, 40.0, AIR, 5.0, {"kind": "flat"}),
        (0.01, 1.0, constant_index_glass(1.5), 5.0, {"is_stop": True}),
        (-0.01, 0.0, AIR, 5.0),
    )
    bench = bench_at(lens, sensor_mm=sensor(80.0))
    largest = largest_height(bench, "y")
    assert 10.0 < largest < 40.0
    assert projected_solid_angle(bench, "y", largest * 1.01) == 0.0
    assert projected_solid_angle(bench, "y", largest * 0.99) > 0.0
