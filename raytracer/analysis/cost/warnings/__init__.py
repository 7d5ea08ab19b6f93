"""Warn of what a reader should know of a study of cost before believing it."""

from typing import NamedTuple

from raytracer.analysis.cost.results import Prediction
from raytracer.schema.warning_kind import WarningFamily, WarningKind

MIN_ROUNDS = 9
"""Least rounds for an interval of a median of 95 %."""

MIN_TILES = 16
"""Least tiles that may be asked for, if the picture has as many: one may be of nothing but sky."""


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


class StudyWarningKind(WarningKind[StudyConditions]):
    """Base of the kinds of warnings about studies."""

    section = "Studies of cost"


STUDY_WARNINGS = WarningFamily[StudyConditions](__name__)
