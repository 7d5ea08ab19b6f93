"""Lanes: eight numbers at once are what NumPy makes of eight numbers, compiled or not."""

import numpy as np
import pytest

from raytracer.core.compiler.dispatch import entry, kernel
from raytracer.core.simd import WIDTH, gather_lanes, load, select, sqrt_lanes, store


@kernel
def _formulas(rows, table):
    a, b = load(rows, 0), load(rows, 1)
    store(rows, 2, a + b)
    store(rows, 3, 2.0 - a * 3.0)
    store(rows, 4, a / b)
    store(rows, 5, 1.0 / b)
    store(rows, 6, sqrt_lanes(a))
    store(rows, 7, -b)
    store(rows, 8, select((a > b) & (b >= 0.25), a, b))
    store(rows, 9, select(a < 0.5, 1.0, b))
    store(rows, 10, select(0.5 + 0.0 * b <= a, a, 7.0))
    store(rows, 11, gather_lanes(table, load(rows, 12), 1))
    store(rows, 13, 4.0)


@entry
def _compiled(rows, table):
    _formulas(rows, table)


@pytest.mark.parametrize("compiled", [True, False])
def test_lanes_are_numpys_arrays_of_eight(compiled):
    rng = np.random.default_rng(5)
    rows, table = rng.random((14, WIDTH)), rng.random((WIDTH, 3))
    rows[12] = rng.permutation(WIDTH)
    a, b, chosen = rows[0].copy(), rows[1].copy(), rows[12].astype(np.int64)
    (_compiled if compiled else _formulas.__wrapped__)(rows, table)
    expected = [
        a + b,
        2.0 - a * 3.0,
        a / b,
        1.0 / b,
        np.sqrt(a),
        -b,
        np.where((a > b) & (b >= 0.25), a, b),
        np.where(a < 0.5, 1.0, b),
        np.where(a >= 0.5, a, 7.0),
        table[chosen, 1],
    ]
    exact = np.arange(10) != 1
    np.testing.assert_array_equal(rows[2:12][exact], np.array(expected)[exact])
    # A product and a sum may be one instruction, which rounds once.
    np.testing.assert_allclose(rows[3], expected[1], rtol=0.0, atol=3.0 * np.finfo(float).eps)
    np.testing.assert_array_equal(rows[13], 4.0)


@pytest.mark.parametrize("compiled", [True, False])
def test_what_is_no_number_is_in_its_lane_alone(compiled):
    rows, table = np.full((14, WIDTH), 4.0), np.zeros((8, 2))
    rows[12] = 0.0
    rows[0, 3], rows[1, 5] = -1.0, 0.0
    with np.errstate(divide="ignore"):
        (_compiled if compiled else _formulas.__wrapped__)(rows, table)
    assert np.isnan(rows[6]).tolist() == [lane == 3 for lane in range(WIDTH)]
    assert np.isinf(rows[4]).tolist() == [lane == 5 for lane in range(WIDTH)]
