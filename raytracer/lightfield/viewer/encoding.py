"""Encoding of the views' light in 8 bits: sRGB up to white, and logarithms of what is brighter."""

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.film import srgb

_SHARE = 0.8
"""Share of the 8-bit codes that holds light up to white, where some is brighter."""

_PEAK = 1024.0
"""Brighter light is clipped to this multiple of white."""

_DARK, _BRIGHT = 1 / 8, 4.0
"""A picture whose 99th percentile is below the one, or whose median is above the other, starts with an exposure."""

_EV_STEP = 0.25


class Encoding(NamedTuple):
    """Encoding of light in 8 bits.

    unit : light of white, in the light field's numbers.
    share : of the codes that holds light up to white.
    peak : brightest light, in units of white.
    """

    unit: float
    share: float
    peak: float

    def __call__(self, light: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Encode linear light."""
        relative = np.clip(np.nan_to_num(light / self.unit, nan=0.0, posinf=self.peak), 0.0, self.peak)
        codes = self.share * srgb.encode(relative)
        if self.peak > 1.0:
            beyond = np.log(np.maximum(relative, 1.0)) / math.log(self.peak)
            codes = np.where(relative > 1.0, self.share + (1.0 - self.share) * beyond, codes)
        return np.rint(255.0 * codes).astype(np.uint8)


def choose_encoding(views: Iterable[NDArray[np.float64]], count: int, exposure: float | None) -> tuple[Encoding, float]:
    """Choose the encoding of `count` views, and the exposure (EV) with which they are first shown, unless given."""
    peak, samples = 0.0, []
    for view in views:
        finite = view[np.isfinite(view)]
        peak = max(peak, float(finite.max(initial=0.0)))
        # As many pixels from all views together as one has.
        samples.append(view.mean(axis=-1).ravel()[::count])
    grey = np.concatenate(samples)
    grey = grey[np.isfinite(grey)]
    if exposure is None:
        exposure = _initial_exposure(grey, peak)
    white = 2.0**-exposure
    if peak <= white:
        return Encoding(white, 1.0, 1.0), exposure
    return Encoding(white, _SHARE, min(_PEAK, peak / white)), exposure


def _initial_exposure(grey: NDArray[np.float64], peak: float) -> float:
    """Choose an exposure (EV) for the display: 0 where the picture is within its range."""
    if peak <= 0.0 or grey.size == 0:
        return 0.0
    bright = float(np.percentile(grey, 99.0)) or peak
    if bright >= _DARK and float(np.median(grey)) <= _BRIGHT:
        return 0.0
    return _EV_STEP * round(-math.log2(bright) / _EV_STEP)
