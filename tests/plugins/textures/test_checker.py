"""The checker against its formula."""

import numpy as np
import pytest

from tests.plugins.textures.kernels import looked_up, slopes, spec_of, table_of

EVEN, ODD = (0.1, 0.2, 0.3), (0.7, 0.8, 0.9)


def test_solid_cells_go_by_the_parity_of_the_sum_of_floors():
    # The Next Week, sec. 4.3, with points on both sides of the origin.
    points = np.random.default_rng(1).uniform(-10.0, 10.0, (500, 3))
    table = table_of(spec_of("checker", scale=0.7, even=EVEN, odd=ODD))
    even = np.floor(points / 0.7).sum(axis=1) % 2 == 0
    assert 0 < even.sum() < 500
    np.testing.assert_array_equal(looked_up(table, points=points), np.where(even[:, None], EVEN, ODD))


def test_uv_cells_go_by_the_parameters_and_not_by_the_place():
    table = table_of(spec_of("checker", scale=0.25, even=EVEN, odd=ODD, space="uv"))
    result = looked_up(table, points=[(9.0, 1.0, 3.0)] * 4, uv=[(0.1, 0.1), (0.3, 0.1), (0.3, 0.3), (-0.1, 0.9)])
    np.testing.assert_array_equal(result, [EVEN, ODD, EVEN, EVEN])


def test_points_far_away_keep_their_cells():
    # Sums of floors beyond 2^31.
    table = table_of(spec_of("checker", scale=1.0, even=EVEN, odd=ODD))
    result = looked_up(
        table, points=[(2.0**40 + 0.5, 0.5, 0.5), (2.0**40 + 1.5, 0.5, 0.5), (-(2.0**40) - 0.5, 0.5, 0.5)]
    )
    np.testing.assert_array_equal(result, [EVEN, ODD, ODD])


def test_its_mean_is_that_of_its_cells_and_its_range_that_of_its_colours():
    spec = spec_of("checker", even=EVEN, odd=ODD)
    assert spec.mean({}) == pytest.approx((0.4, 0.5, 0.6))
    assert spec.range({}) == (0.1, 0.9)


def test_cells_are_level():
    assert not slopes(table_of(spec_of("checker")), points=[(0.3, 0.2, 0.1)]).any()
