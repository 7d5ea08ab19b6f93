"""Depth (m) of what the views of a light field see.

Two methods, each with a confidence in 0..1, and both together:

- **focus**: a plane sweep (`plane_sweep`), which knows what hides what;
- **slopes**: the structure tensor of epipolar slices (`structure_tensor`), finer than any step between planes.

What they find is refined by the views' residuals (`refinement`), and gets a standard error (`reliability`).

Distances are those along the axis from the plane of the views, as of the AOV `depth`.  Both methods work in
1 / distance, in which a step moves pixels by the same everywhere.
"""

import itertools
import math
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.posed_views import PosedViews
from raytracer.film.light_field.views import Views
from raytracer.lightfield.coverage import extrapolate_unlit, require_lit, within_lens
from raytracer.lightfield.depth.estimate import (
    DepthContext,
    Estimate,
    FloatArray,
    ViewIndex,
    median_spacing,
    view_offsets,
)
from raytracer.lightfield.depth.plane_sweep import sweep_planes
from raytracer.lightfield.depth.refinement import refine, require_refinement
from raytracer.lightfield.depth.reliability import confidence_of, standard_error
from raytracer.lightfield.depth.structure_tensor import measure_slopes
from raytracer.util.errors import InputError
from raytracer.util.progress import ProgressCounter, Update

Method = Literal["focus", "slopes", "both"]
METHODS: tuple[Method, ...] = ("focus", "slopes", "both")

_MOST_VIEWS = 49
"""Most views that are compared: of larger arrays every second, third ... one, as noise is low enough with so many."""

_SLOPES_WEIGHT, _DISAGREEMENT = 0.5, 0.5
"""Weight of the confidence of slopes beside that of focus, and factor of the confidence where both do not agree."""

_FEWEST_OTHERS = 2
"""Other views that must have light at a pixel for its depth to be known: one alone agrees somewhere by chance."""


@dataclass(frozen=True, eq=False)
class Depth:
    """Depth map of one view.

    Attributes
    ----------
    inverse : float64 (height, width), 1 / distance (1/m); of a light field whose geometry is not known, pixels from
        view to view.
    confidence : float64 (height, width) in 0..1, a half where the standard error is a hundredth of the range of the
        scene in 1 / distance; near 0 where many distances explain the views as well, as without texture.
    row, column : of the view.
    lit : True for pixels of the view that got light, bool (height, width); None for all.  `inverse` is continued over
        others.
    error : standard error of `inverse`, of the same unit, float64 (height, width); None if it is not known.
    """

    inverse: FloatArray
    confidence: FloatArray
    row: int
    column: int
    lit: NDArray[np.bool_] | None = None
    error: FloatArray | None = None

    @property
    def distance(self) -> FloatArray:
        """Distance along the axis from the plane of the views (m), float64 (height, width); inf for infinity.

        It is nan where there is no light.
        """
        with np.errstate(divide="ignore"):
            return self.known(np.where(self.inverse > 0.0, 1.0 / np.maximum(self.inverse, 0.0), np.inf))

    @property
    def distance_error(self) -> FloatArray | None:
        """Standard error of the distance (m), float64 (height, width); inf where the distance is; None if not known."""
        if self.error is None:
            return None
        distance = self.distance
        is_finite = np.isfinite(distance)
        error = np.where(is_finite, distance, 0.0) ** 2 * self.error
        return self.known(np.where(is_finite, error, np.inf))

    def disparity_error(self, views: Views) -> FloatArray | None:
        """Return the standard error in pixels from view to view, float64 (height, width); None if it is not known."""
        if self.error is None:
            return None
        return self.known(self.error * (median_spacing(views) / views.plane.pixel))

    def known(self, values: FloatArray) -> FloatArray:
        """Mask values (height, width): nan where there is no light."""
        return values if self.lit is None else np.where(self.lit, values, np.nan)


