"""Refocusing by the rays that were kept: each is followed to the plane of focus, and counts for the pixel it meets."""

import math

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.field import Rays
from raytracer.film.light_field.focusing import FocusPlane
from raytracer.film.light_field.lenslet_kinds import sharpness
from raytracer.film.light_field.views import Views
from raytracer.film.window import Window
from raytracer.lightfield.synthetic_aperture import RefocusAperture, cell_weights, opening_transmission
from raytracer.util.errors import InputError

FloatArray = NDArray[np.float64]

# Rays that are read from a file at a time.
_RAYS_AT_ONCE = 1 << 20


def integrate_rays(
    rays: Rays, views: Views, plane: FocusPlane, aperture: RefocusAperture, window: Window, scale: float = 1.0
) -> tuple[FloatArray, FloatArray]:
    """Sum kept rays into the picture of a plane of focus, and count the rays of each pixel.

    Returns both, float64, (height, width, 3) and (height, width) of the window.  A pixel is the mean of the rays
    that come to it from the plane, through the opening; black where none does.  Rays that are bundles count more the
    narrower they are there.

    Raises InputError: `scale` is not above 0, or the opening is wider than the lens.
    """
    if not 0.0 < scale < math.inf:
        raise InputError(f"scale must be greater than 0 and finite, got {scale:g}")
    if aperture.diameter is not None:
        cell_weights(views, *aperture)
    pixel = views.plane.pixel / scale
    left, top = round(scale * window.left), round(scale * window.top)
    width, height = round(scale * window.right) - left, round(scale * window.bottom) - top
    if width < 1 or height < 1:
        raise InputError(f"scale {scale:g} leaves no pixel of {window.right - window.left} x {window.bottom - top}")
    sums, count = np.zeros((height * width, 3)), np.zeros(height * width)
    for first in range(0, len(rays.weight), _RAYS_AT_ONCE):
        part = slice(first, first + _RAYS_AT_ONCE)
        right, up, x, y = np.asarray(rays.place[part], dtype=np.float64).T
        slope, rise = x - views.inverse_focus * right, y - views.inverse_focus * up

        # A ray meets the plane at the tangents slope + q right and rise + q up, with q one over the distance there.
        inverse = (plane.middle + plane.right * slope + plane.up * rise) / (1.0 - plane.right * right - plane.up * up)
        column = np.floor((slope + inverse * right - views.plane.left) / pixel) - left
        row = np.floor((views.plane.top - rise - inverse * up) / pixel) - top
        weight = np.asarray(rays.weight[part], dtype=np.float64)
        value = np.asarray(rays.value[part], dtype=np.float64)
        if rays.bundle is not None:
            angle, diameter = np.asarray(rays.bundle[part], dtype=np.float64).T
            share = sharpness(angle - diameter * inverse, pixel)
            weight, value = weight * share, value * share[:, None]
        if aperture.diameter is not None:
            passes = opening_transmission(
                right - aperture.center[0], up - aperture.center[1], aperture.diameter, aperture.shape
            )
            weight, value = weight * passes, value * passes[:, None]
        hits = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        place = (row[hits] * width + column[hits]).astype(np.int64)
        count += np.bincount(place, weight[hits], minlength=len(count))
        for channel in range(3):
            sums[:, channel] += np.bincount(place, value[hits, channel], minlength=len(count))
    picture = np.divide(sums, count[:, None], out=np.zeros_like(sums), where=count[:, None] != 0.0)
    return picture.reshape(height, width, 3), count.reshape(height, width)
