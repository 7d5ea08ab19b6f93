"""Directions to a rectangle against the density and the solid angle by quadrature."""

import math

import numpy as np
import pytest

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.sampling.spherical_rectangle import (
    SMALLEST,
    pdf_spherical_rectangle,
    sample_spherical_rectangle,
    spherical_rectangle,
)
from tests.statistics import chi2_test
from tests.vectorised import rows, vectorised

RECTANGLES = {
    "over it": (-1.0, 2.0, -0.5, 1.0, 0.3),
    "beside it": (1.0, 3.0, 2.0, 2.5, 0.7),
    "behind both edges": (-3.0, -1.0, -2.0, -0.5, 0.4),
    "a strip": (-4.0, 5.0, 0.1, 0.2, 0.3),
    "far away": (10.0, 10.2, -3.0, -2.8, 20.0),
}


def density(x, y, z):
    """Solid angle of a square metre at a place."""
    return z / (x * x + y * y + z * z) ** 1.5


@kernel
def _draw(sides, u1, u2):
    x0, x1, y0, y1, z = sides
    return sample_spherical_rectangle(spherical_rectangle(x0, x1, y0, y1, z), u1, u2)


@kernel
def _seen(sides, x):
    x0, x1, y0, y1, z = sides
    seen = spherical_rectangle(x0, x1, y0, y1, z)
    return seen.solid_angle, pdf_spherical_rectangle(seen)


def drawn(sides, points):
    return vectorised(_draw)(sides, *map(rows, np.transpose(points)))


def solid_angle(sides):
    return vectorised(_seen)(sides, rows([0.0]))[0, 0]


@pytest.mark.parametrize("sides", RECTANGLES.values(), ids=RECTANGLES)
def test_directions_are_even_in_solid_angle(sides):
    x0, x1, y0, y1, z = sides
    pdf = vectorised(_seen)(sides, rows([0.0]))[0, 1]
    places = drawn(sides, np.random.default_rng(1).random((50_000, 2)))
    # By area the density is that of the direction times the solid angle of a square metre.
    chi2_test(
        places,
        lambda at: pdf * density(at[:, 0], at[:, 1], z),
        ((x0, x1), (y0, y1)),
        [16, 16],
        order=24,
        tests=len(RECTANGLES),
    )


@pytest.mark.parametrize("z", [1e-3, 1e-9, 1e-14])
def test_close_to_it_directions_are_those_of_half_a_sphere(z):
    sides = (-1.0, 2.0, -3.0, 1.0, z)
    assert solid_angle(sides) == pytest.approx(2.0 * math.pi, abs=5.0 * z)
    places = drawn(sides, np.random.default_rng(2).random((20_000, 2)))
    # Half of all directions are within 60 degrees of the axis.
    assert (np.hypot(*places.T) < math.sqrt(3.0) * z).mean() == pytest.approx(0.5, abs=0.015)


@pytest.mark.parametrize("place", [(0.3, 0.4), (3.0, 0.5), (-2.0, -1.0), (0.0, 0.0), (1.0, 0.5)])
@pytest.mark.parametrize("z", [0.0, 5e-324, 1e-300, 1e-160, 1e-30, 1e-17, 1e-12, 1e-6])
def test_edge_on_nothing_is_worse_than_a_fall_back(place, z):
    x, y = place
    sides = (-x, 1.0 - x, -y, 1.0 - y, z)
    inside = 0.0 < x < 1.0 and 0.0 < y < 1.0
    on_edge = not inside and 0.0 <= x <= 1.0 and 0.0 <= y <= 1.0
    if solid_angle(sides) < SMALLEST:
        assert z < 1e-6
        return
    assert inside or on_edge or solid_angle(sides) < 10.0 * z
    places = drawn(sides, np.random.default_rng(3).random((1000, 2)))
    assert np.isfinite(places).all()
    assert ((places >= (-x, -y)) & (places <= (1.0 - x, 1.0 - y))).all()


def test_the_solid_angle_of_a_cube_s_face_is_a_sixth_of_the_sphere():
    assert solid_angle((-1.0, 1.0, -1.0, 1.0, 1.0)) == pytest.approx(4.0 * math.pi / 6.0, rel=1e-14)


def test_a_grid_of_numbers_keeps_its_order():
    # Well spread numbers stay so: x rises with the first alone, y with the second.
    grid = (np.arange(16) + 0.5) / 16
    places = drawn(RECTANGLES["over it"], np.stack(np.meshgrid(grid, grid, indexing="ij"), axis=2).reshape(-1, 2))
    across, along = places.reshape(16, 16, 2).transpose(2, 0, 1)
    assert (across == across[:, :1]).all()
    assert (np.diff(across[:, 0]) > 0.0).all()
    assert (np.diff(along, axis=1) > 0.0).all()
