"""Cubic B-splines through all pixels of a view, by which it is sampled between pixels.

They blur least of all kernels that are four pixels wide.

References: Unser, Aldroubi, Eden 1993, "B-Spline Signal Processing"; Thevenaz, Blu, Unser 2000, "Interpolation
    Revisited".
"""

import math

import numpy as np
from numpy.typing import NDArray


class Spline:
    """Spline through the pixels of a picture; beyond its edges the picture is mirrored, and marked as not seen.

    picture : (height, width) or (height, width, channels).

    Attributes
    ----------
    coefficients : of the splines, float64 (channels, height, width).
    shape : height and width.
    """

    def __init__(self, picture: NDArray[np.float64]) -> None:
        from scipy import ndimage

        planes = np.moveaxis(np.atleast_3d(np.asarray(picture, dtype=np.float64)), 2, 0)
        self.is_flat = np.ndim(picture) == 2
        self.shape: tuple[int, int] = (planes.shape[1], planes.shape[2])
        self.coefficients = np.stack([ndimage.spline_filter(plane, order=3, mode="mirror") for plane in planes])

    def shifted(self, right: float, down: float) -> tuple[NDArray[np.float64], tuple[slice, slice]]:
        """Shift the picture: that at (y + down, x + right) comes to (y, x).

        Returns it, of the same shape, and the slices of its rows and columns that are seen (empty for none).
        """
        moved = _along(_along(self.coefficients, right, 2), down, 1)
        return self._formed(moved), seen_part(self.shape, right, down)

    def at(
        self, down: NDArray[np.float64], right: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Sample the picture at places (pixels from the middle of the first one).

        Returns values of the places' shape, with a last axis of channels if the picture has one; True within it.
        """
        from scipy import ndimage

        height, width = self.shape
        places = np.stack([down, right])
        values = np.stack(
            [
                ndimage.map_coordinates(plane, places, order=3, mode="mirror", prefilter=False)
                for plane in self.coefficients
            ]
        )
        # The outer half of a pixel at the edge is within, too.
        is_seen = (down >= -0.5) & (down <= height - 0.5) & (right >= -0.5) & (right <= width - 0.5)
        return self._formed(values), is_seen

    def _formed(self, planes: NDArray[np.float64]) -> NDArray[np.float64]:
        """Bring planes of channels into the shape of the picture."""
        return planes[0] if self.is_flat else np.moveaxis(planes, 0, -1)


def seen_part(shape: tuple[int, int], right: float, down: float) -> tuple[slice, slice]:
    """Return the slices of rows and columns at which a shifted picture of this shape is seen (empty for none)."""
    height, width = shape
    rows = slice(max(0, math.ceil(-down)), max(0, min(height, math.floor(height - 1 - down) + 1)))
    columns = slice(max(0, math.ceil(-right)), max(0, min(width, math.floor(width - 1 - right) + 1)))
    return rows, columns


def spline_weights(part: float) -> tuple[float, float, float, float]:
    """Compute the four values of the cubic B-spline around a place that is `part` of the way between two pixels."""
    return (
        (1.0 - part) ** 3 / 6.0,
        (4.0 - 6.0 * part**2 + 3.0 * part**3) / 6.0,
        (1.0 + 3.0 * part + 3.0 * part**2 - 3.0 * part**3) / 6.0,
        part**3 / 6.0,
    )


def _along(planes: NDArray[np.float64], shift: float, axis: int) -> NDArray[np.float64]:
    """Evaluate a spline of given coefficients at each index plus `shift` along an axis."""
    size = planes.shape[axis]
    whole = math.floor(shift)
    total = np.zeros_like(planes)
    for number, weight in enumerate(spline_weights(shift - whole)):
        if weight != 0.0:
            total += weight * _from(planes, whole - 1 + number, size, axis)
    return total


def _from(planes: NDArray[np.float64], offset: int, size: int, axis: int) -> NDArray[np.float64]:
    """Return the values at each index plus `offset`, mirrored at the first and last one."""
    if offset == 0:
        return planes
    index = np.arange(offset, offset + size)
    # Mirrored at the middles of the outer pixels: the period is 2 (size - 1).
    period = max(1, 2 * (size - 1))
    index = np.abs((index + size - 1) % period - (size - 1)) if size > 1 else np.zeros_like(index)
    return planes.take(index, axis=axis)


def sqrt_tone(radiance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Take square roots of linear values, negative ones as 0, which makes photon noise about equal for all."""
    return np.sqrt(np.maximum(radiance, 0.0))
