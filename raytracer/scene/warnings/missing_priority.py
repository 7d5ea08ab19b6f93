"""Warn of clear objects without a priority that overlap what has one.

Light keeps an account of what it is in only of what has a priority.  So the surface of one without is a boundary to its
own `outside_ior` wherever it is, and what is around it goes on absorbing within.
"""

import math

import numpy as np
from numpy.typing import NDArray

from raytracer.plugins.materials.base.interface import BLACK
from raytracer.scene.warnings.base.clear_objects import ClearObjects, Copy, boundaries, inside_copy, is_inside_out
from raytracer.scene.warnings.base.kind import NESTING, SceneWarningKind
from raytracer.scene.warnings.base.survey import SceneSurvey, object_label
from raytracer.schema.warning_kind import Sentence, Warned

_MOST_TESTS, _FEWEST_POINTS = 1 << 18, 4
"""Most products of triangles and points of another object that are examined, and the least number of points."""


class MissingPriority(SceneWarningKind):
    """Clear objects without a priority that overlap one with a priority, the first such for each."""

    name = "clear objects without a priority in what has one"
    section = NESTING
    rank = 110
    overlap = Sentence(
        "is clear, and {overlaps} {other}, whose material has a `priority`, as its own has not: its surface is one to "
        "its own `outside_ior` there, and the other goes on absorbing in it; {remedy}",
        when="a `dielectric` or `rough_dielectric` without a `priority` overlaps an object whose material has one, "
        "is in it, or contains it",
        remedy="give its material a `priority` too, a higher one if it takes the place of the other",
    )

    def find(self, survey: SceneSurvey) -> Warned:
        clear = survey.once(ClearObjects)
        if not clear.bare or not clear.filled:
            return
        low, high = survey.boxes
        holders = np.array(clear.filled)
        hollows = [copy for piece in clear.hollows for copy in clear.copies(piece)]
        for piece in clear.bare:
            near = (low[piece] < high[holders]).all(axis=1) & (high[piece] > low[holders]).all(axis=1)
            for other in holders[near].tolist():
                overlap = _find_overlap(survey, clear.copies(piece), clear.copies(other), hollows)
                if overlap is not None:
                    one, holder, overlaps = overlap
                    keys, around = survey.owners((one.piece, one.instance), (holder.piece, holder.instance))
                    text = self.overlap.fill(overlaps=overlaps, other=object_label(survey.spec, around))
                    yield self.of_keys(survey, keys, text)
                    break


def _find_overlap(
    survey: SceneSurvey, ones: list[Copy], others: list[Copy], hollows: list[Copy]
) -> tuple[Copy, Copy, str] | None:
    """Find copies of an object without a priority and of one with it that overlap, and the verb for that."""
    for one in ones:
        for other in others:
            if not ((one.low < other.high) & (one.high > other.low)).all():
                continue
            inside = _inside(survey, one, other, hollows)
            if inside.all():
                if not _is_made_for_index(survey, one.piece, other.piece):
                    return one, other, "lies within"
            elif inside.any() or _inside(survey, other, one, hollows).any():
                return one, other, "overlaps"
    return None


def _is_made_for_index(survey: SceneSurvey, piece: int, holder: int) -> bool:
    """Return True if an object within another needs no priority: it is made for that index, and nothing absorbs."""
    look, around = survey.material_of(piece), survey.material_of(holder)
    filling = None if around is None else around.interior_medium()
    assert look is not None
    assert filling is not None
    turned = is_inside_out(survey, piece)
    facing = {part.ior if turned else part.outside_ior for part in boundaries(look)}
    return filling.absorption == BLACK and facing == {filling.ior}


def _inside(survey: SceneSurvey, one: Copy, other: Copy, hollows: list[Copy]) -> NDArray[np.bool_]:
    """Find the points of one copy that are inside of another by more than the ray offset, and in no hollow (n,).

    Fewer points are tested, the more triangles the other has.
    """
    rows = int(survey.pieces.stop[other.piece] - survey.pieces.start[other.piece])
    points = one.points[:: math.ceil(len(one.points) / max(_FEWEST_POINTS, _MOST_TESTS // rows))]
    if is_inside_out(survey, other.piece):
        return np.zeros(len(points), bool)
    result = inside_copy(survey, points, other)
    for hollow in hollows:
        if result.any() and (hollow.piece, hollow.instance) != (one.piece, one.instance):
            result[result] = ~inside_copy(survey, points[result], hollow)
    return result
