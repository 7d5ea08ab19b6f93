"""Binning of kept rays into views: the photograph from parts of its lens."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.field import LightField, Rays

# Rays that a pixel of a view is to have on average, and the fewest and most views in a row.
_RAYS_PER_PIXEL = 2.0
_FEWEST, _MOST = 3, 9

_CHUNK = 1 << 20
"""Rays that are binned at a time, for the memory that they take."""


def rays_to_views(field: LightField) -> tuple[LightField, str]:
    """Bin the rays of a light field into square views, and describe these in a sentence.

    Each ray counts for the view through whose part of the lens it went, and there for the pixel that it met: the middle
    of that part is taken for its place.  Pixels without rays are filled from those around them.

    Raises ValueError: the light field has no rays.
    """
    rays, views = field.rays, field.views
    if rays is None or len(rays.weight) == 0:
        raise ValueError("the light field has no rays")
    count = len(rays.weight)
    side = min(_MOST, max(_FEWEST, math.isqrt(int(count / (_RAYS_PER_PIXEL * views.width * views.height)))))
    across = views.aperture or 2.0 * float(np.abs(np.asarray(rays.place[:, :2])).max())
    if across == 0.0:
        return replace(field, rays=None), "All of its rays go through one point: there is nothing to focus."

    sums = np.zeros((side * side * views.height * views.width, 4))
    for begin in range(0, count, _CHUNK):
        _add(sums, field, Rays(*(np.asarray(part[begin : begin + _CHUNK]) for part in rays[:3])), side, across)
    sums = sums.reshape(side, side, views.height, views.width, 4)
    radiance = np.empty((*sums.shape[:4], 3))
    for place in np.ndindex(side, side):
        radiance[place] = _fill_gaps(sums[place])

    middles = ((np.arange(side) + 0.5) / side - 0.5) * across
    position = np.stack(np.meshgrid(middles, -middles), axis=-1)
    step = across / side
    geometry = replace(views, position=position, cell=(step, step))
    binned = LightField(radiance, geometry, settings=field.settings)
    return binned, f"Its {count:,} rays are gathered into {side} x {side} views, which blur what is far out of focus."


def _add(sums: NDArray[np.float64], field: LightField, rays: Rays, side: int, across: float) -> None:
    """Add rays to the sums of values and weights, by view and pixel."""
    views = field.views
    plane = views.plane
    right, up, x, y = rays.place.T
    column = np.clip(np.floor((right / across + 0.5) * side), 0, side - 1)
    row = np.clip(np.floor((0.5 - up / across) * side), 0, side - 1)
    i = np.floor((x - plane.left) / plane.pixel)
    j = np.floor((plane.top - y) / plane.pixel)
    seen = (i >= 0) & (i < views.width) & (j >= 0) & (j < views.height)
    index = (((row * side + column) * views.height + j) * views.width + i)[seen].astype(np.int64)
    for channel in range(3):
        sums[:, channel] += np.bincount(index, rays.value[seen, channel], len(sums))
    sums[:, 3] += np.bincount(index, rays.weight[seen], len(sums))


def _fill_gaps(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Divide sums (height, width, 4) into means; fill pixels without rays from ever larger neighbourhoods."""
    from scipy import ndimage

    total, weight = sums[..., :3], sums[..., 3]
    if not (weight > 0.0).any():
        return np.zeros_like(total)
    known = weight > 0.0
    mean = np.where(known[..., None], total / np.where(known, weight, 1.0)[..., None], 0.0)
    size = 1
    while not known.all():
        size = 2 * size + 1
        around = ndimage.uniform_filter(weight, size, mode="constant")
        value = ndimage.uniform_filter(total, (size, size, 1), mode="constant")
        # Sums of a running mean leave a rounding error where there is no weight.
        new = ~known & (ndimage.maximum_filter(weight, size, mode="constant") > 0.0)
        mean[new] = value[new] / around[new, None]
        known |= new
    return mean
