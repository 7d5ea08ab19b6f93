"""Surfaces and ray tracing: known prescriptions, formulas of single surfaces, and reversed rays."""

import math

import numpy as np
import pytest

from raytracer.optics.lens_system.first_order import cardinal_points, ray_transfer_matrix
from raytracer.optics.lens_system.focusing import image_distance
from raytracer.optics.lens_system.ray_tracing import refract, trace_rays
from tests.optics.lens_system.kernels import DOUBLE_GAUSS, DOUBLET, Surface, crossing, lens_of, met, pack_surfaces, unit
from tests.vectorised import rows, vectorised

AXIS = (0.0, 0.0, 1.0)


def test_the_doublet_is_that_of_the_book():
    # Kingslake, Johnson 2010: focal length 12.000, paraxial back focus 11.2858, marginal back focus at 2 mm 11.2939.
    lens = lens_of(DOUBLET)
    found = cardinal_points(lens)
    assert found.focal_length == pytest.approx(12.0, abs=5e-5)
    assert found.rear_focus - lens.vertex[-1] == pytest.approx(11.28584, abs=5e-5)
    # Its matrix as it is published, to the last digit but one.
    published = [[0.9404865, 0.9390067], [-0.0833332, 0.9800774]]
    np.testing.assert_allclose(ray_transfer_matrix(lens), published, rtol=0.0, atol=2e-7)
    heights = np.array([1e-6, 2.0 * (1.0 - 1e-9)])
    _, points, directions = trace_rays(lens, np.stack([0 * heights, heights, 0 * heights], axis=1), AXIS)
    paraxial, marginal = crossing(points, directions) - lens.vertex[-1]
    assert paraxial == pytest.approx(11.28584, abs=5e-5)
    assert marginal == pytest.approx(11.2939, abs=5e-5)


def test_the_lens_makers_equation():
    # 1/f = (n - 1) (c1 - c2 + (n - 1) t c1 c2 / n); principal planes: Kingslake, Johnson 2010, sec. 3.2.
    for c1, c2, thickness, n in ((0.02, -0.03, 5.0, 1.5), (0.05, 0.0, 3.0, 1.7), (-0.02, 0.03, 2.0, 1.6)):
        power = (n - 1.0) * (c1 - c2 + (n - 1.0) * thickness * c1 * c2 / n)
        found = cardinal_points(pack_surfaces([Surface(c1, thickness, n, 5.0), Surface(c2, 0.0, 1.0, 5.0)]))
        f = 1.0 / power
        assert found.focal_length == pytest.approx(f, rel=1e-14)
        assert found.front_principal == pytest.approx(-f * (n - 1.0) * thickness * c2 / n, abs=1e-13)
        assert found.rear_principal == pytest.approx(thickness - f * (n - 1.0) * thickness * c1 / n, abs=1e-13)
        assert found.rear_focus == pytest.approx(found.rear_principal + f, rel=1e-14)
        assert found.front_focus == pytest.approx(found.front_principal - f, rel=1e-14)


def test_focal_lengths_in_water():
    # One surface between n and n': f' = n' / power behind it and f = n / power before it.
    lens = pack_surfaces([Surface(0.1, 0.0, 1.5, 2.0)], before=1.33)
    found = cardinal_points(lens)
    power = (1.5 - 1.33) * 0.1
    assert found.rear_focus == pytest.approx(1.5 / power)
    assert found.front_focus == pytest.approx(-1.33 / power)
    assert (found.front_principal, found.rear_principal) == (0.0, 0.0)


@pytest.mark.parametrize("rows", [DOUBLET, DOUBLE_GAUSS])
@pytest.mark.parametrize("towards_film", [True, False])
def test_rays_near_the_axis_follow_the_matrix(rows, towards_film):
    lens = lens_of(rows)
    matrix = ray_transfer_matrix(lens)
    first, last, side = lens.vertex[0], lens.vertex[-1], 1.0
    if not towards_film:
        # Backwards: the inverse, with slopes against the axis.
        flip = np.diag([1.0, -1.0])
        matrix = flip @ np.linalg.inv(matrix) @ flip
        first, last, side = last, first, -1.0
    for height, slope in ((1e-6, 0.0), (0.0, 1e-6), (1e-6, -2e-6)):
        weight, points, directions = trace_rays(
            lens, [0.0, height, first], unit([0.0, slope, side]), towards_film=towards_film
        )
        assert weight[0] == 1.0
        out = directions[0, 1] / (side * directions[0, 2])
        at_vertex = points[0, 1] + out * side * (last - points[0, 2])
        np.testing.assert_allclose((at_vertex, out), matrix @ (height, slope), rtol=0.0, atol=1e-15)


