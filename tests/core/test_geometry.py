"""Solving hits in float64, bounds of float32's errors, and densities: each against its definition."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from raytracer.core import geometry
from raytracer.core.compiler.dispatch import entry
from raytracer.core.geometry import Exact

unit_interval = st.floats(0.0, 1.0)


@entry
def _sphere_distance(accuracy, origin, direction, center, radius, near):
    return geometry.sphere_distance(accuracy, origin, direction, center, radius, near)


@entry
def _plane_distance(accuracy, origin, direction, point, normal, near):
    return geometry.plane_distance(accuracy, origin, direction, point, normal, near)


@entry
def _row3(table, index):
    return geometry.row3(table, index)


def test_rows_are_float64_whatever_the_table():
    # Numba's float() leaves a float32 as it is, and all that follows would be computed in float32.
    for dtype in (np.float32, np.float64):
        table = np.array([[1.0, 2.0, 3.0], [0.1, 0.2, 0.3]], dtype)
        third = _row3(table, 1)[0] / 3.0
        assert third == float(dtype(0.1)) / 3.0


def test_padded_copies_with_readable_bytes_behind():
    rows = np.arange(6.0).reshape(2, 3)
    out = geometry.pad_buffer(rows, np.float32)
    np.testing.assert_array_equal(out, rows)
    assert out.dtype == np.float32
    assert out.flags.c_contiguous
    assert out.base is not None
    # Embree reads 16 bytes at a time, so up to 12 behind the last float3.
    assert out.base.nbytes - out.nbytes >= 12
    rows[0, 0] = 9.0
    assert out[0, 0] == 0.0


@pytest.mark.parametrize("distance", [2.0, 1e3, 1e6, 1e9])
def test_sphere_distance_far_off(distance):
    # Straight at a unit sphere: d - 1 and d + 1; and the nearer to what float32 found is taken.
    at = (0.0, 0.0, 0.0)
    for near, expected in ((distance - 1.1, distance - 1.0), (distance + 0.9, distance + 1.0)):
        t = _sphere_distance(Exact(), (0.0, 0.0, distance), (0.0, 0.0, -1.0), at, 1.0, near)
        assert t == pytest.approx(expected, abs=2.0**-52 * distance)


@given(st.floats(0.0, 0.999), st.floats(2.0, 1e4))
def test_sphere_distance_solves_the_quadratic(b, distance):
    t = _sphere_distance(Exact(), (b, 0.0, distance), (0.0, 0.0, -1.0), (0.0, 0.0, 0.0), 1.0, distance - 1.0)
    height = math.sqrt((1.0 - b) * (1.0 + b))
    assert t == pytest.approx(distance - height, abs=2.0**-52 * (distance + 4.0 / height))


def test_sphere_distance_of_a_ray_that_passes_by():
    # Embree may find what float64 just misses: the closest approach is what there is.
    t = _sphere_distance(Exact(), (1.0 + 1e-9, 0.0, 5.0), (0.0, 0.0, -1.0), (0.0, 0.0, 0.0), 1.0, 5.0)
    assert t == pytest.approx(5.0, abs=1e-14)


def test_plane_distance():
    # Height over the sine of the slope.
    slope = math.radians(10.0)
    t = _plane_distance(
        Exact(), (0.0, 2.0, 0.0), (math.cos(slope), -math.sin(slope), 0.0), (7.0, 0.0, 3.0), (0.0, 1.0, 0.0), 11.0
    )
    assert t == pytest.approx(2.0 / math.sin(slope), rel=1e-15)
    # A ray in the plane has no distance of its own, and no division by zero.
    assert _plane_distance(Exact(), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (7.0, 0.0, 3.0), (0.0, 1.0, 0.0), 11.0) == 11.0


def test_fast_takes_distances_as_found():
    far = (0.0, 0.0, 9.0)
    assert _sphere_distance(None, far, (0.0, 0.0, -1.0), (0.0, 0.0, 0.0), 1.0, 8.125) == 8.125
    assert _plane_distance(None, far, (0.0, 0.0, -1.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 9.125) == 9.125


def test_offset_is_four_ulps_of_the_largest_coordinate():
    # Hard cases, finding 1: k 2^-23 (max|c| + R) with k = 4; 4.8e-4 for the ground sphere of One Weekend's 2000.
    assert geometry.spawn_offset(2000.0) == pytest.approx(4.0 * np.spacing(np.float32(1.0)) * 2000.0)
    assert geometry.spawn_offset(2000.0) == pytest.approx(9.5367e-4, rel=1e-4)


@pytest.mark.parametrize("extent", [1e-3, 1.0, 1e4])
def test_gaps_cover_what_float32_rounds(extent):
    # Straight on, at least half an ulp of the distance and of the coordinates; more at a slant, never less than flat.
    distance = 3.0 * extent
    ulp = float(np.spacing(np.float32(distance + extent)))
    straight = geometry.plane_gap(extent, distance, 1.0)
    assert ulp < straight < 32.0 * ulp
    assert geometry.plane_gap(extent, distance, 0.1) == pytest.approx(5.5 * straight)
    # Of a sphere: sqrt(h^2 + 2 r e) - h, which is e / cos well inside of the limb, and sqrt(2 r e) on it.
    error = geometry.spawn_offset(extent + distance)
    assert geometry.sphere_gap(extent, distance, 1.0, extent) == pytest.approx(2.0 * error, rel=1e-3)
    assert geometry.sphere_gap(extent, distance, 0.0, extent) == pytest.approx(math.sqrt(2.0 * extent * error) + error)


def test_density_of_area_in_solid_angle():
    # d^2 / (A cos): 2 m above a square metre, straight down and 60 degrees aside; edge on it is never seen.
    down = (0.0, -2.0, 0.0)
    assert geometry.area_pdf((0.0, 0.0, 0.0), down, (0.0, 1.0, 0.0), 1.0) == pytest.approx(4.0)
    assert geometry.area_pdf((0.0, 0.0, 0.0), down, (0.0, 0.5, math.sqrt(0.75)), 0.5) == pytest.approx(16.0)
    assert geometry.area_pdf((0.0, 0.0, 0.0), down, (1.0, 0.0, 0.0), 1.0) == 0.0


@given(unit_interval, unit_interval)
def test_barycentric_coordinates_of_a_point(u, v):
    a, edge1, edge2 = np.array([1.0, 2.0, 3.0]), np.array([0.7, 0.1, -0.3]), np.array([-0.2, 1.5, 0.4])
    point = a + u * edge1 + v * edge2
    assert geometry.barycentric(tuple(point), tuple(a), tuple(edge1), tuple(edge2)) == pytest.approx((u, v), abs=1e-14)


margins = st.floats(1e-9, 10.0)


@given(st.floats(-0.5, 1.5), st.floats(-0.5, 1.5), margins, margins)
def test_points_of_quads_keep_their_distance_from_the_edges(a, b, margin_a, margin_b):
    inside = geometry.clamp_to_quad(a, b, margin_a, margin_b)
    for value, given_value, margin in zip(inside, (a, b), (min(margin_a, 0.5), min(margin_b, 0.5)), strict=True):
        assert margin <= value <= 1.0 - margin
        if margin <= given_value <= 1.0 - margin:
            assert value == given_value


@given(st.floats(-0.5, 1.5), st.floats(-0.5, 1.5), margins)
def test_points_of_triangles_keep_their_distance_from_the_edges(u, v, margin):
    x, y = geometry.clamp_to_triangle(u, v, margin)
    least = min(margin, 1.0 / 3.0)
    rounding = 4.0 * 2.0**-53
    assert min(x, y, 1.0 - x - y) >= least - rounding
    if min(u, v, 1.0 - u - v) >= least:
        assert (x, y) == (u, v)


@entry
def _drawn(reference, point, normal, area):
    drawn = geometry.area_light_point(reference, point, normal, area, 1.0, 0.5, 0.5)
    return drawn.pdf, drawn.gap


def test_what_has_no_area_is_never_drawn():
    # A deforming triangle may be flat for a moment: its normal is 0 / 0, and its density must not become that.
    nothing = (math.nan, math.nan, math.nan)
    assert _drawn((0.0, 0.0, 0.0), (0.0, 0.0, 2.0), nothing, 0.0)[0] == 0.0
    assert _drawn((0.0, 0.0, 0.0), (0.0, 0.0, 2.0), (1.0, 0.0, 0.0), 3.0)[0] == 0.0
    assert _drawn((0.0, 0.0, 0.0), (0.0, 0.0, 2.0), (0.0, 0.0, 1.0), 4.0)[0] == pytest.approx(1.0)
