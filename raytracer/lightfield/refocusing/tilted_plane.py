"""Refocusing on a tilted plane: each pixel of a view is moved by its own distance of focus, and views are summed."""

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.focusing import FocusPlane
from raytracer.film.window import Window
from raytracer.lightfield.coverage import lit_at_nearest, lit_view
from raytracer.lightfield.refocusing.pixel_interpolation import Interpolation

FloatArray = NDArray[np.float64]


def warp_and_sum(
    field: LightField, plane: FocusPlane, weights: FloatArray, interpolation: Interpolation, window: Window
) -> FloatArray:
    """Focus on a tilted plane: float64 (height, width, 3) of the window."""
    from scipy.ndimage import map_coordinates

    views, order = field.views, 1 if interpolation == "linear" else 3
    x, y = np.meshgrid(np.arange(window.left, window.right), np.arange(window.top, window.bottom))
    right = views.plane.left + views.plane.pixel * (x + 0.5)
    up = views.plane.top - views.plane.pixel * (y + 0.5)
    moved = (views.inverse_focus - plane.middle - plane.right * right - plane.up * up) / views.plane.pixel
    total, seen = np.zeros((*x.shape, 3)), np.zeros(x.shape)
    for row, column in np.argwhere(weights > 0.0):
        place_x = x + views.position[row, column, 0] * moved
        place_y = y - views.position[row, column, 1] * moved
        within = (np.abs(place_x - 0.5 * (views.width - 1)) <= 0.5 * views.width) & (
            np.abs(place_y - 0.5 * (views.height - 1)) <= 0.5 * views.height
        )
        if not within.any():
            continue
        view, lit = lit_view(field, row, column)
        if lit is not None:
            within &= lit_at_nearest(lit, place_y, place_x)
        for channel in range(3):
            values = map_coordinates(view[..., channel], [place_y, place_x], order=order, mode="nearest")
            total[..., channel] += weights[row, column] * within * values
        seen += weights[row, column] * within
    return np.divide(total, seen[..., None], out=total, where=seen[..., None] > 0.0)