def test_one_surface_refracts_by_snell_and_is_met_on_its_sphere():
    rng = np.random.default_rng(1)
    for curvature in (-0.1, -1e-9, 0.0, 1e-3, 0.1):
        origins = np.stack([rng.uniform(-2, 2, 500), rng.uniform(-2, 2, 500), np.full(500, -20.0)], axis=1)
        ways = unit(np.stack([rng.uniform(-0.2, 0.2, 500), rng.uniform(-0.2, 0.2, 500), np.ones(500)], axis=1))
        lens = pack_surfaces([Surface(curvature, 0.0, 1.7, 9.0)])
        weights, points, onward = trace_rays(lens, origins, ways)
        assert weights.all()
        # On the sphere c r^2 = 2 z, and on the ray.
        np.testing.assert_allclose(curvature * (points**2).sum(axis=1), 2.0 * points[:, 2], rtol=0.0, atol=2e-14)
        along = ((points - origins) * ways).sum(axis=1)
        np.testing.assert_allclose(points, origins + along[:, None] * ways, rtol=0.0, atol=2e-14)
        # n x d is kept: Snell's law with its plane.
        normals = np.array([0.0, 0.0, 1.0]) - curvature * points
        np.testing.assert_allclose(np.cross(normals, ways), 1.7 * np.cross(normals, onward), rtol=0.0, atol=4e-15)
        np.testing.assert_allclose(np.linalg.norm(onward, axis=1), 1.0, rtol=0.0, atol=4e-15)


def test_snells_law_in_longer_numbers():
    """t = mu d + (c_t - mu c_i) N with c_t^2 = 1 - mu^2 (1 - c_i^2), in numbers of 64 bits of mantissa or more.

    Roundings of c_t^2 are as much larger in c_t as that is smaller.
    """
    rng = np.random.default_rng(3)
    if np.finfo(np.longdouble).eps == np.finfo(np.float64).eps:
        pytest.skip("this machine has no longer numbers")
    reflected = 0
    for mu in (0.3, 1.0 / 1.5, 1.0, 1.2, 1.9):
        directions, normals = unit(rng.normal(size=(400, 3))), unit(rng.normal(size=(400, 3)))
        cosines = (directions * normals).sum(axis=1)
        found, onward = vectorised(refract)(*map(rows, (directions, normals, cosines)), mu)
        m, c = np.longdouble(mu), cosines.astype(np.longdouble)
        # Of directions that are units to rounding the truth is that of their own product.
        square = 1 - m * m * (1 - c * c)
        goes = square > 0
        assert (found[~goes] == 0.0).all()
        reflected += (~goes).sum()
        along = np.copysign(np.sqrt(np.maximum(square, 0)), c) - m * c
        off = np.abs(onward - (m * directions + along[:, None] * normals)).max(axis=1)[goes]
        slack = 1e-15 * (1.0 + 1.0 / np.abs(found[goes]))
        assert (off <= slack).all()
        assert ((slack < 1e-12) | (np.abs(found[goes]) < 2e-3)).all()
    assert 100 < reflected < 1500


def test_rays_come_back_the_way_they_went():
    lens = lens_of(DOUBLE_GAUSS)
    rng = np.random.default_rng(2)
    origins = np.stack([rng.uniform(-9, 9, 2000), rng.uniform(-9, 9, 2000), np.full(2000, -30.0)], axis=1)
    ways = unit(np.stack([rng.uniform(-0.2, 0.2, 2000), rng.uniform(-0.2, 0.2, 2000), np.ones(2000)], axis=1))
    weights, points, onward = trace_rays(lens, origins, ways)
    passed = weights == 1.0
    assert 0.2 < passed.mean() < 0.8
    again, back, directions = trace_rays(lens, (points + 40.0 * onward)[passed], -onward[passed], towards_film=False)
    assert again.all()
    np.testing.assert_allclose(directions, -ways[passed], rtol=0.0, atol=1e-13)
    along = (back[:, 2] - origins[passed, 2]) / ways[passed, 2]
    np.testing.assert_allclose(back, origins[passed] + along[:, None] * ways[passed], rtol=0.0, atol=1e-12)


