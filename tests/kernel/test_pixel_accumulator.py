"""The running means of pixels: they do not drift, do not cancel, and leave out what is not a number."""

import math

import numpy as np
import pytest

from raytracer.core.compiler.dispatch import entry
from raytracer.core.embree import PACKET
from raytracer.kernel.path_state import workspace
from raytracer.kernel.pixel_accumulator import FilmView, accumulate

_COUNT = 2**20

# The unit roundoff of float64: a rounded result is off by at most this part of itself.
ROUNDOFF = 2.0**-53


@entry
def _accumulate(film, work, values, size):
    for first in range(0, len(values), size):
        count = min(size, len(values) - first)
        for lane in range(count):
            for channel in range(3):
                work.radiance[lane, channel] = values[first + lane, channel]
            work.weight[lane] = 1.0
        accumulate(None, None, film, work, 0, 0, 0, count)


def summed(values, size=PACKET):
    """The film of one pixel that has got these samples (n, 3), so many at a time."""
    colors, counts = np.zeros((2, 1, 1, 3)), np.zeros((2, 1, 1), np.int64)
    film = FilmView(*colors, *counts, 0, 0, None)
    _accumulate(film, workspace(), np.ascontiguousarray(values), size)
    return film


def grey(values):
    return np.repeat(values[:, None], 3, axis=1)


def test_a_million_equal_samples_have_the_mean_of_the_first_packet_to_the_bit():
    # Where a packet's mean is that of the picture so far, nothing is added, however long it goes on: 7 roundings of
    # sums and one of the division are all there are.
    first, last = (float(summed(np.full((count, 3), 0.1)).mean[0, 0, 0]) for count in (PACKET, _COUNT))
    assert last == first
    assert abs(last / 0.1 - 1.0) <= PACKET * ROUNDOFF


@pytest.mark.parametrize("kind", ["even", "rare"])
def test_the_mean_of_a_million_samples_is_their_exact_mean(kind):
    """Roundings of updates are random, and later updates shrink them as they do samples.

    Of N packets, the one of number j leaves an error with a standard deviation of at most u / sqrt(3) of the mean, if
    that rounds to either side alike, of which j / N is left at the end: together sqrt(N / 3) u / sqrt(3).  The product
    that is added rounds too, by as little as its size; and the first packets by more, where samples are rare, which
    the rest makes little of.  Five deviations are 5 sqrt(N) u / 3: 6.7e-14 for 2^17 packets.
    """
    values = np.random.default_rng(7).random(_COUNT)
    if kind == "rare":
        values = np.where(values < 1e-3, 1000.0 * values, 0.0)
    film = summed(grey(values))
    # By an exact sum, and to 64 bits of fraction.
    mean = math.fsum(values) / _COUNT
    squares = float(((values.astype(np.longdouble) - np.longdouble(mean)) ** 2).sum())
    packets = _COUNT / PACKET
    assert abs(float(film.mean[0, 0, 0]) / mean - 1.0) <= 5.0 * math.sqrt(packets) * ROUNDOFF / 3.0
    # The sum of squares only grows, so that its last roundings, of u each, are the largest; of them too half a bit on
    # either side, but none is made less: sqrt(N / 3) of them at most, 5 deviations.
    assert abs(float(film.m2[0, 0, 0]) / squares - 1.0) <= 5.0 * math.sqrt(packets / 3.0) * ROUNDOFF
    assert int(film.count[0, 0]) == _COUNT


@pytest.mark.parametrize("size", [1, 3, 8])
def test_running_mean_and_variance_do_not_cancel(size):
    # Hard case 42: for 100 + 0.01 U, E[x^2] - E[x]^2 in float32 says -134 where the variance is 8.3e-6.
    values = 100.0 + 0.01 * np.random.default_rng(1).random((1001, 3))
    film = summed(values, size)
    assert film.count[0, 0] == 1001
    np.testing.assert_allclose(film.mean[0, 0], values.mean(axis=0), rtol=1e-14)
    np.testing.assert_allclose(film.m2[0, 0], ((values - values.mean(axis=0)) ** 2).sum(axis=0), rtol=1e-9)


def test_samples_that_are_not_numbers_are_dropped_and_counted():
    # Hard case 46: one NaN would blacken its pixel for good.
    values = np.ones((20, 3))
    values[3, 1], values[9, 0], values[16:18] = np.nan, np.inf, -np.inf
    film = summed(values)
    assert (film.count[0, 0], film.bad[0, 0]) == (16, 4)
    np.testing.assert_array_equal(film.mean[0, 0], 1.0)
    np.testing.assert_array_equal(film.m2[0, 0], 0.0)
    assert summed(np.full((8, 3), np.nan)).bad[0, 0] == 8
