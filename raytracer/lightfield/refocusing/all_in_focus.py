"""A picture that is sharp everywhere, from the light of all views.

Each point is taken from where it is in every view, as its depth says: as sharp as through a pinhole, with the light,
and so with less of the noise, of the whole aperture.  Views that see something else there, since that hides the point,
are left out.

References: Isaksen, McMillan, Gortler 2000, sec. 3 (a focal surface in place of a plane).
"""

import numpy as np
from numpy.typing import NDArray

from raytracer.lightfield.depth import Depth, Update
from raytracer.lightfield.supersampling import supersampled
from raytracer.plenoptic.field import LightField

_Picture = NDArray[np.float64]

_FACTOR = 2
"""Pixels along the side of one, with which detail finer than a pixel is told from what it looks like in each view."""


def all_in_focus(
    field: LightField,
    depth: Depth | None = None,
    *,
    threads: int | None = None,
    update: Update | None = None,
) -> _Picture:
    """The scene as one view sees it, sharp at all distances, float64 (height, width, 3).

    The picture of `supersampled`, two pixels a side to one: the mean of what all views know of a pixel's square.  Their
    plain mean would be blurred by taking each between its own pixels.

    Parameters
    ----------
    depth : of the view; default: found first, by `depth_map`.
    threads : that search for the depth; default: all.
    update : told of the progress.

    Raises
    ------
    InputError : as `depth_map`.
    """
    fine = supersampled(field, _FACTOR, depth, threads=threads, update=update)
    height, width = field.views.height, field.views.width
    return np.asarray(fine.reshape(height, _FACTOR, width, _FACTOR, 3).mean(axis=(1, 3)))
