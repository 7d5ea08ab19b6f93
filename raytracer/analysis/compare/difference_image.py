"""Images of the difference of two images.

| kind | shows |
|---|---|
| signed | the difference of the channel that differs most: red where A is brighter, blue where B is |
| absolute | its size, in false colours |
| relative | its size relative to B: the root of the pixel's relMSE, in false colours |
| flip | its visibility according to FLIP, in false colours |
| z | the difference in standard deviations of the noise, in red and blue |
| side-by-side | A, B, and the size of the difference |
| wipe | a page: both images with a divider, their difference, and a slider of exposure |

Files have a legend below the image, so that its pixels are where the compared images have theirs.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.analysis.compare.compared_image import Array
from raytracer.analysis.compare.metrics import flip_map
from raytracer.analysis.compare.result import Comparison
from raytracer.core.error_estimate.metric import error_weights
from raytracer.report.colour_maps import Pixels, false_colour, false_colours, signed, signed_colours
from raytracer.util.errors import InputError, closest_name

# Part of the pixels beyond the ends of the scale of colours.
_BEYOND = 0.01

# Standard deviations at the ends of the scale.
_Z_SCALE = 5.0


class DifferenceImage(NamedTuple):
    """An image of a difference, with its legend.

    pixels : uint8 (height, width, 3).
    colours : uint8 (n, 3), of its scale.
    scale : the value at the upper end of the scale.
    ends : labels along the scale.
    caption : what is shown.
    """

    pixels: Pixels
    colours: Pixels
    scale: float
    ends: tuple[str, ...]
    caption: str


def show(comparison: Comparison, kind: str) -> DifferenceImage:
    """Draw the difference image of a kind, without its legend.

    Raises
    ------
    InputError : the kind is not known, or cannot be shown of these images.
    """
    check_kind(kind)
    return _KINDS[kind](comparison)


def check_kind(kind: str) -> None:
    """Check the name of a kind of difference image.

    Raises
    ------
    InputError : it is not.
    """
    if kind not in KINDS:
        near = closest_name(kind, KINDS)
        raise InputError(
            f"unknown kind of picture {kind!r}: "
            + (f"did you mean {near!r}?" if near else f"known: {', '.join(KINDS)}")
        )


def largest_channel(difference: Array) -> Array:
    """Return the channel that is farthest from 0, of (..., 3): (...); what is not a number is the farthest of all."""
    return np.take_along_axis(difference, np.argmax(np.abs(difference), axis=-1)[..., None], axis=-1)[..., 0]


def colour_scale(values: Array) -> float:
    """Choose a scale that all but a few pixels stay below, or the largest value if only those few differ."""
    finite = values[np.isfinite(values)]
    if finite.size == 0:
        return 0.0
    most = float(np.quantile(finite, 1.0 - _BEYOND))
    return most if most > 0.0 else float(finite.max())


def _in_two_colours(values: Array, scale: float, ends: tuple[str, ...], caption: str) -> DifferenceImage:
    return DifferenceImage(signed(values, scale), signed_colours(), scale, ends, caption)


def _in_false_colours(values: NDArray[Any], scale: float, end: str, caption: str) -> DifferenceImage:
    return DifferenceImage(false_colour(values, scale), false_colours(), scale, ("0", end), caption)


def _channel_difference(comparison: Comparison) -> Array:
    a, b = comparison.images()
    with np.errstate(invalid="ignore", over="ignore"):
        return largest_channel(a.values - b.values)


def _signed(comparison: Comparison) -> DifferenceImage:
    difference = _channel_difference(comparison)
    scale = colour_scale(np.abs(difference))
    ends = (f"-{scale:.3g}", "0", f"+{scale:.3g}")
    return _in_two_colours(difference, scale, ends, "A - B in the channel that differs most")


def _absolute(comparison: Comparison) -> DifferenceImage:
    difference = np.abs(_channel_difference(comparison))
    scale = colour_scale(difference)
    return _in_false_colours(difference, scale, f"{scale:.3g}", "|A - B| in the channel that differs most")


def _relative(comparison: Comparison) -> DifferenceImage:
    a, b = (image.values for image in comparison.images())
    with np.errstate(invalid="ignore", over="ignore"):
        error = np.sqrt(np.mean(error_weights(b, 1.0) * (a - b) ** 2, axis=2))
    scale = colour_scale(error)
    return _in_false_colours(error, scale, f"{100.0 * scale:.3g} %", "root of the relative squared error")


def _flip(comparison: Comparison) -> DifferenceImage:
    values = comparison.flip
    if values is None:
        a, b = (np.nan_to_num(image.values, posinf=0.0, neginf=0.0) for image in comparison.images())
        values = flip_map(a, b, "display" if comparison.is_display else "linear")
    return _in_false_colours(values, 1.0, "1", "FLIP: how different it looks")


def _z(comparison: Comparison) -> DifferenceImage:
    if comparison.verdict is None:
        lacking = [f"{image.name} {image.unknown}" for image in comparison.images() if image.variance is None]
        raise InputError(
            f"there is no picture of z, since there was no z-test: {[*lacking, 'it was not asked for'][0]}"
        )
    ends = (f"-{_Z_SCALE:g}", "0", f"+{_Z_SCALE:g}")
    z = largest_channel(comparison.verdict.pixel_z)
    return _in_two_colours(z, _Z_SCALE, ends, "A - B in standard deviations of the noise")


_KINDS: dict[str, Callable[[Comparison], DifferenceImage]] = {
    "signed": _signed,
    "absolute": _absolute,
    "relative": _relative,
    "flip": _flip,
    "z": _z,
}

KINDS = (*_KINDS, "side-by-side", "wipe")
"""All kinds of difference images, the default first."""
