"""No ray meets again what it leaves: ten million of them, over all shapes, motions, sizes and ways of leaving."""

import numpy as np
import pytest

from tests.plugins.shapes.leaving import CONVEX, WAYS, leave, objects_met, self_hits, stages


@pytest.mark.slow
def test_ten_million_rays_leave_what_they_met(tmp_path):
    # Sizes 1e-6 to 1e6 m; resting, flying, spinning and rolling; baked, placed, stretched and mirrored.
    rays, failures = 0, 0
    seen = set()
    for number, place in enumerate(stages(tmp_path)):
        left, ways, times = leave(place, 600_000, number)
        rays += int((left.table[:, 0] >= 0).sum())
        met = objects_met(place, left)[:, 0]
        pairs = np.unique(len(WAYS) * met[met >= 0] + ways[met >= 0])
        seen.update((place.names[pair // len(WAYS)], WAYS[pair % len(WAYS)]) for pair in pairs)
        failures += int(self_hits(place, left, times).sum())
    assert rays > 10_000_000
    assert len(seen) == len(WAYS) * len(place.names)
    assert {name for name in CONVEX if f"resting {name}" in place.names} == set(CONVEX)
    assert failures == 0


@pytest.mark.slow
def test_they_would_meet_it_without_an_offset(tmp_path):
    # The same rays from the hit itself: about half of those from what is flat find it again.
    place = next(stages(tmp_path))
    left, _, times = leave(place, 20_000, 1, bare=True)
    share = self_hits(place, left, times).sum() / (left.table[:, 0] >= 0).sum()
    assert share > 0.1
