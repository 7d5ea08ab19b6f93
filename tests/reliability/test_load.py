"""Processes that start together, and one after the other: short runs of `race` and `many`, and the fit of `hour`."""

import numpy as np
import pytest

from tests.reliability.hour import slope
from tests.reliability.many import many
from tests.reliability.race import damage, kill_compilers, race


@pytest.mark.slow
def test_processes_that_start_together_compile_once_whatever_was_left(tmp_path):
    assert kill_compilers(tmp_path, 2) == 2
    first = race(tmp_path, 6)
    assert first.is_won, first
    # A kernel, and the parts that it is made of.
    assert damage(tmp_path, 1) > 1
    second = race(tmp_path, 6)
    assert second.is_won, second
    assert second.pictures == first.pictures


@pytest.mark.slow
def test_renders_one_after_the_other_leave_nothing(tmp_path):
    found = many(tmp_path, 6)
    assert found.is_clean, found


def test_the_slope_is_that_after_what_does_not_count():
    # 3 MB a minute and noise, after five minutes of growth.
    seconds = np.arange(0.0, 3600.0, 2.0)
    noise = np.random.default_rng(1).normal(0.0, 2e6, len(seconds))
    resident = 4e8 + np.where(seconds < 300.0, 1e6 * seconds, 3e8 + 3e6 * (seconds - 300.0) / 60.0) + noise
    found, error = slope(seconds.tolist(), resident.astype(int).tolist(), 300.0)
    assert found == pytest.approx(3e6, abs=4.0 * error)
    assert error < 1e4
    with pytest.raises(ValueError, match="nothing to fit"):
        slope([1.0, 2.0], [1, 2], 300.0)
