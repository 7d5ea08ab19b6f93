"""Refinement of a depth estimate to a hundredth of a pixel, with its standard error.

In turns, the views' linearised residuals tell by how much each pixel is off (`residuals`), and neighbours on one
surface are averaged by planes (`local_planes`), whose variance is that of the result.  Edges in depth stay in place.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from raytracer.lightfield.depth.estimate import DepthContext, FloatArray, ViewIndex, median_spacing, view_offsets
from raytracer.lightfield.depth.local_planes import Planes, fit_planes
from raytracer.lightfield.depth.residuals import Offsets, measure_offsets
from raytracer.lightfield.memory import MORE_MEMORY, require_memory

_PASSES = 2

_EDGE = 0.5
"""Jump of the disparity, in pixels of the outermost view, that makes an edge."""

_START, _LEAST = 1.0 / 3.0, 0.1
"""Uncertainty of the disparity to begin with, and at least, in pixels of the outermost view: a step from plane to
plane, and what surfaces curve by."""

_FIXED_BYTES, _THREAD_BYTES = 640, 112
"""Bytes a pixel: sums over views, planes and the estimates before; and a view in each thread."""


class Refined(NamedTuple):
    """Disparity after refinement, (height, width) each.

    inverse : 1 / distance (1/m).
    error : standard error of it (1/m), by noise and texture; the bounds' where nothing is known.
    jump : at an edge in depth to a neighbour (1/m); 0 elsewhere.
    """

    inverse: FloatArray
    error: FloatArray
    jump: FloatArray


def require_refinement(context: DepthContext) -> None:
    """Refuse what `refine` would take more memory for than is given.

    Raises InputError: it does.
    """
    views = context.field.views
    size = views.width * views.height * (_FIXED_BYTES + _THREAD_BYTES * context.threads)
    require_memory(size, f"depth of {views.width} x {views.height} pixels", MORE_MEMORY)


def refine(
    context: DepthContext, others: Sequence[ViewIndex], inverse: FloatArray, bounds: tuple[float, float]
) -> Refined:
    """Refine 1 / distance (1/m), height x width, with the views `others`; `bounds` are its least and greatest value."""
    views = context.field.views
    spacing = median_spacing(views)
    scale = spacing / views.plane.pixel
    places = view_offsets(views, context.reference) / spacing
    farthest = max(float(np.hypot(*places[other])) for other in others)
    context.counter.add_total(_PASSES * len(others))
    low, high = ((bound - views.inverse_focus) * scale for bound in bounds)

    # The mean square distance of any two places between the bounds.
    prior = 6.0 / (high - low) ** 2
    level = np.zeros(inverse.shape)
    planes = Planes((inverse - views.inverse_focus) * scale, level, level, level)
    uncertainty = np.full(inverse.shape, _START / farthest)
    offsets: Offsets | None = None
    for _ in range(_PASSES):
        offsets = measure_offsets(context, others, planes.value, offsets)
        planes, jumps = fit_planes(planes, offsets, uncertainty, edge=_EDGE / farthest, prior=prior)
        planes = planes._replace(value=np.clip(planes.value, low, high))
        uncertainty = np.clip(np.sqrt(planes.variance), _LEAST / farthest, _START / farthest)
    return Refined(views.inverse_focus + planes.value / scale, np.sqrt(planes.variance) / scale, jumps / scale)
