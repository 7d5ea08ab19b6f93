"""Which paths Russian roulette may end, and with what probability."""

from typing import Any, NamedTuple

from raytracer.kernel.russian_roulette import russian_roulette
from tests.vectorised import random_draws, vectorised


class Rule(NamedTuple):
    """As much of a scene as is asked for: the segments after which paths may end."""

    roulette: Any


def survivals(throughput, done):
    return vectorised(russian_roulette)(Rule(3), throughput, 0.25, done, random_draws(2000, seed=3))


def test_paths_end_from_the_segment_on_that_is_given():
    assert (survivals((0.1, 0.1, 0.1), 2) == 1.0).all()
    assert (survivals((0.1, 0.1, 0.1), 3) == 0.0).any()


def test_the_brightest_channel_decides():
    # A path of pure green goes on as one of white does.
    found = survivals((0.0, 0.1, 0.05), 5)
    assert set(found) == {0.0, 0.4}
    # Binomial: 0.4 with a standard deviation of 0.011.
    assert abs((found > 0.0).mean() - 0.4) < 0.045
    assert (survivals((0.0, 0.25, 0.0), 5) == 1.0).all()
