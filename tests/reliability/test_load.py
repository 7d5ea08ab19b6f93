"""Renders that are killed, disks that fill, and processes that start together or one after the other: short runs of
`kill`, `full_disk`, `race` and `many`, and the fit of `hour`."""

import numpy as np
import pytest

from tests.reliability.full_disk import trials
from tests.reliability.hour import slope
from tests.reliability.kill import CHECKPOINT, OUTPUTS, kill
from tests.reliability.many import many
from tests.reliability.race import damage, kill_compilers, race


@pytest.mark.parametrize(
    ("renders", "jobs", "seed", "kinds", "killed", "resumed", "writing"),
    [
        # Killed before the first checkpoint, then while a file is written, then once more.
        pytest.param(1, 1, 1760, ("plain",), 2, 1, 1, id="1"),
        pytest.param(200, 3, 1, ("plain", "noise", "layers"), 200, 50, 20, id="200", marks=pytest.mark.slow),
    ],
)
def test_killed_and_resumed_a_picture_is_the_same(tmp_path, renders, jobs, seed, kinds, killed, resumed, writing):
    counts, failures = kill(renders, jobs, seed, tmp_path, kinds=kinds)
    assert failures == []
    assert counts["renders"] == counts["equal"] == renders
    assert all(counts[f"opened {name}"] > 0 for name in (CHECKPOINT, *OUTPUTS))
    assert counts["killed"] >= killed
    assert counts["resumed"] >= resumed
    assert counts["killed while a file was written"] >= writing


@pytest.mark.slow
def test_50_disks_that_fill_leave_what_there_was(tmp_path):
    try:
        counts, failures = trials(50, 2, 1, tmp_path)
    except PermissionError as error:
        pytest.skip(f"a small disk cannot be mounted here: {error}")
    assert failures == []
    assert counts["moments"] == counts["resumed"] == 50
    assert counts["exit status 0"] + counts["exit status 1"] == 50
    assert counts["exit status 1"] >= 20


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
