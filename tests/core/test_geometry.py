"""Solving hits in float64, bounds of float32's errors, and densities: each against its definition."""

import math

import numpy as np
import pytest

from raytracer.core import geometry
from raytracer.core.geometry import Exact
from tests.vectorised import rows, vectorised

RNG = np.random.default_rng(1)
DOWN, ORIGIN = (0.0, 0.0, -1.0), (0.0, 0.0, 0.0)
sphere_distance, plane_distance = vectorised(geometry.sphere_distance), vectorised(geometry.plane_distance)


def test_rows_are_float64_whatever_the_table():
    # Numba's float() leaves a float32 as it is, and all that follows would be computed in float32.
    for dtype in (np.float32, np.float64):
        table = np.array([[1.0, 2.0, 3.0], [0.1, 0.2, 0.3]], dtype)
        assert vectorised(geometry.row3)(table, rows([1]))[0, 0] / 3.0 == float(dtype(0.1)) / 3.0


def test_padded_copies_with_readable_bytes_behind():
    given = np.arange(6.0).reshape(2, 3)
    out = geometry.pad_buffer(given, np.float32)
    np.testing.assert_array_equal(out, given)
    assert out.dtype == np.float32
    assert out.flags.c_contiguous
    # Embree reads 16 bytes at a time, so up to 12 behind the last float3.
    assert out.base.nbytes - out.nbytes >= 12
    given[0, 0] = 9.0
    assert out[0, 0] == 0.0


def test_sphere_distance():
    # Straight at a unit sphere: d - 1 and d + 1; and the nearer to what float32 found is taken.
    d = np.array([2.0, 1e3, 1e6, 1e9])
    origins = rows(d[:, None] * (0.0, 0.0, 1.0))
    for side in (-1.0, 1.0):
        t = sphere_distance(Exact(), origins, DOWN, ORIGIN, 1.0, rows(d + side - 0.1))
        assert (np.abs(t - (d + side)) <= 2.0**-52 * d).all()
    # Aside, by the quadratic.
    b, d = RNG.uniform(0.0, 0.999, 500), RNG.uniform(2.0, 1e4, 500)
    t = sphere_distance(Exact(), rows(np.stack([b, 0.0 * b, d], axis=1)), DOWN, ORIGIN, 1.0, rows(d - 1.0))
    height = np.sqrt((1.0 - b) * (1.0 + b))
    assert (np.abs(t - (d - height)) <= 2.0**-52 * (d + 4.0 / height)).all()
    # Embree may find what float64 just misses: the closest approach is what there is.
    t = sphere_distance(Exact(), rows([(1.0 + 1e-9, 0.0, 5.0)]), DOWN, ORIGIN, 1.0, rows([5.0]))
    assert t[0] == pytest.approx(5.0, abs=1e-14)


def test_plane_distance():
    # Height over the sine of the slope; a ray in the plane has no distance of its own, and no division by zero.
    slope = math.radians(10.0)
    origins, ways = [(0.0, 2.0, 0.0), ORIGIN], [(math.cos(slope), -math.sin(slope), 0.0), (1.0, 0.0, 0.0)]
    t = plane_distance(Exact(), rows(origins), rows(ways), (7.0, 0.0, 3.0), (0.0, 1.0, 0.0), 11.0)
    np.testing.assert_allclose(t, [2.0 / math.sin(slope), 11.0], rtol=1e-15)


def test_fast_takes_distances_as_found():
    far = rows([(0.0, 0.0, 9.0)])
    assert sphere_distance(None, far, DOWN, ORIGIN, 1.0, 8.125) == 8.125
    assert plane_distance(None, far, DOWN, ORIGIN, (0.0, 0.0, 1.0), 9.125) == 9.125


def test_offset_is_four_ulps_of_the_largest_coordinate():
    # Hard cases, finding 1: k 2^-23 (max|c| + R) with k = 4; 9.5e-4 for the ground sphere of One Weekend's 2000.
    offset = vectorised(geometry.spawn_offset)(rows([2000.0]))
    assert offset == pytest.approx(4.0 * np.spacing(np.float32(1.0)) * 2000.0)


