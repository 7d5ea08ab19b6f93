"""All-in-focus pictures: sharp at all distances, from the light of all views.

Each point is taken from its place in every view, by its depth: as sharp as through a pinhole, with the light, and so
with the lower noise, of the whole aperture.  Views in which something hides the point are left out.

References: Isaksen, McMillan, Gortler 2000, sec. 3 (a focal surface in place of a plane).
"""

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.field import LightField
from raytracer.lightfield.depth.depth_map import Depth
from raytracer.lightfield.super_resolution import supersampled
from raytracer.util.progress import Update

FloatArray = NDArray[np.float64]

_FACTOR = 2
"""Pixels along the side of one, by which detail finer than a pixel is told from its aliases in each view."""


def all_in_focus(
    field: LightField,
    depth: Depth | None = None,
    *,
    threads: int | None = None,
    update: Update | None = None,
) -> FloatArray:
    """Render the scene as one view sees it, sharp at all distances, float64 (height, width, 3).

    The picture of `supersampled` with two pixels a side, averaged to one: the mean over a pixel's square of what all
    views know of it.  Their plain mean would be blurred by interpolating each between its own pixels.

    Parameters
    ----------
    depth : of the view; default: estimated first, by `depth_map`.
    threads : that estimate the depth; default: all.
    update : called with the work that is done, and with all of it.

    Raises
    ------
    InputError : as `depth_map`.
    """
    fine = supersampled(field, _FACTOR, depth, threads=threads, update=update)
    height, width = field.views.height, field.views.width
    return np.asarray(fine.reshape(height, _FACTOR, width, _FACTOR, 3).mean(axis=(1, 3)))
