"""Warn of clear objects without a priority that are nested too deep.

Each is a boundary to its own `outside_ior`, so they act as if the innermost had the product of all their indices; light
in it comes out again only if it is that much nearer to the normal.
"""

import math

import numpy as np
from numpy.typing import NDArray

from raytracer.scene.render_settings import Render
from raytracer.scene.warnings.base.clear_objects import ClearObjects, boundaries, inside_copy, is_inside_out
from raytracer.scene.warnings.base.kind import NESTING, SceneWarningKind
from raytracer.scene.warnings.base.primitive_points import Points
from raytracer.scene.warnings.base.survey import SceneSurvey
from raytracer.schema.warning_kind import Sentence, Warned

MAX_INDEX_PRODUCT = 1e13
"""Product of the indices of nested objects up to which light comes out again: float64 has 4.5e15 steps from 0 to 1.

Measured in a furnace: at 1.6e13 and 2.4e13 a five-thousandth is lost at most, at 1e14 five times that, at 1e15 2 %.
"""

_FEWEST_NESTED = math.ceil(math.log(MAX_INDEX_PRODUCT) / math.log(5.0))
"""Objects whose product may be larger: no index is above 5."""

_USUAL_DEPTH = int(Render.model_fields["max_depth"].default)
"""Scenes with fewer path segments than this cut paths off on purpose."""

_MOST_NESTED = 2048
"""Most clear objects that are compared with each other: the largest ones, which others are in."""

_MOST_TRIED = 32
"""Most objects that are examined as the innermost."""


class DeepNesting(SceneWarningKind):
    """The innermost of clear objects without a priority, if light hardly comes out of it again."""

    name = "clear objects nested too deep"
    section = NESTING
    rank = 100
    index = Sentence(
        "lies within {holders} clear objects whose materials have no `priority`, each a boundary to its own "
        "`outside_ior`: so it acts as if its index were 1e{digits:.0f}, and beyond {limit:.0e} rounding keeps light "
        "from coming out of it; {remedy}",
        when="transparent objects without a priority are nested, and the product of their relative indices, each "
        "over its `outside_ior`, is above 10^13: light inside is nearly parallel to the normal, beyond the 16 "
        "digits of float64, and what is lost by rounding does not come out again",
        remedy="give the materials a `priority`, or the `outside_ior` of what they are in",
    )
    depth = Sentence(
        "lies within {holders} clear objects, so light goes straight through {surfaces} surfaces, and paths end after "
        "{segments} segments: {remedy}",
        when="more nested surfaces than `render.max_depth` lets a path cross, even if that is 50 or more",
        remedy="raise `render.max_depth`",
    )

    def find(self, survey: SceneSurvey) -> Warned:
        clear = survey.once(ClearObjects)
        if len(clear.bare) < _FEWEST_NESTED:
            return
        largest = np.argsort(-survey.pieces.half[clear.bare], kind="stable")[:_MOST_NESTED]
        bare = np.array(clear.bare)[largest].tolist()
        index = np.array([_relative_index(survey, piece) for piece in bare])
        around = _enclosing(np.column_stack([survey.boxes[0][bare], -survey.boxes[1][bare]]))
        segments = survey.spec.render.max_depth
        # Boxes give an upper bound of the nesting of what is in them.
        by_boxes = around @ np.log(index)
        doubtful = (by_boxes > math.log(MAX_INDEX_PRODUCT)) | (2 * around.sum(axis=1) + 1 > max(segments, _USUAL_DEPTH))
        for k in sorted(np.flatnonzero(doubtful).tolist(), key=lambda k: -float(by_boxes[k]))[:_MOST_TRIED]:
            own = clear.copies(bare[k])[0]
            inside = np.flatnonzero(around[k]).tolist()
            holders = [
                j
                for j in inside
                if j == k or any(inside_copy(survey, own.points, copy).all() for copy in clear.copies(bare[j]))
            ]
            product, surfaces, others = float(np.log(index[holders]).sum()), 2 * len(holders), len(holders) - 1
            if product > math.log(MAX_INDEX_PRODUCT):
                digits = product / math.log(10.0)
                text = self.index.fill(holders=others, digits=digits, limit=MAX_INDEX_PRODUCT)
            elif surfaces + 1 > max(segments, _USUAL_DEPTH):
                text = self.depth.fill(holders=others, surfaces=surfaces, segments=segments)
            else:
                continue
            yield self.of_piece(survey, bare[k], text)
            return


def _enclosing(ends: Points) -> NDArray[np.bool_]:
    """Find which box holds which, of boxes with the ends (n, 6), those above negated: (n, n), by the one held."""
    result = np.ones((len(ends), len(ends)), bool)
    for column in ends.T:
        result &= column[None, :] <= column[:, None]
    return result


def _relative_index(survey: SceneSurvey, piece: int) -> float:
    """Divide the index within a piece by that around it; the largest of what its material selects from."""
    look = survey.material_of(piece)
    assert look is not None
    ratio = max(part.eta() for part in boundaries(look))
    return 1.0 / ratio if is_inside_out(survey, piece) else ratio