def depth_map(
    field: LightField,
    *,
    row: int | None = None,
    column: int | None = None,
    method: Method = "both",
    near: float | None = None,
    far: float | None = None,
    threads: int | None = None,
    update: Update | None = None,
) -> Depth:
    """Estimate the depth of what one view sees.

    Views are read one at a time, and as many planes are compared at once as fit into the memory that
    `raytracer.lightfield.memory.memory_limit` sets.

    Parameters
    ----------
    row, column : of the view; default: the middle.
    near, far : distances (m) that bound the scene; default: searched for, among distances at which things move by
        at most 8 pixels between neighbouring views, as seen from the plane where all views see the same.
    threads : that share the work; default: all.
    update : called with the work that is done, and with all of it.

    Raises
    ------
    InputError : there are too few views, no such view, no such method, `near` is not nearer than `far`, or it
        takes more memory than is given.
    """
    if method not in METHODS:
        raise InputError(f"no method {method}; there are {', '.join(METHODS)}")
    middle = reference_view(field.views, row, column)
    require_lit(field, *middle)
    grid = within_lens(field.views)
    others = [index for index in zip(*np.nonzero(grid), strict=True) if index != middle]
    if not others:
        raise InputError("depth needs at least two views, and the light field has one")

    counter = ProgressCounter(update)
    count = threads or os.cpu_count() or 1
    with ThreadPoolExecutor(count) as pool:
        context = DepthContext(field, middle, pool, count, counter)
        # What comes last is refused first, and not after all that goes before.
        require_refinement(context)
        bounds = search_bounds(context, others, near, far)
        compared = _select_views(field.views, middle)
        estimates: list[Estimate] = []
        planes = sweep_distances(field.views, middle, others, bounds)
        step = float(planes[1] - planes[0])
        if method in {"focus", "both"}:
            estimates.append(sweep_planes(context, compared, planes))
        if method in {"slopes", "both"}:
            estimates.append(measure_slopes(context, bounds))
        estimate = estimates[0] if len(estimates) == 1 else _fuse_estimates(*estimates, agreeing=step)
        refined = refine(context, compared, estimate.inverse, bounds)
    lit = field.lit(*middle)
    error = standard_error(estimate, refined, bounds, step)
    confidence = confidence_of(error, _found_range(field, refined.inverse, error, bounds))
    if lit is None:
        return Depth(refined.inverse, confidence, *middle, error=error)
    confidence = np.where(lit & _has_enough_views(field, others), confidence, 0.0)
    return Depth(extrapolate_unlit(refined.inverse, lit), confidence, *middle, lit, error)


def _found_range(field: LightField, inverse: FloatArray, error: FloatArray, bounds: tuple[float, float]) -> float:
    """Return the range of 1 / distance of the better known half of the pixels, and a pixel more, within bounds."""
    views = field.views
    best = inverse[error <= np.median(error)]
    found = float(np.ptp(np.quantile(best, [_TAILS, 1.0 - _TAILS])))
    return min(bounds[1] - bounds[0], found + views.plane.pixel / median_spacing(views))


def _has_enough_views(field: LightField, others: Sequence[ViewIndex]) -> NDArray[np.bool_]:
    """Find the pixels at which enough other views have light for a depth: bool (height, width)."""
    count = np.zeros((field.views.height, field.views.width), dtype=np.int64)
    for other in others:
        lit = field.lit(*other)
        count += 1 if lit is None else lit
    return count >= _FEWEST_OTHERS


def reference_view(views: Views, row: int | None, column: int | None) -> ViewIndex:
    """Return row and column of a view, the middle by default; raise an InputError if there is no such view."""
    middle = views.nearest()
    return check_view(views, middle[0] if row is None else row, middle[1] if column is None else column)


def check_view(views: Views | PosedViews, row: int, column: int) -> ViewIndex:
    """Return row and column of a view; raise an InputError if there is no such view."""
    if not (0 <= row < views.rows and 0 <= column < views.columns):
        raise InputError(
            f"no view {row},{column}: the light field has {views.rows} rows of {views.columns}, counted from 0"
        )
    return row, column


