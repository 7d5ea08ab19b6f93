"""Renders that are killed and resumed end in the bits of one that nobody has killed; no file is broken at any time."""

import pytest

from tests.reliability.kill import CHECKPOINT, OUTPUTS, kill


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
