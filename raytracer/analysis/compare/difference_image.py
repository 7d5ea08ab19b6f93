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
from typing import NamedTuple

import numpy as np

from raytracer.analysis.compare.compared_image import Array, ComparedImage
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


def compared_images(comparison: Comparison) -> tuple[ComparedImage, ComparedImage]:
    """Return the two images of a comparison.

    Raises
    ------
    InputError : they were released.
    """
    if comparison.pictures is None:
        raise InputError("the pixels of this comparison were released")
    return comparison.pictures


def _values(comparison: Comparison) -> tuple[Array, Array]:
    a, b = compared_images(comparison)
    return a.values, b.values


def _largest_channel(difference: Array) -> Array:
    """Select the channel of each pixel that is largest in size, with its sign: (height, width)."""
    size = np.abs(difference)
    result = difference[..., 0].copy()
    largest = size[..., 0].copy()
    for channel in (1, 2):
        # What is not a number is the largest of all.
        is_larger = (size[..., channel] > largest) | np.isnan(size[..., channel])
        np.copyto(result, difference[..., channel], where=is_larger)
        np.copyto(largest, size[..., channel], where=is_larger)
    return result


def _scale(values: Array) -> float:
    """Choose a scale that all but a few pixels stay below, or the largest value if only those few differ."""
    finite = values[np.isfinite(values)]
    if finite.size == 0:
        return 0.0
    most = float(np.quantile(finite, 1.0 - _BEYOND))
    return most if most > 0.0 else float(finite.max())


def _channel_difference(comparison: Comparison) -> Array:
    a, b = _values(comparison)
    with np.errstate(invalid="ignore", over="ignore"):
        return _largest_channel(a - b)


def _signed(comparison: Comparison) -> DifferenceImage:
    difference = _channel_difference(comparison)
    scale = _scale(np.abs(difference))
    return DifferenceImage(
        signed(difference, scale),
        signed_colours(),
        scale,
        (f"-{scale:.3g}", "0", f"+{scale:.3g}"),
        "A - B in the channel that differs most",
    )


def _absolute(comparison: Comparison) -> DifferenceImage:
    difference = np.abs(_channel_difference(comparison))
    scale = _scale(difference)
    caption = "|A - B| in the channel that differs most"
    return DifferenceImage(false_colour(difference, scale), false_colours(), scale, ("0", f"{scale:.3g}"), caption)


def _relative(comparison: Comparison) -> DifferenceImage:
    a, b = _values(comparison)
    with np.errstate(invalid="ignore", over="ignore"):
        error = np.sqrt(np.mean(error_weights(b, 1.0) * (a - b) ** 2, axis=2))
    scale = _scale(error)
    caption = "root of the relative squared error"
    return DifferenceImage(false_colour(error, scale), false_colours(), scale, ("0", f"{100.0 * scale:.3g} %"), caption)


def _flip(comparison: Comparison) -> DifferenceImage:
    a, b = (np.nan_to_num(values, posinf=0.0, neginf=0.0) for values in _values(comparison))
    values = comparison.flip
    if values is None:
        values = flip_map(a, b, "display" if comparison.is_display else "linear")
    return DifferenceImage(false_colour(values, 1.0), false_colours(), 1.0, ("0", "1"), "FLIP: how different it looks")


def _z(comparison: Comparison) -> DifferenceImage:
    pictures = compared_images(comparison)
    if comparison.verdict is None:
        lacking = [f"{picture.name} {picture.unknown}" for picture in pictures if picture.variance is None]
        raise InputError(
            f"there is no picture of z, since there was no z-test: {[*lacking, 'it was not asked for'][0]}"
        )
    z = _largest_channel(comparison.verdict.pixel_z)
    ends = (f"-{_Z_SCALE:g}", "0", f"+{_Z_SCALE:g}")
    return DifferenceImage(
        signed(z, _Z_SCALE), signed_colours(), _Z_SCALE, ends, "A - B in standard deviations of the noise"
    )


_KINDS: dict[str, Callable[[Comparison], DifferenceImage]] = {
    "signed": _signed,
    "absolute": _absolute,
    "relative": _relative,
    "flip": _flip,
    "z": _z,
}

KINDS = (*_KINDS, "side-by-side", "wipe")
"""All kinds of difference images, the default first."""
