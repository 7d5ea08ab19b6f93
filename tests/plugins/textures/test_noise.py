"""Perlin noise: what makes it gradient noise, and the patterns made of it."""

import numpy as np
import pytest

from raytracer.plugins.textures.noise import fractal_noise, perlin
from tests.plugins.textures.kernels import looked_up, slopes, spec_of, table_of
from tests.vectorised import rows, vectorised


def noise(points, seed=0, octaves=0):
    at = rows(np.asarray(points, np.float64))
    return vectorised(fractal_noise)(at, seed, octaves) if octaves else vectorised(perlin)(at, seed)


def random_points(count, seed=3, size=100.0):
    return np.random.default_rng(seed).uniform(-size, size, (count, 3))


def test_it_is_zero_at_lattice_points():
    lattice = np.stack(np.meshgrid(*[np.arange(-4.0, 5.0)] * 3), axis=-1).reshape(-1, 3)
    for seed in (0, 1, 2**32 - 1):
        assert not noise(lattice, seed).any()


def test_its_mean_is_zero_and_it_keeps_to_its_range():
    values = noise(random_points(400_000))
    # Values within a cell are correlated, those of different cells are not: nearly all of these points are alone.
    assert abs(values.mean()) < 4.0 * values.std() / np.sqrt(len(values))
    assert np.abs(values).max() <= 1.0
    # Variance of Perlin's noise of 2002, by other implementations: about 0.25^2.
    assert 0.22 < values.std() < 0.31


def test_each_direction_is_like_the_others():
    points = random_points(200_000)
    step = 1e-3
    rates = [np.mean(((noise(points + step * axis) - noise(points)) / step) ** 2) for axis in np.eye(3)]
    assert np.std(rates) < 0.02 * np.mean(rates)


def test_it_is_twice_continuously_differentiable_across_cells():
    # One-sided second differences at a wall between cells differ by O(h), those of a kink in the slope by O(1 / h), and
    # those of the cubic fade of 1985 by a constant.
    rng = np.random.default_rng(5)
    walls = np.concatenate([np.full((200, 1), 3.0), rng.uniform(-5.0, 5.0, (200, 2))], axis=1)
    jumps = []
    for h in (1e-2, 1e-3):
        at = [noise(walls + np.array((k * h, 0.0, 0.0))) for k in range(-3, 4)]
        ahead = (2 * at[3] - 5 * at[4] + 4 * at[5] - at[6]) / h**2
        behind = (2 * at[3] - 5 * at[2] + 4 * at[1] - at[0]) / h**2
        jumps.append(np.abs(ahead - behind).max())
    assert jumps[1] < 0.2 * jumps[0]
    assert jumps[1] < 0.1


def test_its_slope_at_a_lattice_point_is_the_gradient_there():
    # Gradients go to the edges of a cube: two components of size 1 and one of 0.
    lattice = np.random.default_rng(6).integers(-50, 50, (300, 3)).astype(np.float64)
    h = 1e-6
    gradient = np.stack(
        [(noise(lattice + h * axis) - noise(lattice - h * axis)) / (2 * h) for axis in np.eye(3)], axis=1
    )
    np.testing.assert_allclose(np.sort(np.abs(gradient), axis=1), [[0.0, 1.0, 1.0]] * 300, atol=1e-8)
    assert len(np.unique(np.round(gradient), axis=0)) == 12


def test_another_seed_is_another_noise():
    points = random_points(20_000)
    first, second = noise(points, 0), noise(points, 1)
    assert abs(np.corrcoef(first, second)[0, 1]) < 0.03


def test_octaves_halve_in_size_and_double_in_frequency():
    points = random_points(1000, size=5.0)
    expected = noise(points, 7) + 0.5 * noise(2 * points, 8) + 0.25 * noise(4 * points, 9)
    np.testing.assert_allclose(noise(points, 7, octaves=3), expected, atol=1e-15)


def colors(points, **parameters):
    return looked_up(table_of(spec_of("noise", **parameters)), points=points)[:, 0]


def test_patterns_follow_their_formulas():
    points = random_points(2000, size=3.0)
    turbulence = np.abs(noise(points, 0, octaves=7))
    np.testing.assert_allclose(colors(points, scale=2.5), 0.5 + 0.5 * noise(2.5 * points), atol=1e-15)
    scaled = np.abs(noise(2.5 * points, 0, octaves=7))
    np.testing.assert_allclose(colors(points, pattern="turbulence", scale=2.5), np.minimum(1.0, scaled), atol=1e-15)
    # The Next Week, sec. 5.7: 0.5 (1 + sin(scale z + 10 turb(p))), turbulence with cells of its own.
    book = 0.5 * (1.0 + np.sin(4.0 * points[:, 2] + 10.0 * turbulence))
    np.testing.assert_allclose(colors(points, pattern="marble", scale=4.0), book, atol=1e-14)


def test_the_pattern_blends_the_two_colours():
    points = random_points(100)
    low, high = np.array((0.1, 0.2, 0.3)), np.array((0.9, 0.5, 0.4))
    spec = spec_of("noise", low=low.tolist(), high=high.tolist(), octaves=4)
    t = colors(points, octaves=4)[:, None]
    np.testing.assert_allclose(looked_up(table_of(spec), points=points), low + t * (high - low), atol=1e-15)
    assert spec.range({}) == (0.1, 0.9)


@pytest.mark.parametrize("pattern", ["perlin", "marble"])
def test_slopes_are_derivatives_along_the_tangents(pattern):
    points = random_points(500, size=4.0)
    table = table_of(spec_of("noise", pattern=pattern, scale=3.0, octaves=2))
    tangent, bitangent = (0.3, -2.0, 0.4), (0.0, 0.5, 5.0)
    result = slopes(table, points=points, tangent=tangent, bitangent=bitangent)
    h = 1e-5
    for column, along in enumerate((tangent, bitangent)):
        step = h * np.array(along)
        ahead, behind = (looked_up(table, points=points + sign * step)[:, 0] for sign in (1, -1))
        error = np.abs(result[:, column] - (ahead - behind) / (2 * h)) / np.abs(result).max()
        # But for a point where the folds of turbulence lie between the two.
        assert np.quantile(error, 0.99) < 1e-6
