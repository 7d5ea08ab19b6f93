"""Alias tables: each bin is drawn as often as its weight says."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from raytracer.core.sampling.alias import build_alias, sample_alias
from tests.statistics import chi2_test
from tests.vectorised import rows, vectorised

WEIGHTS = {
    "one": [3.0],
    "equal": [2.0] * 7,
    "zeros": [0.0, 1.0, 0.0, 0.0, 5.0, 0.0],
    "first": [1.0, 0.0],
    "steep": [10.0**-k for k in range(12)],
    "hot": [1e-12] * 63 + [1e6],
    "huge": [1e308, 1e308, 5e307],
}
each = pytest.mark.parametrize("weights", WEIGHTS.values(), ids=WEIGHTS)


def drawn_probability(table):
    """Compute the probability of each bin: of n equal parts, the part that it keeps and those that others pass on."""
    n = len(table.pmf)
    result = table.probability / n
    np.add.at(result, table.alias, (1.0 - table.probability) / n)
    return result


@each
def test_bins_are_drawn_by_weight(weights):
    table = build_alias(weights)
    expected = np.array(weights) / np.max(weights)
    expected /= expected.sum()
    assert table.pmf == pytest.approx(expected, rel=1e-15)
    assert drawn_probability(table) == pytest.approx(expected, abs=1e-15 * len(weights))
    assert table.probability.dtype == np.float64
    assert table.alias.dtype == np.int32
    assert all(array.flags.c_contiguous for array in table)


@given(st.lists(st.one_of(st.just(0.0), st.floats(1e-6, 1e6)), min_size=1, max_size=60).filter(any))
def test_any_weights_make_a_table(weights):
    table = build_alias(weights)
    drawn = drawn_probability(table)
    assert drawn == pytest.approx(np.array(weights) / np.sum(weights), abs=1e-14)
    assert (drawn[np.array(weights) == 0.0] == 0.0).all()


@each
def test_what_has_no_weight_is_never_drawn(weights):
    table = build_alias(weights)
    n = len(weights)
    ends = [k / n for k in range(n)] + [np.nextafter(k / n, 0.0) for k in range(1, n + 1)]
    index, pmf, rest = drawn_by(table, [*ends, *np.random.default_rng(2).random(2000)])
    assert (np.array(weights)[index] > 0.0).all()
    np.testing.assert_array_equal(pmf, table.pmf[index])
    assert ((rest >= 0.0) & (rest < 1.0)).all()


def drawn_by(table, u):
    return vectorised(sample_alias)(table, rows(u))


def test_what_is_left_of_the_number_is_uniform_for_each_bin():
    table = build_alias([0.5, 3.0, 1.0, 0.25, 1.25])
    index, _, rest = drawn_by(table, np.random.default_rng(4).random(100_000))
    pairs, bounds = np.stack([index + 0.5, rest], axis=1), [(0.0, 5.0), (0.0, 1.0)]
    chi2_test(pairs, lambda x: table.pmf[x[:, 0].astype(int)], bounds, [5, 20])


@pytest.mark.parametrize("weights", [[], [0.0, 0.0], [1.0, -1.0], [np.nan, 1.0], [np.inf, 1.0]])
def test_impossible_weights_are_refused(weights):
    with pytest.raises(ValueError, match="weights"):
        build_alias(weights)
