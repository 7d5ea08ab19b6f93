"""Warn of what a reader should know of a study of cost before believing it."""

from typing import NamedTuple

from raytracer.analysis.cost.results import Study
from raytracer.schema.warning_kind import WarningFamily, WarningKind

MIN_ROUNDS = 9
"""Least rounds for an interval of a median of 95 %."""

MIN_TILES = 16
"""Least tiles that may be asked for, if the picture has as many: one may be of nothing but sky."""


class StudyConditions(NamedTuple):
    """A study, and the conditions that warnings depend on besides its results.

    study : still without warnings.
    scale : mean of the picture.
    bad : number of samples that were not finite.
    rounds_asked : rounds of the comparison that were asked for.
    """

    study: Study
    scale: float
    bad: int
    rounds_asked: int


class StudyWarningKind(WarningKind[StudyConditions]):
    """Base of the kinds of warnings about studies."""

    section = "Studies of cost"


STUDY_WARNINGS = WarningFamily[StudyConditions](__name__)
