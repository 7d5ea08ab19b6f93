"""How much is measured, and in which order."""

from pathlib import Path

import numpy as np
import pytest

from raytracer.cost.compare import Floor, _differs
from raytracer.cost.measure import (
    Subject,
    extent_of_replicates,
    extent_of_round,
    levels_of,
    rotation,
    seeds,
    warm_up,
)
from raytracer.noise import Interval
from raytracer.scheduling import Window, tiles
from tests.cost.made_up import World, scene_of

LARGE = tiles(Window(0, 0, 1200, 675))
SMALL = tiles(Window(0, 0, 64, 48))


@pytest.mark.parametrize("pace", [1e3, 1e4, 1e5, 1e6, 1e7])
@pytest.mark.parametrize("windows", [LARGE, SMALL])
def test_replicates_take_about_the_time_they_may(windows: list[Window], pace: float) -> None:
    size = extent_of_replicates(windows, 60.0, pace, None)
    assert size.spp & (size.spp - 1) == 0
    seconds = 4 * size.spp * size.tiles * 256 / pace
    assert seconds < 80.0
    # More time than that goes unused only where the picture is done with.
    assert seconds > 30.0 or size.tiles == len(windows)


def test_a_number_of_tiles_that_is_given_is_kept() -> None:
    assert extent_of_replicates(LARGE, 60.0, 1e6, 7).tiles == 7
    assert extent_of_replicates(SMALL, 60.0, 1e6, 10**6).tiles == len(SMALL)
    assert extent_of_round(LARGE, 1.0, 1e9, 500).tiles == 500
    assert extent_of_round(LARGE, 1.0, 1e9, None).tiles < 500


def test_levels_are_powers_of_two_or_of_four() -> None:
    assert levels_of(256, is_progressive=True) == (16, 32, 64, 128, 256)
    assert levels_of(256, is_progressive=False) == (16, 64, 256)
    assert levels_of(16, is_progressive=True) == (8, 16)


def test_every_arm_is_at_every_place_once() -> None:
    square = np.array([rotation(7, turn) for turn in range(7)])
    for line in (*square, *square.T):
        assert sorted(line) == list(range(7))


def test_seeds_differ_by_purpose_and_go_on() -> None:
    assert seeds(1, 2, 5)[:3] == seeds(1, 2, 3)
    assert not set(seeds(1, 2, 5)) & (set(seeds(1, 3, 5)) | set(seeds(2, 2, 5)))


def test_the_pace_is_that_of_the_whole_picture(tmp_path: Path) -> None:
    world = World(per_sample=1e-5)
    spec = scene_of(tmp_path, 640, 400)
    windows = tiles(Window(0, 0, 640, 400))
    subject = Subject(world.prepare(spec, None), world.bench(), 4)  # type: ignore[arg-type]
    assert warm_up(subject, windows, 0) == pytest.approx(4e5 / world.unevenness(windows).mean(), rel=0.1)
    # The first look takes no longer than a look.
    assert sum(count * spp for count, spp, _ in world.calls) * 256 / 4e5 < 3.0


@pytest.mark.parametrize(
    ("ratio", "floor", "differs"),
    [
        (Interval(1.10, 1.05, 1.15), 0.03, True),
        (Interval(0.90, 0.85, 0.95), 0.03, True),
        (Interval(1.10, 0.99, 1.15), 0.03, False),
        (Interval(1.10, 1.05, 1.15), 0.12, False),
        (Interval(0.90, 0.85, 0.95), 0.12, False),
        (Interval(0.0, 0.0, 0.0), 0.12, True),
        (Interval(float("nan"), float("nan"), float("nan")), 0.0, False),
    ],
)
def test_a_difference_is_more_than_equal_arms_show(ratio: Interval, floor: float, *, differs: bool) -> None:
    assert _differs(ratio, Floor(floor, floor).time) is differs
