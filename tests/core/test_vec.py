"""Vectors against NumPy, and frames at the normals where formulas for them are known to fail."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from raytracer.core import vec

components = st.floats(-1e6, 1e6, allow_subnormal=False)
vectors = st.tuples(components, components, components)


@given(vectors, vectors, components)
def test_arithmetic_is_that_of_numpy(a, b, s):
    x, y = np.array(a), np.array(b)
    np.testing.assert_array_equal(vec.add(a, b), x + y)
    np.testing.assert_array_equal(vec.sub(a, b), x - y)
    np.testing.assert_array_equal(vec.mul(a, b), x * y)
    np.testing.assert_array_equal(vec.scale(s, a), s * x)
    np.testing.assert_array_equal(vec.neg(a), -x)
    # Contraction to fused multiply-adds may drop a rounding.
    size = np.abs(x).max() * np.abs(y).max()
    np.testing.assert_allclose(
        vec.madd(a, s, b), x + s * y, rtol=0.0, atol=1e-15 * (np.abs(x).max() + abs(s) * np.abs(y).max())
    )
    assert vec.dot(a, b) == pytest.approx(float(x @ y), abs=1e-15 * 3.0 * size)
    np.testing.assert_allclose(vec.cross(a, b), np.cross(x, y), rtol=0.0, atol=1e-15 * 2.0 * size)
    assert vec.norm(a) == pytest.approx(float(np.linalg.norm(x)), rel=1e-15)
    assert vec.max_component(a) == max(a)
    assert vec.max_abs(a) == max(map(abs, a))


def test_black_is_all_zeros():
    assert vec.is_black((0.0, -0.0, 0.0))
    assert not vec.is_black((0.0, 1e-300, 0.0))
    assert not vec.is_black((0.0, 0.0, math.nan))


@given(vectors.filter(lambda v: max(map(abs, v)) > 1e-3))
def test_normalize_gives_unit_vectors(a):
    unit = vec.normalize(a)
    assert vec.norm(unit) == pytest.approx(1.0, abs=4e-16)
    np.testing.assert_allclose(np.cross(unit, a) / np.linalg.norm(a), 0.0, atol=1e-15)


@given(vectors.filter(lambda v: max(map(abs, v)) > 1e-3), st.floats(-1e-4, 1e-4))
def test_renormalize_squares_the_error_of_a_length(a, error):
    mended = vec.renormalize(vec.scale(1.0 + error, vec.normalize(a)))
    assert vec.norm(mended) == pytest.approx(1.0, abs=1.6 * error**2 + 1e-15)


def test_normalize_of_zero_is_not_a_number():
    assert all(math.isnan(component) for component in vec.normalize((0.0, 0.0, 0.0)))


HARD_NORMALS = [
    # Where Frisvad's frame is wrong by 0.29 in float32 (Duff et al. 2017); hard case 36.
    (0.00038527316, 0.00038460016, -0.99999988079),
    (0.0, 0.0, 1.0),
    (0.0, 0.0, -1.0),
    (1.0, 0.0, 0.0),
    (0.0, -1.0, 0.0),
    (1e-17, 1e-17, -1.0),
    (1.0, 0.0, -0.0),
    # The same at the pole of our frame, and where squares underflow.
    (0.00038527316, -0.99999988079, 0.00038460016),
    (1e-17, -1.0, -1e-17),
    (1e-150, -1.0, 1e-151),
    (-1e-154, -1.0, 1e-154),
    (1e-160, -1.0, 0.0),
    (0.0, 1.0, 1e-160),
]


@pytest.mark.parametrize("normal", HARD_NORMALS)
def test_basis_at_hard_normals(normal):
    _check_basis(vec.normalize(normal))


@given(vectors.filter(lambda v: max(map(abs, v)) > 1e-3))
def test_basis_is_a_right_handed_frame(a):
    _check_basis(vec.normalize(a))


@pytest.mark.parametrize("plane", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.6, 0.0, -0.8)])
def test_basis_is_continuous(plane):
    # Normals on both sides of a plane: a frame that is turned the shortest way from y changes by |dn| / cos(angle / 2).
    rng = np.random.default_rng(3)
    across = 1e-7 * np.array(plane)
    for normal in rng.normal(size=(200, 3)):
        within = normal - (normal @ plane) * np.array(plane)
        n, m = (vec.normalize(tuple((within + side * across).tolist())) for side in (1.0, -1.0))
        # cos^2 (angle / 2) = (1 + y) / 2.
        bound = np.linalg.norm(np.subtract(n, m)) * math.sqrt(2.0 / (1.0 + min(n[1], m[1])))
        for one, other in zip(vec.basis(n), vec.basis(m), strict=True):
            assert np.linalg.norm(np.subtract(one, other)) <= 1.001 * bound + 3e-15


def _check_basis(n):
    s, t = vec.basis(n)
    frame = np.array([s, t, n])
    # Three products of two numbers each, which are wrong by up to four roundings.
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), rtol=0.0, atol=3e-15)
    np.testing.assert_allclose(np.cross(s, t), n, rtol=0.0, atol=3e-15)
    # Coordinates in the frame come out in the world, the third along the normal.
    local = (0.2, -0.5, 0.7)
    np.testing.assert_allclose(vec.to_world(local, s, t, n), np.array(local) @ frame, rtol=0.0, atol=1e-15)


@given(vectors.filter(lambda v: max(map(abs, v)) > 1e-3), vectors.filter(lambda v: max(map(abs, v)) > 1e-3))
def test_reflection_keeps_the_tangential_part_and_turns_the_normal_one(a, b):
    d, n = vec.normalize(a), vec.normalize(b)
    r = np.array(vec.reflect(d, n))
    assert r @ n == pytest.approx(-np.dot(d, n), abs=1e-15)
    np.testing.assert_allclose(np.cross(r, n), np.cross(d, n), rtol=0.0, atol=2e-15)
    np.testing.assert_allclose(vec.reflect(vec.reflect(d, n), n), d, rtol=0.0, atol=4e-15)
