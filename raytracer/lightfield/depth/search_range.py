"""Range of distances in which depth is searched for, and the planes of the sweep."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.views import Views
from raytracer.lightfield.depth.estimate import DepthContext, ViewIndex, median_spacing, view_offsets
from raytracer.lightfield.depth.plane_sweep import sweep_planes
from raytracer.util.errors import InputError

_COARSE_STEP, _COARSE_REACH = 0.5, 8.0
"""Coarse search: pixels between neighbouring views from plane to plane, and at most.  Light fields are called densely
sampled below one or two."""

_TAILS = 0.001
"""Share of the pixels at each end of the distances of the coarse search that counts as outliers."""

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

    Raises
    ------
    InputError : the distances given are not possible.
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
    return max(low, least - step), min(high, most + step)


def sweep_distances(
    views: Views, reference: ViewIndex, others: Sequence[ViewIndex], bounds: tuple[float, float]
) -> NDArray[np.float64]:
    """Space planes evenly in 1 / distance, such that no view moves by more than a step from one to the next."""
    offsets = view_offsets(views, reference)
    farthest = max(float(np.hypot(*offsets[other])) for other in others)
    moved = (bounds[1] - bounds[0]) * farthest / views.plane.pixel
    return np.linspace(*bounds, min(_MOST_PLANES, max(3, math.ceil(moved / _STEP) + 1)))
