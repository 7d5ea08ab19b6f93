"""What a reader should know before believing a study: one sentence each."""

import math
from collections.abc import Iterator
from typing import NamedTuple

from raytracer.cost.results import Prediction

# A share of the error in the worst 0.1 % of the pixels that makes means doubtful.
_LARGE_SHARE = 0.2

FEWEST_ROUNDS = 9
"""Rounds without which the interval of a median is none of 95 %."""

FEWEST_TILES = 16
"""Tiles that are asked for, if the picture has as many: one may be of nothing but sky."""

# How many times as many samples as were measured a prediction may reach for.
_FAR = 100.0

_MOST_SAMPLES = 2**31 - 1

# Load for each processor that is no quiet machine any more: with half of them at work, others share caches and clock.
_BUSY = 0.5


class Circumstances(NamedTuple):
    """What doubts come from.

    scale : the picture's mean.
    bad : samples that were not finite.
    rounds, rounds_asked : of the comparison; 0 if there was none.
    load : processes that wanted a processor before; None if not known.
    """

    prediction: Prediction
    tiles: int
    tiles_measured: int
    scale: float
    top_share: float
    bad: int
    rounds: int
    rounds_asked: int
    interrupted: bool
    load: float | None
    threads: int
    processors: int


def doubts(found: Circumstances) -> tuple[str, ...]:
    """The sentences, the most important first."""
    return (*_of_the_picture(found), *_of_the_question(found), *_of_the_measurement(found))


def _of_the_picture(found: Circumstances) -> Iterator[str]:
    if found.bad:
        yield f"{found.bad} samples were not finite and were dropped: times and errors leave them out"
    if found.scale == 0.0:
        yield "what was rendered is black: no error is relative to it, so nothing can be told of what accuracy costs"
    elif found.prediction.points[-1].error.value == 0.0:
        yield "what was rendered has no noise: one sample per pixel is enough"
    if found.top_share > _LARGE_SHARE:
        yield (
            f"the worst 0.1 % of the pixels carry {100.0 * found.top_share:.0f} % of the squared error: rare bright "
            "samples decide, so errors are less certain than their intervals say"
        )


def _of_the_question(found: Circumstances) -> Iterator[str]:
    prediction = found.prediction
    if prediction.budget is not None and not prediction.budget_spp:
        yield (
            f"the budget of {prediction.budget:.3g} s does not reach for one sample per pixel after the "
            f"{prediction.fixed.value:.3g} s that do not depend on samples"
        )
    most = prediction.points[-1].spp
    for what, spp in (
        ("target takes", prediction.target_spp.value),
        ("budget has time for", 0.0 if prediction.budget_spp is None else prediction.budget_spp),
    ):
        if spp > _MOST_SAMPLES:
            yield f"the {what} more samples per pixel than a render can have, {_MOST_SAMPLES}"
        elif spp > _FAR * most:
            yield (
                f"the {what} {spp / most:.0f} times as many samples as were measured, {most}: "
                "how error falls so far beyond is not known"
            )


def _of_the_measurement(found: Circumstances) -> Iterator[str]:
    if found.interrupted:
        what = f"after {found.rounds} of {found.rounds_asked} rounds" if found.rounds else "before the comparison"
        yield f"interrupted {what}"
    if 0 < found.rounds < FEWEST_ROUNDS:
        yield f"{found.rounds} rounds are few: intervals of medians take {FEWEST_ROUNDS}"
    if found.tiles_measured == 1:
        yield "one tile was measured, so intervals are not known"
    elif found.tiles_measured < min(FEWEST_TILES, found.tiles):
        yield f"only {found.tiles_measured} of {found.tiles} tiles were measured: intervals are rough"
    if found.load is not None and math.isfinite(found.load) and found.load > _BUSY * found.processors:
        yield (
            f"the machine was busy before, with a load of {found.load:.1f} on {found.processors} processors: "
            "times may be longer than on a quiet one"
        )
    if found.threads > found.processors:
        yield f"{found.threads} threads share {found.processors} processors"
