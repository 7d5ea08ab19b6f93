"""All views of a light field on one picture."""

import math

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.field import LightField
from raytracer.lightfield.coverage import lit_views
from raytracer.lightfield.memory import require_memory
from raytracer.util.errors import InputError

FloatArray = NDArray[np.float64]

_UNLIT = 0.2159
"""Grey of views without light: 128 of sRGB, as a share of white."""

_BYTES, _VIEW_BYTES = 72, 80
"""Bytes a pixel of the picture, until it is written, and of a view that is put on it."""


def montage(field: LightField, *, width: int | None = None, gap: int = 2) -> FloatArray:
    """Arrange all views on one picture, the highest row first: float64 (height, width, 3), gaps white.

    Views without light are grey.  Views are read one at a time, and reduced by averaging whole pixels.

    Parameters
    ----------
    width : of the picture in pixels, at most; default: views keep their size.
    gap : pixels between views.

    Raises
    ------
    InputError : there is no room for a pixel of each view, or the picture takes more memory than is given.
    """
    views = field.views
    view_width = math.inf if width is None else (width - gap * (views.columns - 1)) / views.columns
    if view_width < 1.0:
        raise InputError(f"a picture {width} pixels wide has no room for {views.columns} views in a row")
    factor = min(max(1, math.ceil(views.width / view_width)), views.width, views.height)
    small = views.height // factor, views.width // factor
    shape = (views.rows * (small[0] + gap) - gap, views.columns * (small[1] + gap) - gap, 3)
    size = _BYTES * shape[0] * shape[1] + _VIEW_BYTES * views.height * views.width
    require_memory(size, f"a montage of {shape[1]} x {shape[0]} pixels", "a narrower one takes less")
    whole = np.ones(shape)
    lit = lit_views(field)
    for row, column in np.ndindex(views.rows, views.columns):
        view = field.view(row, column)[: small[0] * factor, : small[1] * factor]
        view = view.reshape(small[0], factor, small[1], factor, 3).mean(axis=(1, 3))
        top, left = row * (small[0] + gap), column * (small[1] + gap)
        whole[top : top + small[0], left : left + small[1]] = view if lit[row, column] else _UNLIT
    return whole
