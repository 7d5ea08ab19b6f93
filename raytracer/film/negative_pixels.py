"""Negative pixels: their number in a picture, and their possible causes in its scene.

Light is never negative, but a pixel's value may be, for three reasons that a scene may have: a reconstruction filter
with negative lobes, which rings beside bright edges; colours of single wavelengths, which lie outside of Rec. 709; and
the read noise of a simulated sensor, which is as often below black as above it.  There is no other reason.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.report.wording import count

FILTER, SPECTRAL, READ_NOISE = "filter", "spectral", "read_noise"
"""Causes of negative pixels."""

_WORDS = {
    FILTER: "the negative lobes of the filter",
    SPECTRAL: "colours of single wavelengths",
    READ_NOISE: "the read noise of the sensor",
}
_UNEXPLAINED = "for which nothing in the scene is a reason: please report it"


def find_negative_causes(*, has_negative_lobes: bool, is_spectral: bool, has_read_noise: bool) -> tuple[str, ...]:
    """List the possible causes of negative pixels in a picture.

    A simulated sensor records no negative light, so its read noise is then the only cause.
    """
    if has_read_noise:
        return (READ_NOISE,)
    causes = ((FILTER, has_negative_lobes), (SPECTRAL, is_spectral))
    return tuple(cause for cause, is_present in causes if is_present)


def find_negative_pixels(
    values: NDArray[Any], causes: Sequence[str], left: int = 0, top: int = 0
) -> tuple[int, dict[str, Any]]:
    """Count the pixels of a picture that have a negative channel, and find the lowest.

    values : (height, width, 3), as linear files hold them.
    causes : possible ones, see `find_negative_causes`.
    left, top (px) : place of the first pixel in the whole picture.

    Returns their number; and the `lowest` value of any channel, the `pixel` (x, y) that has it, and the `causes`, empty
    if there are none.
    """
    # Most pictures have none, and one pass tells.
    lowest = float(np.fmin.reduce(values, axis=None))
    if not lowest < 0.0:
        return 0, {}
    row, column, _ = (int(place) for place in np.argwhere(values == lowest)[0])
    details = {"lowest": lowest, "pixel": [left + column, top + row], "causes": list(causes)}
    return int((values < 0.0).any(axis=2).sum()), details


def describe_negative_pixels(pixels: int, details: Mapping[str, Any]) -> str:
    """Describe negative pixels in a message: "3 pixels below zero, to -0.1, by ..."."""
    causes = " and ".join(_WORDS[cause] for cause in details["causes"])
    return (
        f"{count(pixels, 'pixel')} below zero, to {details['lowest']:.3g}, {f'by {causes}' if causes else _UNEXPLAINED}"
    )
