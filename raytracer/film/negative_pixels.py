"""Pixels below zero: how many a picture has, and what of its scene may make them.

Light is never negative, and yet a pixel's value may be, by three things that a scene asks for: a reconstruction filter
with negative lobes, which rings beside bright edges; colours of single wavelengths, which lie outside of Rec. 709; and
the read noise of a simulated sensor, which is as often below black as above it.  Nothing else may make one.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

FILTER, SPECTRAL, READ_NOISE = "filter", "spectral", "read_noise"
"""What may bring pixels below zero."""

_WORDS = {
    FILTER: "the negative lobes of the filter",
    SPECTRAL: "colours of single wavelengths",
    READ_NOISE: "the read noise of the sensor",
}
_UNEXPLAINED = "for which nothing in the scene is a reason: please report it"


def causes_of(*, has_negative_lobes: bool, is_spectral: bool, has_read_noise: bool) -> tuple[str, ...]:
    """List what may bring pixels of a picture below zero.

    A simulated sensor catches no less than no light, so behind one only its read noise counts.

    Parameters
    ----------
    has_negative_lobes : whether the filter's weights may be negative.
    is_spectral : whether light of single wavelengths becomes red, green and blue.
    has_read_noise : whether a sensor is simulated.
    """
    if has_read_noise:
        return (READ_NOISE,)
    found = ((FILTER, has_negative_lobes), (SPECTRAL, is_spectral))
    return tuple(cause for cause, is_there in found if is_there)


def find_negatives(
    values: NDArray[Any], causes: Sequence[str], left: int = 0, top: int = 0
) -> tuple[int, dict[str, Any]]:
    """Count the pixels of a picture that have a channel below zero, and find the lowest.

    Parameters
    ----------
    values : (height, width, 3), as linear files hold them.
    causes : what may have made them.
    left, top : the place of the first pixel in the whole picture.

    Returns
    -------
    How many there are; and the `lowest` value of any channel, the `pixel` (x, y) that has it, and the `causes`, empty
    if there are none.
    """
    # Most pictures have none, and one pass tells.
    lowest = float(np.fmin.reduce(values, axis=None))
    if not lowest < 0.0:
        return 0, {}
    row, column, _ = (int(place) for place in np.argwhere(values == lowest)[0])
    found = {"lowest": lowest, "pixel": [left + column, top + row], "causes": list(causes)}
    return int((values < 0.0).any(axis=2).sum()), found


def describe_negatives(pixels: int, found: Mapping[str, Any]) -> str:
    """Say how many pixels are below zero, how far, and by what: "3 pixels below zero, to -0.1, by ..."."""
    count = "1 pixel" if pixels == 1 else f"{pixels} pixels"
    causes = " and ".join(_WORDS[cause] for cause in found["causes"])
    return f"{count} below zero, to {found['lowest']:.3g}, {f'by {causes}' if causes else _UNEXPLAINED}"
