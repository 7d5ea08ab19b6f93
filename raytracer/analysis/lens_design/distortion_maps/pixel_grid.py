"""Pixels of the film: their number, size and places."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# Points along each side of the film at which models are fitted.
_FITTED = 41


class PixelGrid(NamedTuple):
    """Grid of the film's pixels, whose integer coordinates are their middles, as OpenCV's.

    width, height : number of pixels.
    pitch : edge of a pixel (mm).
    """

    width: int
    height: int
    pitch: float

    @property
    def centre(self) -> tuple[float, float]:
        """The middle of the picture (pixels)."""
        return 0.5 * (self.width - 1), 0.5 * (self.height - 1)

    def points(self, first: int = 0, last: int | None = None) -> FloatArray:
        """Return the middles of all pixels (mm), (height, width, 2), or of the rows from `first` to before `last`."""
        cx, cy = self.centre
        rows = np.arange(first, self.height if last is None else min(last, self.height))
        x, y = np.meshgrid(np.arange(self.width) - cx, rows - cy)
        return self.pitch * np.stack([x, y], axis=-1)

    def pixels(self, points: FloatArray) -> FloatArray:
        """Convert points of the film (mm) to pixels."""
        return np.asarray(points / self.pitch + np.array(self.centre))


def fitted_points(grid: PixelGrid) -> FloatArray:
    """Spread points evenly over the film up to its corners (mm), (n, 2)."""
    half = 0.5 * grid.pitch * np.array([grid.width, grid.height])
    x, y = np.meshgrid(*(np.linspace(-h, h, _FITTED) for h in half))
    return np.stack([x.ravel(), y.ravel()], axis=-1)
