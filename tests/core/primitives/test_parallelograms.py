"""Points of quads that light samples are drawn from."""

import math

import numpy as np
import pytest

from raytracer.core.primitives.parallelograms import Parallelograms
from tests.plugins.shapes.kernels import sample

TURN = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])


def quad(u, v):
    return Parallelograms(*(np.array([TURN @ edge]) for edge in ((0.5, -1.0, 2.0), u, v)), np.zeros(1, np.int32))


TABLES = {
    "rectangle": quad((2.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    "parallelogram": quad((2.0, 0.0, 0.0), (1.0, 1.0, 0.0)),
}

# Above it, touching it nearly, in its plane beside it, behind it, and far away; before the turn.
PLACES = [(1.2, -0.6, 3.0), (1.2, -0.6, 2.0 + 1e-9), (3.5, -0.6, 2.0), (0.6, -0.9, 1.5), (40.0, 30.0, 90.0)]


@pytest.mark.parametrize("table", TABLES.values(), ids=TABLES)
@pytest.mark.parametrize("place", PLACES)
def test_points_have_the_density_with_which_they_are_drawn(table, place):
    grid = (np.arange(200) + 0.5) / 200
    reference, (corner, u, v) = TURN @ place, (column[0] for column in table[:3])
    on = sample((table,), 0, 0, reference, np.stack(np.meshgrid(grid, grid), axis=2).reshape(-1, 2))
    assert ((on.uv >= 0.0) & (on.uv <= 1.0)).all()
    np.testing.assert_allclose(on.point, corner + on.uv @ [u, v], rtol=0.0, atol=1e-14)
    assert (on.gap > 0.0).all()
    np.testing.assert_allclose(on.twin, on.pdf, rtol=1e-6)
    if place in (PLACES[0], PLACES[3], PLACES[4]):
        # The mean of 1 / pdf is the solid angle.
        way = corner + grid[:, None, None] * u + grid[None, :, None] * v - reference
        solid_angle = (np.abs(way @ np.cross(u, v)) / np.linalg.norm(way, axis=2) ** 3).mean()
        assert (1.0 / on.pdf).mean() == pytest.approx(solid_angle, rel=2e-3)


def test_near_a_rectangle_directions_are_even():
    for place in PLACES[:2]:
        pdf = sample((TABLES["rectangle"],), 0, 0, TURN @ place, [(0.1, 0.0), (0.1, 0.3), (0.1, 0.999)]).pdf
        assert len({*pdf}) == 1
        assert 1.0 / pdf[0] < 2.0 * math.pi


def test_in_its_plane_nothing_is_drawn():
    corner, u, v = (column[0] for column in TABLES["rectangle"][:3])
    for a, b in ((0.5, 0.5), (2.0, 0.5)):
        (pdf,) = sample((TABLES["rectangle"],), 0, 0, corner + a * u + b * v, [(0.2, 0.7)]).pdf
        # Zero, or an angle that is rounding; never what is not a number.
        assert pdf == 0.0 or pdf > 1e6 or abs(1.0 / pdf - 2.0 * math.pi) < 1e-6
