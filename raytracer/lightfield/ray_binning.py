"""Views out of rays: what a photograph whose rays were kept looks like from parts of its lens."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from raytracer.plenoptic.field import LightField, Rays

# Of the rays of a pixel, how many a view is to have of it, and the fewest and most views in a row.
_RAYS = 2.0
_FEWEST, _MOST = 3, 9

_CHUNK = 1 << 20
"""Rays that are gathered at a time, for the memory that they take."""


def gathered(field: LightField) -> tuple[LightField, str]:
    """A light field of square views out of one whose rays were kept, and a sentence that says of how many.

    Each ray goes to the view through whose part of the lens it went, and there to the pixel that it met: the middle of
    that part is taken for its place.  Pixels that no ray met are filled from those around them.

    Raises
    ------
    ValueError : the light field has no rays.
    """
    rays, views = field.rays, field.views
    if rays is None or len(rays.weight) == 0:
        raise ValueError("the light field has no rays")
    count = len(rays.weight)
    side = math.isqrt(int(count / (_RAYS * views.width * views.height)))
    side = min(_MOST, max(_FEWEST, side))
    across = views.aperture or 2.0 * float(np.abs(np.asarray(rays.place[:, :2])).max())
    if across == 0.0:
        return replace(field, rays=None), "All of its rays go through one point: there is nothing to focus."

    sums = np.zeros((side * side * views.height * views.width, 4))
    for begin in range(0, count, _CHUNK):
        _add(sums, field, Rays(*(np.asarray(part[begin : begin + _CHUNK]) for part in rays)), side, across)
    sums = sums.reshape(side, side, views.height, views.width, 4)
    radiance = np.empty((*sums.shape[:4], 3))
    for place in np.ndindex(side, side):
        radiance[place] = _filled(sums[place])

    middles = ((np.arange(side) + 0.5) / side - 0.5) * across
    position = np.stack(np.meshgrid(middles, -middles), axis=-1)
    step = across / side
    geometry = replace(views, position=position, cell=(step, step))
    made = LightField(radiance, geometry, settings=field.settings)
    return made, f"Its {count:,} rays are gathered into {side} x {side} views, which blur what is far out of focus."


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


def _filled(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Means of sums (height, width, 4); where there are none, of ever more around."""
    from scipy import ndimage

    total, weight = sums[..., :3], sums[..., 3]
    if not (weight > 0.0).any():
        return np.zeros_like(total)
    found = weight > 0.0
    mean = np.where(found[..., None], total / np.where(found, weight, 1.0)[..., None], 0.0)
    size = 1
    while not found.all():
        size = 2 * size + 1
        around = ndimage.uniform_filter(weight, size, mode="constant")
        value = ndimage.uniform_filter(total, (size, size, 1), mode="constant")
        # Sums of a running mean leave a rounding error behind where there is nothing.
        new = ~found & (ndimage.maximum_filter(weight, size, mode="constant") > 0.0)
        mean[new] = value[new] / around[new, None]
        found |= new
    return mean