def test_a_stop_and_a_boundary_between_equals_change_nothing():
    plain = pack_surfaces([Surface(0.03, 4.0, 1.6, 9.0), Surface(-0.02, 0.0, 1.0, 9.0)])
    more = pack_surfaces(
        [
            Surface(0.03, 2.0, 1.6, 9.0),
            Surface(0.05, 2.0, 1.6, 9.0),
            Surface(-0.02, 1.0, 1.0, 9.0),
            Surface(0.0, 0.0, 1.0, 9.0, is_stop=True),
        ]
    )
    assert more.stop == 3
    origins = np.stack([np.zeros(50), np.linspace(-5, 5, 50), np.full(50, -9.0)], axis=1)
    _, points, onward = trace_rays(plain, origins, AXIS)
    _, later, same = trace_rays(more, origins, AXIS)
    np.testing.assert_allclose(same, onward, rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(crossing(later, same)[1:-1], crossing(points, onward)[1:-1], rtol=1e-13)


def test_rims_and_the_diaphragm_stop_rays():
    heights = np.linspace(0.0, 13.0, 1301)
    origins = np.stack([heights, 0 * heights, 0 * heights - 1.0], axis=1)
    weights, _, _ = trace_rays(lens_of(DOUBLE_GAUSS), origins, AXIS)
    stopped, _, _ = trace_rays(lens_of(DOUBLE_GAUSS, stop=2.0), origins, AXIS)
    # Each lets through what is near the axis, up to one height; that of the smaller stop in proportion.
    assert (np.diff(weights) <= 0.0).all()
    assert (np.diff(stopped) <= 0.0).all()
    largest, smaller = heights[weights == 1.0].max(), heights[stopped == 1.0].max()
    assert largest == pytest.approx(50.358 / 2.0 / 2.0, rel=0.02)
    assert smaller / largest == pytest.approx(2.0 / 8.55, rel=0.02)


@pytest.mark.parametrize("curvature", [-0.1, 0.0, 0.1])
def test_rays_that_miss_or_come_from_behind_do_not_meet(curvature):
    origins = [[0, 30, -5], [0, 1, -5], [0, 1, 5], [0, 0, -5], [0, np.nan, -5], [0, 1, -5], [0, np.inf, 0]]
    ways = [[0, 0, 1], [0, 1, 0], [0, 0, -1], [0, 0, 1], [0, 0, 1], [0, np.nan, 1], [0, 0, 1]]
    distances, cosines = met(curvature, origins, ways)
    assert np.isfinite(cosines).all()
    met_ones = [number for number, cosine in enumerate(cosines) if cosine != 0.0]
    # Out of a bowl that opens to the scene a ray may go sideways.
    assert met_ones == {0.0: [0, 3], 0.1: [3], -0.1: [1, 3]}[curvature]
    assert distances[3] == 5.0


def test_a_front_that_bulges_is_met_from_the_side():
    # A fisheye's front sees more than a half space: along the axis of x, and from behind its vertex.
    for way in ([-1.0, 0.0, 0.0], [-1.0, 0.0, -0.2]):
        direction = unit(way)[0]
        on = np.array([0.8, 0.0, 1.0 - math.sqrt(1.0 - 0.64)])
        distances, cosines = met(1.0, on - 7.0 * direction, direction)
        assert distances[0] == pytest.approx(7.0, abs=1e-14)
        assert cosines[0] > 0.0


@pytest.mark.parametrize("distance", [math.inf, 1e6, 1000.0, 200.0])
def test_focus_is_between_that_of_the_axis_and_of_the_rim(distance):
    lens = lens_of(DOUBLE_GAUSS)
    found = cardinal_points(lens)
    # Newton's equation from the focal points, and the most that spherical aberration shifts focus at f/2: 1 %.
    away = distance + found.front_focus
    paraxial = found.rear_focus - lens.vertex[-1] + found.focal_length**2 / away
    assert image_distance(lens, distance, towards_film=True) == pytest.approx(paraxial, rel=0.01)
    narrow = lens_of(DOUBLE_GAUSS, stop=0.01)
    assert image_distance(narrow, distance, towards_film=True) == pytest.approx(paraxial, rel=1e-6)


def test_the_image_of_the_image_is_the_object():
    for stop in (None, 1.0, 1e-3):
        lens = lens_of(DOUBLE_GAUSS, stop=stop)
        nearest = image_distance(lens, 60.0, towards_film=False)
        assert nearest > 0.0
        assert image_distance(lens, nearest, towards_film=True) == pytest.approx(60.0, rel=1e-3)


def test_light_that_leaves_diverging_has_its_image_before_the_last_surface():
    # Only light within 1e-9 mm of the axis would pass two rims that are half a metre apart and not on one line to it.
    glass = pack_surfaces([Surface(-1.0, 500.0, 1.9, 1.0), Surface(1.0, 0.0, 1.0, 1.0)])
    for distance, towards_film in ((10.0, True), (50.0, False), (math.inf, True)):
        assert image_distance(glass, distance, towards_film) == pytest.approx(-0.8286, abs=1e-4)
