"""The running means of pixels over millions of samples: they do not drift."""

import math

import numpy as np
import pytest

from tests.hard_cases.accumulation import PACKET, ROUNDOFF, _summed

_COUNT = 2**23


def _exactly(values: np.ndarray) -> tuple[float, float]:
    """The mean, by an exact sum, and the sum of squared differences from it, to 64 bits of fraction."""
    mean = math.fsum(values) / len(values)
    differences = values.astype(np.longdouble) - np.longdouble(mean)
    return mean, float((differences * differences).sum())


def test_eight_million_equal_samples_have_the_mean_of_the_first_packet_to_the_bit() -> None:
    # Where a packet's mean is that of the picture so far, nothing is added, however long it goes on: 7 roundings of
    # sums and one of the division are all there are.
    first, last = (float(_summed(np.full(count, 0.1)).mean[0, 0, 0]) for count in (PACKET, _COUNT))
    assert last == first
    assert abs(last / 0.1 - 1.0) <= PACKET * ROUNDOFF


@pytest.mark.parametrize("kind", ["even", "rare"])
def test_the_mean_of_eight_million_samples_is_their_exact_mean(kind: str) -> None:
    """Roundings of updates are random, and later updates shrink them as they do samples.

    Of N packets, the one of number j leaves an error with a standard deviation of at most u / sqrt(3) of the mean, if
    that rounds to either side alike, of which j / N is left at the end: together sqrt(N / 3) u / sqrt(3).  The product
    that is added rounds too, by as little as its size; and the first packets by more, where samples are rare, which
    the rest makes little of.  Five deviations are 5 sqrt(N) u / 3: 1.9e-13 for 2^20 packets.
    """
    values = np.random.default_rng(7).random(_COUNT)
    if kind == "rare":
        values = np.where(values < 1e-3, 1000.0 * values, 0.0)
    film = _summed(values)
    mean, squares = _exactly(values)
    packets = _COUNT / PACKET
    assert abs(float(film.mean[0, 0, 0]) / mean - 1.0) <= 5.0 * math.sqrt(packets) * ROUNDOFF / 3.0
    # The sum of squares only grows, so that its last roundings, of u each, are the largest; of them too half a bit on
    # either side, but none is made less: sqrt(N / 3) of them at most, 5 deviations.
    assert abs(float(film.m2[0, 0, 0]) / squares - 1.0) <= 5.0 * math.sqrt(packets / 3.0) * ROUNDOFF
    assert int(film.count[0, 0]) == _COUNT
