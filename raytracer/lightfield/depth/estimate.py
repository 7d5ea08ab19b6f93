"""Estimate of a depth method, and the context in which all methods make theirs."""

from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.views import Views
from raytracer.lightfield.coverage import within_lens
from raytracer.util.progress import ProgressCounter

FloatArray = NDArray[np.float64]

HIDING_PARALLAX = 0.5
"""Parallax (pixels between two views) by which a point must be nearer to hide another."""

ViewIndex = tuple[int, int]
"""Row and column of a view."""


class Estimate(NamedTuple):
    """Depth by one method, pixel by pixel of the reference view.

    inverse : 1 / distance (1/m), float64 (height, width).
    confidence : float64 (height, width), 0 where there is no evidence.
    rival : 1 / distance (1/m) of the second best explanation, float64 (height, width); None if none is looked for.
    rival_cost : cost of that as a multiple of the best one's, from 1 on; inf for no other.
    """

    inverse: FloatArray
    confidence: FloatArray
    rival: FloatArray | None = None
    rival_cost: FloatArray | None = None


class DepthContext(NamedTuple):
    """Input of all methods.

    field : the light field.
    reference : the view whose depth is estimated.
    pool : threads that share the work.
    threads : number of these.
    counter : of the progress.
    """

    field: LightField
    reference: ViewIndex
    pool: ThreadPoolExecutor
    threads: int
    counter: ProgressCounter


def view_offsets(views: Views, reference: ViewIndex) -> NDArray[np.float64]:
    """Return the places of all views relative to one of them (m), (rows, columns, 2)."""
    return np.asarray(views.position - views.position[reference])


def median_spacing(views: Views) -> float:
    """Return the median distance of a view to its nearest neighbour (m)."""
    from scipy import spatial

    places = views.position[within_lens(views)]
    away, _ = spatial.KDTree(places).query(places, k=2)
    return float(np.median(away[:, 1]))
