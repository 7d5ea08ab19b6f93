"""Vectors against NumPy, and frames at the normals where formulas for them are known to fail."""

import math

import numpy as np
import pytest

from raytracer.core import vec
from raytracer.core.compiler.dispatch import kernel
from tests.vectorised import rows, vectorised

RNG = np.random.default_rng(1)
COUNT = 500

# Of all sizes up to 1e6, with zeros and equal components among them.
A, B = (
    RNG.normal(size=(COUNT, 3)) * 10.0 ** RNG.uniform(-3, 6, (COUNT, 1)) * (RNG.random((COUNT, 3)) < 0.8)
    for _ in range(2)
)
A[:3], B[:3] = [[0.0, -0.0, 0.0], [1.0, 1.0, 1.0], [-3.0, 0.0, 0.0]], [[0.0, 0.0, 2.0], [1.0, -1.0, 1.0], [3.0, 0, 0]]
S = RNG.normal(size=COUNT) * 10.0 ** RNG.uniform(-6, 6, COUNT)


def units(vectors):
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


N, M = (units(np.add(vectors, [0.0, 1e-3, 0.0])) for vectors in (A[3:], B[3:]))


@kernel
def _arithmetic(a, b, s):
    sums = vec.add(a, b), vec.sub(a, b), vec.mul(a, b), vec.scale(s, a), vec.neg(a)
    return sums, vec.madd(a, s, b), vec.cross(a, b), vec.dot(a, b), vec.norm(a), vec.max_component(a), vec.max_abs(a)


def test_arithmetic_is_that_of_numpy():
    exact, madd, cross, dot, norm, largest, magnitude = vectorised(_arithmetic)(rows(A), rows(B), rows(S))
    for result, expected in zip(exact, (A + B, A - B, A * B, S[:, None] * A, -A), strict=True):
        np.testing.assert_array_equal(result, expected)
    # Contraction to fused multiply-adds may drop a rounding.
    a, b = np.abs(A).max(axis=1), np.abs(B).max(axis=1)
    assert (np.abs(madd - (A + S[:, None] * B)) <= 1e-15 * (a + np.abs(S) * b)[:, None]).all()
    assert (np.abs(cross - np.cross(A, B)) <= 2e-15 * (a * b)[:, None]).all()
    assert (np.abs(dot - (A * B).sum(axis=1)) <= 3e-15 * a * b).all()
    np.testing.assert_allclose(norm, np.linalg.norm(A, axis=1), rtol=1e-15)
    np.testing.assert_array_equal(largest, A.max(axis=1))
    np.testing.assert_array_equal(magnitude, a)


def test_black_is_all_zeros():
    black = vectorised(vec.is_black)(rows([(0.0, -0.0, 0.0), (0.0, 1e-300, 0.0), (0.0, 0.0, math.nan)]))
    assert black.tolist() == [True, False, False]


@kernel
def _lengths(a, error):
    unit = vec.normalize(a)
    return unit, vec.renormalize(vec.scale(1.0 + error, unit))


def test_normalize_gives_unit_vectors_and_renormalize_squares_the_error_of_a_length():
    error = np.linspace(-1e-4, 1e-4, COUNT - 3)
    a = np.add(A[3:], [0.0, 0.01, 0.0])
    unit, mended = vectorised(_lengths)(rows(a), rows(error))
    np.testing.assert_allclose(np.linalg.norm(unit, axis=1), 1.0, rtol=0.0, atol=4e-16)
    np.testing.assert_allclose(np.cross(unit, units(a)), 0.0, atol=1e-15)
    assert (np.abs(np.linalg.norm(mended, axis=1) - 1.0) <= 1.6 * error**2 + 1e-15).all()
    assert np.isnan(vectorised(vec.normalize)(rows([(0.0, 0.0, 0.0)]))).all()


HARD_NORMALS = [
    # Where Frisvad's frame is wrong by 0.29 in float32 (Duff et al. 2017); hard case 36.
    (0.00038527316, 0.00038460016, -0.99999988079),
    *((0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (1e-17, 1e-17, -1.0), (1.0, 0.0, -0.0)),
    # The same at the pole of our frame, and where squares underflow.
    (0.00038527316, -0.99999988079, 0.00038460016),
    *((1e-17, -1.0, -1e-17), (1e-150, -1.0, 1e-151), (-1e-154, -1.0, 1e-154), (1e-160, -1.0, 0.0), (0.0, 1.0, 1e-160)),
]


@kernel
def _frame(normal, local):
    s, t = vec.basis(normal)
    return s, t, vec.to_world(local, s, t, normal)


def test_basis_is_a_right_handed_frame():
    n, local = np.concatenate([units(np.array(HARD_NORMALS)), N]), (0.2, -0.5, 0.7)
    s, t, world = vectorised(_frame)(rows(n), local)
    frames = np.stack([s, t, n], axis=1)
    # Three products of two numbers each, which are wrong by up to four roundings.
    products = frames @ frames.transpose(0, 2, 1)
    np.testing.assert_allclose(products, np.broadcast_to(np.eye(3), products.shape), rtol=0.0, atol=3e-15)
    np.testing.assert_allclose(np.cross(s, t), n, rtol=0.0, atol=3e-15)
    # Coordinates in the frame come out in the world, the third along the normal.
    np.testing.assert_allclose(world, np.array(local) @ frames, rtol=0.0, atol=1e-15)


@pytest.mark.parametrize("plane", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.6, 0.0, -0.8)])
def test_basis_is_continuous(plane):
    # Normals on both sides of a plane: a frame that is turned the shortest way from y changes by |dn| / cos(angle / 2).
    normals = np.random.default_rng(3).normal(size=(200, 3))
    within = normals - (normals @ plane)[:, None] * plane
    n, m = (units(within + side * 1e-7 * np.array(plane)) for side in (1.0, -1.0))
    # cos^2 (angle / 2) = (1 + y) / 2.
    bound = np.linalg.norm(n - m, axis=1) * np.sqrt(2.0 / (1.0 + np.minimum(n[:, 1], m[:, 1])))
    for one, other in zip(vectorised(vec.basis)(rows(n)), vectorised(vec.basis)(rows(m)), strict=True):
        assert (np.linalg.norm(one - other, axis=1) <= 1.001 * bound + 3e-15).all()


def test_reflection_keeps_the_tangential_part_and_turns_the_normal_one():
    reflected = vectorised(vec.reflect)(rows(N), rows(M))
    np.testing.assert_allclose((reflected * M).sum(axis=1), -(N * M).sum(axis=1), rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(np.cross(reflected, M), np.cross(N, M), rtol=0.0, atol=2e-15)