@pytest.mark.parametrize("extent", [1e-3, 1.0, 1e4])
def test_gaps_cover_what_float32_rounds(extent):
    # Straight on, at least half an ulp of the distance and of the coordinates; more at a slant, never less than flat.
    distance = 3.0 * extent
    ulp = float(np.spacing(np.float32(distance + extent)))
    straight, slanted = vectorised(geometry.plane_gap)(extent, distance, rows([1.0, 0.1]))
    assert ulp < straight < 32.0 * ulp
    assert slanted == pytest.approx(5.5 * straight)
    # Of a sphere: sqrt(h^2 + 2 r e) - h, which is e / cos well inside of the limb, and sqrt(2 r e) on it.
    error = 4.0 * 2.0**-23 * (extent + distance)
    inside, limb = vectorised(geometry.sphere_gap)(extent, distance, rows([1.0, 0.0]), extent)
    assert inside == pytest.approx(2.0 * error, rel=1e-3)
    assert limb == pytest.approx(math.sqrt(2.0 * extent * error) + error)


def test_density_of_area_in_solid_angle():
    # d^2 / (A cos): 2 m above a square metre, straight down and 60 degrees aside; edge on it is never seen.
    normals, area = [(0.0, 1.0, 0.0), (0.0, 0.5, math.sqrt(0.75)), (1.0, 0.0, 0.0)], [1.0, 0.5, 1.0]
    pdf = vectorised(geometry.area_pdf)(ORIGIN, (0.0, -2.0, 0.0), rows(normals), rows(area))
    np.testing.assert_allclose(pdf, [4.0, 16.0, 0.0])
    # A deforming triangle may be flat for a moment: its normal is 0 / 0, and its density must not become that.
    normals, area = [(math.nan,) * 3, (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)], [0.0, 3.0, 4.0]
    drawn = vectorised(geometry.area_light_point)(ORIGIN, (0.0, 0.0, 2.0), rows(normals), rows(area), 1.0, 0.5, 0.5)
    np.testing.assert_allclose(drawn.pdf, [0.0, 0.0, 1.0])


def test_barycentric_coordinates_of_a_point():
    a, edge1, edge2 = np.array([1.0, 2.0, 3.0]), np.array([0.7, 0.1, -0.3]), np.array([-0.2, 1.5, 0.4])
    uv = RNG.random((100, 2))
    edges = (tuple(map(float, vector)) for vector in (a, edge1, edge2))
    result = vectorised(geometry.barycentric)(rows(a + uv @ [edge1, edge2]), *edges)
    np.testing.assert_allclose(result, uv, rtol=0.0, atol=1e-14)


def test_points_keep_their_distance_from_the_edges():
    a, b = RNG.uniform(-0.5, 1.5, (2, 1000))
    margins = 10.0 ** RNG.uniform(-9.0, 1.0, (2, 1000))
    inside = vectorised(geometry.clamp_to_quad)(rows(a), rows(b), *map(rows, margins))
    for value, given, margin in zip(inside.T, (a, b), np.minimum(margins, 0.5), strict=True):
        assert ((margin <= value) & (value <= 1.0 - margin)).all()
        kept = (margin <= given) & (given <= 1.0 - margin)
        np.testing.assert_array_equal(value[kept], given[kept])
    inside = vectorised(geometry.clamp_to_triangle)(rows(a), rows(b), rows(margins[0]))
    least = np.minimum(margins[0], 1.0 / 3.0)
    assert (np.minimum(inside.min(axis=1), 1.0 - inside.sum(axis=1)) >= least - 4.0 * 2.0**-53).all()
    kept = np.minimum(np.minimum(a, b), 1.0 - a - b) >= least
    np.testing.assert_array_equal(inside[kept], np.stack([a, b], axis=1)[kept])
