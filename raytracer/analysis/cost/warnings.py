"""Warnings about a study that a reader should know before believing it, one sentence each."""

import math
from collections.abc import Iterator
from typing import NamedTuple

from raytracer.analysis.cost.results import Prediction

# Share of the error in the worst 0.1 % of the pixels from which on means are doubtful.
_LARGE_SHARE = 0.2

MIN_ROUNDS = 9
"""Least rounds for an interval of a median of 95 %."""

MIN_TILES = 16
"""Least tiles that may be asked for, if the picture has as many: one may be of nothing but sky."""

# Ratio of predicted to measured samples from which on a prediction is doubtful.
_MAX_EXTRAPOLATION = 100.0

_MOST_SAMPLES = 2**31 - 1

# Load for each processor from which on a machine is busy: with half of them at work, others share caches and clock.
_BUSY = 0.5


class StudyConditions(NamedTuple):
    """Conditions of a study that warnings depend on.

    tiles, tiles_measured : tiles of the picture, and those that were rendered.
    scale : mean of the picture.
    top_share : part of the squared error in the worst 0.1 % of the pixels.
    bad : samples that were not finite.
    rounds, rounds_asked : of the comparison; 0 if there was none.
    load : load average before; None if not known.
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


def study_warnings(conditions: StudyConditions) -> tuple[str, ...]:
    """List the warnings, the most important first."""
    return (*_picture_warnings(conditions), *_goal_warnings(conditions), *_measurement_warnings(conditions))


def _picture_warnings(conditions: StudyConditions) -> Iterator[str]:
    if conditions.bad:
        yield f"{conditions.bad} samples were not finite and were dropped: times and errors leave them out"
    if conditions.scale == 0.0:
        yield "what was rendered is black: no error is relative to it, so what accuracy costs cannot be said"
    elif conditions.prediction.points[-1].error.value == 0.0:
        yield "what was rendered has no noise: one sample per pixel is enough"
    if conditions.top_share > _LARGE_SHARE:
        yield (
            f"the worst 0.1 % of the pixels carry {100.0 * conditions.top_share:.0f} % of the squared error: rare "
            "bright samples decide, so errors are less certain than their intervals say"
        )


def _goal_warnings(conditions: StudyConditions) -> Iterator[str]:
    prediction = conditions.prediction
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
        elif spp > _MAX_EXTRAPOLATION * most:
            yield (
                f"the {what} {spp / most:.0f} times as many samples as were measured, {most}: "
                "how error falls so far beyond is not known"
            )


def _measurement_warnings(conditions: StudyConditions) -> Iterator[str]:
    if conditions.interrupted:
        rounds = f"{conditions.rounds} of {conditions.rounds_asked} rounds"
        yield f"interrupted after {rounds}" if conditions.rounds else "interrupted before the comparison"
    if 0 < conditions.rounds < MIN_ROUNDS:
        yield f"{conditions.rounds} rounds are few: intervals of medians take {MIN_ROUNDS}"
    if conditions.tiles_measured == 1:
        yield "one tile was measured, so intervals are not known"
    elif conditions.tiles_measured < min(MIN_TILES, conditions.tiles):
        yield f"only {conditions.tiles_measured} of {conditions.tiles} tiles were measured: intervals are rough"
    load = conditions.load
    if load is not None and math.isfinite(load) and load > _BUSY * conditions.processors:
        yield (
            f"the machine was busy before, with a load of {load:.1f} on {conditions.processors} processors: "
            "times may be longer than on a quiet one"
        )
    if conditions.threads > conditions.processors:
        yield f"{conditions.threads} threads share {conditions.processors} processors"
