"""Fireflies: found where a single sample outshines a pixel that stands alone, and nowhere else."""

import numpy as np
import pytest

from raytracer.core.error_estimate.fireflies import MIN_SAMPLES, find_fireflies

SIZE = (24, 32)


def picture(samples):
    """mean, m2 and count of samples (n, height, width)."""
    grey = np.repeat(samples[..., None], 3, axis=-1)
    mean = grey.mean(axis=0)
    return mean, ((grey - mean) ** 2).sum(axis=0), np.full(SIZE, len(samples))


def noise(n=64):
    """Samples of an even picture of 0.5, with a deviation of half of that: (n, height, width)."""
    return np.random.default_rng(1).exponential(0.5, (n, *SIZE))


def test_noise_is_no_firefly():
    # Of 64 exponential samples, n / (1 + v) = 32 are effective.
    assert find_fireflies(*picture(noise())) is None
    assert find_fireflies(*picture(np.zeros((64, *SIZE)))) is None


def test_samples_are_found_and_accounted_for():
    samples = noise()
    samples[7, 5, 9] = 6400.0
    fireflies = find_fireflies(*picture(samples))
    assert np.argwhere(fireflies.where).tolist() == [[5, 9]]
    assert fireflies.brightest == (5, 9)
    # It adds 6400 / 64 = 100 to what else is 0.5 * 24 * 32 = 384 of light.
    assert fireflies.light == pytest.approx(100.0 / 484.0, rel=0.01)
    # A sample at the limit adds a quarter of what is around, 0.5: limit / 64 = 0.125.
    assert fireflies.limit == pytest.approx(8.0, rel=0.2)
    for place in ((0, 0), (23, 31)):
        samples[3, *place] = 6400.0
    fireflies = find_fireflies(*picture(samples))
    assert np.argwhere(fireflies.where).tolist() == [[0, 0], [5, 9], [23, 31]]


def test_what_is_around_may_be_black():
    samples = np.zeros((64, *SIZE))
    samples[0, 10, 10] = 5.0
    fireflies = find_fireflies(*picture(samples))
    assert fireflies.pixels == 1
    assert fireflies.light == 1.0
    # There is nothing to tell a limit by.
    assert fireflies.limit is None


def test_an_edge_of_a_lamp_is_none():
    # Pixels of the column 8 see 1/64 of a lamp that fills the picture from there on.
    samples = noise()
    samples[:, :, 9:] = 1000.0
    samples[11, :, 8] = 1000.0
    mean, m2, count = picture(samples)
    n = count[..., None]
    effective = n * mean**2 / (m2 / n + mean**2)
    # So they are noisy by all that one sample tells.
    assert effective[:, 8].max() < 2.0
    assert find_fireflies(mean, m2, count) is None


def test_rare_light_everywhere_is_noise_and_no_firefly():
    # One pixel in six has met a rare bright sample: sqrt(5) deviations; of 24 around, none has it in 1 case of 80.
    random = np.random.default_rng(4)
    samples = noise()
    rare = random.random(SIZE) < 1.0 / 6.0
    samples[0] += np.where(rare, 3000.0, 0.0)
    fireflies = find_fireflies(*picture(samples))
    assert fireflies is None or fireflies.pixels <= 0.05 * rare.sum()
    # One in three hundred: 17 deviations.
    samples = noise()
    rare = random.random(SIZE) < 1.0 / 300.0
    samples[0] += np.where(rare, 3000.0, 0.0)
    fireflies = find_fireflies(*picture(samples))
    np.testing.assert_array_equal(fireflies.where, rare)


def test_few_samples_tell_nothing():
    samples = noise(MIN_SAMPLES - 1)
    samples[0, 5, 5] = 3200.0
    assert find_fireflies(*picture(samples)) is None
    samples = noise(MIN_SAMPLES)
    samples[0, 5, 5] = 3200.0
    assert find_fireflies(*picture(samples)) is not None


def test_what_is_not_seen_is_left_alone():
    # A dark corner of a bright picture: the pixel exceeds it tenfold, and is a tenth of the picture's mean.
    samples = noise()
    samples[:, :8, :8] *= 1e-3
    samples[0, 3, 3] = 64 * 0.03
    assert find_fireflies(*picture(samples)) is None


def test_one_channel_is_enough():
    mean, m2, count = picture(noise())
    mean[5, 5, 1] += 100.0
    m2[5, 5, 1] += 100.0**2 * 64 * 63
    fireflies = find_fireflies(mean, m2, count)
    assert np.argwhere(fireflies.where).tolist() == [[5, 5]]


def test_values_beyond_all_bounds_raise_nothing():
    mean, m2, count = picture(noise())
    mean[5, 5], m2[5, 5] = 1e200, np.inf
    count[7, 7] = 0
    mean[7, 7], m2[7, 7] = 0.0, 0.0
    find_fireflies(mean, m2, count)
