"""Which tiles are measured: known chances, an even spread, and sums that are right on average."""

import numpy as np
import pytest

from raytracer.analysis.cost.tile_sample import TileSample, choose_subset, choose_tiles, inclusion_probabilities
from raytracer.film.window import Window
from raytracer.rendering.tile_scheduler import TILE_SIZE, split_into_tiles

WINDOWS = split_into_tiles(Window(0, 0, 330, 200))


@pytest.mark.parametrize("count", [1, 5, 40, len(WINDOWS) - 1, len(WINDOWS), 10**6])
def test_as_many_tiles_as_asked_for(count):
    size = np.random.default_rng(1).exponential(size=len(WINDOWS))
    for seed in range(20):
        chosen = choose_tiles(WINDOWS, count, np.random.default_rng(seed), size)
        assert len(chosen.windows) == len(set(chosen.windows)) == min(count, len(WINDOWS))
        assert np.all(chosen.weight >= 1.0)


def test_chances_are_in_proportion_to_size_and_at_most_one():
    size = np.array([100.0, 50.0, 1.0, 2.0, 3.0, 4.0])
    probability = inclusion_probabilities(size, 3)
    # Both large ones are sure, and the last place is shared by the rest.
    np.testing.assert_allclose(probability, [1.0, 1.0, 0.1, 0.2, 0.3, 0.4])


@pytest.mark.parametrize("of_part", [False, True])
def test_weighted_sums_are_those_of_all_tiles_on_average(of_part):
    rng = np.random.default_rng(7)
    size = rng.exponential(size=len(WINDOWS)) + 0.1
    value = dict(zip(WINDOWS, rng.exponential(size=len(WINDOWS)), strict=True))
    sums = []
    for seed in range(400):
        chosen = choose_tiles(WINDOWS, 60, np.random.default_rng(seed), size)
        if of_part:
            chosen, pixels = choose_subset(chosen, 20, np.random.default_rng(seed + 10**6))
            assert pixels.sum() == chosen.pixels.sum()
        sums.append(chosen.weight @ [value[window] for window in chosen.windows])
    assert np.mean(sums) == pytest.approx(sum(value.values()), abs=4.0 * np.std(sums) / np.sqrt(len(sums)))


def test_tiles_are_spread_over_the_picture():
    square = split_into_tiles(Window(0, 0, 16 * TILE_SIZE, 16 * TILE_SIZE))
    chosen = choose_tiles(square, 64, np.random.default_rng(5))
    # Every block of 4 x 4 tiles holds four of them.
    blocks = np.zeros((4, 4), dtype=int)
    for window in chosen.windows:
        blocks[window.top // (4 * TILE_SIZE), window.left // (4 * TILE_SIZE)] += 1
    np.testing.assert_array_equal(blocks, 4)


def test_pixels_go_into_the_picture_where_they_came_from():
    film = np.arange(200 * 330 * 3, dtype=np.float64).reshape(200, 330, 3)
    chosen = choose_tiles(WINDOWS, 40, np.random.default_rng(6))
    patch = np.full((40, TILE_SIZE, TILE_SIZE, 3), np.nan)
    for number, (left, top, right, bottom) in enumerate(chosen.windows):
        patch[number, : bottom - top, : right - left] = film[top:bottom, left:right]
    picture = np.full_like(film, np.nan)
    chosen.spread(chosen.flat(patch), picture)
    known = np.isfinite(picture)
    assert known.sum() == 3 * chosen.pixels.sum()
    np.testing.assert_array_equal(picture[known], film[known])
    assert np.array_equal(np.bincount(chosen.owner), chosen.pixels)
    # 330 = 20 * 16 + 10, 200 = 12 * 16 + 8.
    assert TileSample.of(WINDOWS, np.ones(len(WINDOWS))).pixels[-1] == 10 * 8
