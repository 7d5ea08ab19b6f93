"""Bilinear sampling of pictures behind microlenses, within the sub-images of which pixels are part."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

_SAME = 0.5
"""Distance (px) below which middles of sub-images are the same."""


def sample_bilinear(
    picture: NDArray[Any], weight: FloatArray | None, place: FloatArray, of: tuple[FloatArray, FloatArray] | None
) -> tuple[FloatArray, FloatArray]:
    """Sample values times weights, and weights, at places of a picture (..., 2), bilinearly between its pixels.

    of : middles of the sub-images that pixels belong to (height, width, 2), and of those that are sampled (..., 2): the
        pixels of others do not count.
    """
    height, width = picture.shape[:2]
    x, y = place[..., 0] - 0.5, place[..., 1] - 0.5
    left, top = np.floor(x).astype(np.intp), np.floor(y).astype(np.intp)
    total, counted = np.zeros((*x.shape, picture.shape[2])), np.zeros(x.shape)
    for column, part_x in ((left, left + 1.0 - x), (left + 1, x - left)):
        for row, part_y in ((top, top + 1.0 - y), (top + 1, y - top)):
            inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
            i, j = np.where(inside, row, 0), np.where(inside, column, 0)
            if of is not None:
                inside &= (np.abs(of[0][i, j] - of[1]) < _SAME).all(axis=-1)
            share = np.where(inside, part_x * part_y, 0.0) * (1.0 if weight is None else weight[i, j])
            total += share[..., None] * picture[i, j]
            counted += share
    return total, counted
