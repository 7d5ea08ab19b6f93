"""The guided filter: an edge-preserving average.

References: He, Sun, Tang 2010, "Guided Image Filtering"; Hosni et al. 2013, "Fast Cost-Volume Filtering for Visual
Correspondence and Beyond".
"""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

_REGULARIZATION = 0.02
"""Squared contrast from which on an edge is kept, as a share of the picture's variance."""

_RADIUS = 1
"""Radius of the filter's boxes, in pixels."""


class GuidedFilter:
    """Guided filter with one picture as its guide: it averages within regions that look alike there."""

    def __init__(self, guide: FloatArray) -> None:
        self._guide = guide
        self._mean = self._box(guide)
        self._variance = np.maximum(self._box(guide * guide) - self._mean**2, 0.0)
        # Above 0, however flat the picture is.
        self._regularization = max(_REGULARIZATION * float(guide.var()), np.finfo(np.float64).tiny)

    def __call__(self, picture: FloatArray) -> FloatArray:
        """Filter a picture (height, width)."""
        mean = self._box(picture)
        slope = (self._box(self._guide * picture) - self._mean * mean) / (self._variance + self._regularization)
        return np.asarray(self._box(slope) * self._guide + self._box(mean - slope * self._mean))

    def _box(self, picture: FloatArray) -> FloatArray:
        """Average over boxes around each pixel."""
        from scipy import ndimage

        return np.asarray(ndimage.uniform_filter(picture, 2 * _RADIUS + 1, mode="nearest"))
