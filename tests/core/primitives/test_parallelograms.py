"""Points of quads that light samples are drawn from."""

import math

import numpy as np
import pytest

from raytracer.core.primitives.base.interface import pdf_point, sample_point
from raytracer.core.primitives.parallelograms import Parallelograms

TURN = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])


def quad(u, v):
    rows = [np.ascontiguousarray(TURN @ np.array([edge], np.float64).T).T for edge in ((0.5, -1.0, 2.0), u, v)]
    return Parallelograms(*(np.ascontiguousarray(row) for row in rows), np.zeros(1, np.int32))


TABLES = {"rectangle": quad((2.0, 0.0, 0.0), (0.0, 1.0, 0.0)), "parallelogram": quad((2.0, 0.0, 0.0), (1.0, 1.0, 0.0))}

# Above it, touching it nearly, in its plane beside it, behind it, and far away; before the turn.
PLACES = [(1.2, -0.6, 3.0), (1.2, -0.6, 2.0 + 1e-9), (3.5, -0.6, 2.0), (0.6, -0.9, 1.5), (40.0, 30.0, 90.0)]


def point_at(place):
    return tuple(float(value) for value in TURN @ np.array(place))


@pytest.mark.parametrize("table", TABLES.values(), ids=TABLES)
@pytest.mark.parametrize("place", PLACES)
def test_the_density_of_a_point_is_that_with_which_it_is_drawn(table, place):
    reference = point_at(place)
    for u1, u2 in np.random.default_rng(1).random((50, 2)):
        on = sample_point(table, 0, reference, float(u1), float(u2), None)
        corner, u, v = table.corner[0], table.u[0], table.v[0]
        assert 0.0 <= on.u <= 1.0
        assert 0.0 <= on.v <= 1.0
        np.testing.assert_allclose(on.point, corner + on.u * u + on.v * v, rtol=0.0, atol=1e-14)
        assert on.gap > 0.0
        assert pdf_point(table, 0, reference, on.point, on.normal, None) == pytest.approx(on.pdf, rel=1e-6)


@pytest.mark.parametrize("table", TABLES.values(), ids=TABLES)
@pytest.mark.parametrize("place", [PLACES[0], PLACES[3], PLACES[4]])
def test_one_over_the_density_has_the_solid_angle_as_its_mean(table, place):
    reference = point_at(place)
    grid = (np.arange(200) + 0.5) / 200
    corner, u, v = table.corner[0], table.u[0], table.v[0]
    way = corner + grid[:, None, None] * u + grid[None, :, None] * v - np.array(reference)
    solid_angle = (np.abs(way @ np.cross(u, v)) / np.linalg.norm(way, axis=2) ** 3).mean()
    coarse = (np.arange(40) + 0.5) / 40
    found = [1.0 / sample_point(table, 0, reference, float(a), float(b), None).pdf for a in coarse for b in coarse]
    assert np.mean(found) == pytest.approx(solid_angle, rel=2e-3)


def test_near_a_rectangle_directions_are_even():
    for place in PLACES[:2]:
        pdfs = {sample_point(TABLES["rectangle"], 0, point_at(place), 0.1, u, None).pdf for u in (0.0, 0.3, 0.999)}
        assert len(pdfs) == 1
        assert 1.0 / pdfs.pop() < 2.0 * math.pi


def test_in_its_plane_nothing_is_drawn():
    corner, u, v = (TABLES["rectangle"]._asdict()[name][0] for name in ("corner", "u", "v"))
    for a, b in ((0.5, 0.5), (2.0, 0.5)):
        reference = tuple(float(value) for value in corner + a * u + b * v)
        on = sample_point(TABLES["rectangle"], 0, reference, 0.2, 0.7, None)
        # Zero, or an angle that is rounding; never what is not a number.
        assert on.pdf == 0.0 or on.pdf > 1e6 or abs(1.0 / on.pdf - 2.0 * math.pi) < 1e-6