def _select_views(views: Views, reference: ViewIndex) -> list[ViewIndex]:
    """Choose the views to compare with one of them: at most so many, evenly spread over all."""
    side = math.isqrt(_MOST_VIEWS)
    rows = min(views.rows, max(side, _MOST_VIEWS // views.columns))
    columns = min(views.columns, max(side, _MOST_VIEWS // views.rows))
    chosen_rows = {round(place) for place in np.linspace(0, views.rows - 1, rows)}
    chosen_columns = {round(place) for place in np.linspace(0, views.columns - 1, columns)}
    grid = within_lens(views)
    chosen = itertools.product(sorted(chosen_rows), sorted(chosen_columns))
    return [view for view in chosen if grid[view] and view != reference]


def _fuse_estimates(focus: Estimate, slopes: Estimate, *, agreeing: float) -> Estimate:
    """Fuse two estimates: their mean by confidence where both agree, else that of focus with half its confidence.

    Focus knows what hides what, and slopes do not: so they count half, as further evidence.
    """
    agree = np.abs(focus.inverse - slopes.inverse) <= agreeing
    slopes_weight = _SLOPES_WEIGHT * slopes.confidence
    weight = focus.confidence + slopes_weight
    safe = np.where(weight > 0.0, weight, 1.0)
    mean = (focus.confidence * focus.inverse + slopes_weight * slopes.inverse) / safe
    return Estimate(
        np.where(agree & (weight > 0.0), mean, focus.inverse),
        np.where(agree, 1.0, _DISAGREEMENT) * focus.confidence,
        focus.rival,
        focus.rival_cost,
    )


_COARSE_STEP, _COARSE_REACH = 0.5, 8.0
"""Coarse search: pixels between neighbouring views from plane to plane, and at most.  Light fields are called densely
sampled below one or two."""

_TAILS = 0.001
"""Share of the pixels at each end of the distances of the coarse search that counts as outliers."""

_REPEATING, _REPEATING_COST = 0.9, 3.0
"""Confidence from which on a pixel has texture, as a share of the median, and ratio of costs below which another
distance is a rival: the texture repeats."""

_REPEATING_SHARE, _REPEATING_TAILS = 0.05, 0.02
"""Share of such pixels from which on the search covers all their distances, but for tails: at most 0.014 in scenes
without repeating textures, and 0.11 to 0.45 where they fill half of the picture."""

_NEIGHBOURS = 8
"""Views next to the reference view with which the coarse search compares it."""

_STEP = 1.0 / 3.0
"""Pixels by which the outermost view moves from plane to plane: textures, and the parabola through three planes, are
smooth over so little."""

_MOST_PLANES = 192
"""Most planes of a sweep; where views are so far apart that more were needed, planes are farther apart."""


def search_bounds(
    context: DepthContext, others: Sequence[ViewIndex], near: float | None, far: float | None
) -> tuple[float, float]:
    """Bound 1 / distance of what the reference view sees: as given, or by a coarse sweep with the nearest views.

    Raises InputError: the distances given are not possible.
    """
    field, reference = context.field, context.reference
    for name, distance in (("near", near), ("far", far)):
        if distance is not None and not distance > 0.0:
            raise InputError(f"{name} must be a distance greater than 0, got {distance:g}")
    if near is not None and far is not None:
        if not near < far:
            raise InputError(f"near must be less than far, got {near:g} and {far:g}")
        return 1.0 / far, 1.0 / near

    # Nothing is beyond infinity, where distances are known at all.
    views = field.views
    scale = views.plane.pixel / median_spacing(views)
    low = views.inverse_focus - _COARSE_REACH * scale
    high = views.inverse_focus + _COARSE_REACH * scale
    low = 1.0 / far if far is not None else max(0.0, low) if field.is_metric else low
    high = 1.0 / near if near is not None else high
    if not low < high:
        raise InputError("near and far leave no distance at which views can be told from each other")

    # Neighbours alone are rough evidence, but a pattern that repeats cannot mislead them.
    away = np.array([np.hypot(*view_offsets(views, reference)[other]) for other in others])
    order = np.argsort(away, kind="stable")[:_NEIGHBOURS]
    neighbours = [others[number] for number in order]
    count = max(3, math.ceil((high - low) / (_COARSE_STEP * scale)) + 1)
    planes = np.linspace(low, high, count)
    coarse = sweep_planes(context, neighbours, planes)
    lit = field.lit(*reference)
    known = np.ones(coarse.confidence.shape, dtype=bool) if lit is None else lit
    confident = coarse.inverse[known & (coarse.confidence >= np.median(coarse.confidence[known]))]
    step = planes[1] - planes[0]
    least, most = np.quantile(confident, [_TAILS, 1.0 - _TAILS])
    # Where a texture repeats, any of its distances may be the true one: all of them are searched, to be told apart, or
    # to be refused.
    assert coarse.rival is not None
    assert coarse.rival_cost is not None
    repeats = known & (coarse.confidence >= _REPEATING * np.median(coarse.confidence[known]))
    repeats &= coarse.rival_cost < _REPEATING_COST
    if repeats.sum() >= _REPEATING_SHARE * known.sum():
        both = np.concatenate([coarse.inverse[repeats], coarse.rival[repeats]])
        ends = np.quantile(both, [_REPEATING_TAILS, 1.0 - _REPEATING_TAILS])
        least, most = min(least, float(ends[0])), max(most, float(ends[1]))
    return max(low, float(least - step)), min(high, float(most + step))


def sweep_distances(
    views: Views, reference: ViewIndex, others: Sequence[ViewIndex], bounds: tuple[float, float]
) -> NDArray[np.float64]:
    """Space planes evenly in 1 / distance, such that no view moves by more than a step from one to the next."""
    offsets = view_offsets(views, reference)
    farthest = max(float(np.hypot(*offsets[other])) for other in others)
    moved = (bounds[1] - bounds[0]) * farthest / views.plane.pixel
    return np.linspace(*bounds, min(_MOST_PLANES, max(3, math.ceil(moved / _STEP) + 1)))
