"""Colour map of depth: near points bright, far ones dark.

References: Smith and van der Walt 2015, the colour map viridis, here through nine of its colours.
"""

import numpy as np
from numpy.typing import NDArray

_VIRIDIS = (
    (68, 1, 84),
    (71, 44, 122),
    (59, 81, 139),
    (44, 113, 142),
    (33, 144, 141),
    (39, 173, 129),
    (92, 200, 99),
    (170, 220, 50),
    (253, 231, 37),
)
_UNKNOWN = 128


def apply_colormap(values: NDArray[np.float64], low: float, high: float) -> NDArray[np.uint8]:
    """Map values (height, width) to colours, from dark at `low` to bright at `high`: uint8 (height, width, 3), sRGB.

    Values that are not finite are grey.
    """
    width = high - low if high > low else 1.0
    is_known = np.isfinite(values)
    place = np.clip((np.where(is_known, values, low) - low) / width, 0.0, 1.0) * (len(_VIRIDIS) - 1)
    channels = [np.interp(place, np.arange(len(_VIRIDIS)), channel) for channel in zip(*_VIRIDIS, strict=True)]
    return np.where(is_known[..., None], np.rint(np.stack(channels, axis=-1)), _UNKNOWN).astype(np.uint8)
