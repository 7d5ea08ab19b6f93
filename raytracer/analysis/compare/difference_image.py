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

The script of a page has the values themselves, so that the exposure and the scale of the difference can be moved.
Linear light is sent in 12 bits: numbers of half precision (IEEE 754) with 7 bits of mantissa in place of 10, which
differ by 0.4 % at most, less than what a display tells apart.  Their upper and lower bytes are two pictures, one below
the other, in one PNG.
"""

import io
import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.analysis.compare.compared_image import Array, ComparedImage
from raytracer.analysis.compare.metrics import METRICS, flip_map
from raytracer.analysis.compare.result import Comparison
from raytracer.analysis.compare.z_test import TEST_LABELS, TESTS
from raytracer.core.error_estimate.metric import error_weights
from raytracer.report import page as html
from raytracer.report.colour_maps import Pixels, false_colour, false_colours, signed, signed_colours
from raytracer.report.lettering import load_font
from raytracer.report.palette import FAINT, INK, PAPER
from raytracer.util.errors import InputError, closest_name

# Part of the pixels beyond the ends of the scale of colours.
_BEYOND = 0.01

# Standard deviations at the ends of the scale.
_Z_SCALE = 5.0

# Size of letters, and margins, below and above pictures (px).
_TEXT, _PAD = 13, 8
_LEGEND = 54
_NARROWEST_LEGEND = 240

_MANTISSA_DROPPED = 3

# Pixels above which images are sent as display values, without a slider of exposure: some browsers take no larger
# canvas.
_LARGEST_LINEAR = 2**22


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


# ---- Files


def encode(comparison: Comparison, kind: str) -> bytes:
    """Encode the file of a kind: PNG, or HTML for `wipe`.

    Raises
    ------
    InputError : the kind is not known, or cannot be shown of these images.
    """
    if kind == "wipe":
        views, title = WipePage(), f"{comparison.a} against {comparison.b}"
        views.add(comparison, title)
        return views.page(title)
    from PIL import Image

    pixels = side_by_side(comparison) if kind == "side-by-side" else with_legend(show(comparison, kind))
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG")
    return buffer.getvalue()


def with_legend(difference: DifferenceImage) -> Pixels:
    """Add a legend below an image, which is made as wide as that takes."""
    from PIL import Image, ImageDraw

    height, width, _ = difference.pixels.shape
    sheet = Image.new("RGB", (max(width, _NARROWEST_LEGEND), height + _LEGEND), PAPER)
    sheet.paste(Image.fromarray(difference.pixels), (0, 0))
    bar_width = min(sheet.width - 2 * _PAD, 360)
    bar = Image.fromarray(np.ascontiguousarray(difference.colours[None, :, :])).resize(
        (bar_width, 10), Image.Resampling.NEAREST
    )
    sheet.paste(bar, (_PAD, height + 6))
    draw = ImageDraw.Draw(sheet)
    draw.rectangle((_PAD - 1, height + 5, _PAD + bar_width, height + 16), outline=FAINT)
    anchors = ("la", "ra") if len(difference.ends) == 2 else ("la", "ma", "ra")
    for number, (text, anchor) in enumerate(zip(difference.ends, anchors, strict=True)):
        place = _PAD + bar_width * number / (len(difference.ends) - 1)
        draw.text((place, height + 18), text, fill=INK, font=load_font(_TEXT), anchor=anchor)
    draw.text((_PAD, height + 35), difference.caption, fill=FAINT, font=load_font(_TEXT), anchor="la")
    return np.asarray(sheet)


def side_by_side(comparison: Comparison) -> Pixels:
    """Draw A, B and the size of their difference beside each other, each under its name."""
    from PIL import Image, ImageDraw

    difference = show(comparison, "absolute")
    pictures = (picture.to_display_bytes() for picture in comparison.images())
    right = with_legend(difference)
    width = comparison.width
    heading = _TEXT + 2 * _PAD
    size = (2 * (width + _PAD) + max(width, right.shape[1]), heading + right.shape[0])
    sheet = Image.new("RGB", size, PAPER)
    draw = ImageDraw.Draw(sheet)
    for number, (name, pixels) in enumerate(zip((*comparison.labels, "difference"), (*pictures, right), strict=True)):
        x = number * (width + _PAD)
        draw.text((x + 2, _PAD), _shorten_name(name, width), fill=INK, font=load_font(_TEXT), anchor="la")
        sheet.paste(Image.fromarray(pixels), (x, heading))
    return np.asarray(sheet)


def _shorten_name(text: str, width: int) -> str:
    """Shorten a name to its beginning and end, to fit into so many pixels."""
    font = load_font(_TEXT)
    if font.getlength(text) <= width:
        return text
    for kept in range(len(text) - 1, 4, -1):
        short = f"{text[: (kept + 1) // 2]}...{text[len(text) - kept // 2 :]}"
        if font.getlength(short) <= width:
            return short
    return text[:1]


# ---- Pages


class WipePage:
    """A page under construction, which holds only the encoded data of its pairs."""

    def __init__(self) -> None:
        self._pairs: list[dict[str, Any]] = []

    def add(self, comparison: Comparison, name: str) -> None:
        """Add a pair.

        Raises
        ------
        InputError : the pixels of the comparison were released.
        """
        pictures = comparison.images()
        is_linear = not comparison.is_display and comparison.width * comparison.height <= _LARGEST_LINEAR

        def encoded(picture: ComparedImage) -> str:
            return html.png(pack_halves(picture.values) if is_linear else picture.to_display_bytes())

        with ThreadPoolExecutor() as threads:
            images = list(threads.map(encoded, pictures))
        maps = {"flip": comparison.flip, "z": comparison.verdict}
        self._pairs.append(
            {
                "name": name,
                "linear": is_linear,
                "images": images,
                "labels": comparison.labels,
                "scale": _scale(comparison, is_linear),
                "maps": {kind: _map(comparison, kind) for kind, known in maps.items() if known is not None},
                "metrics": [
                    {"label": METRICS[key].label, "value": value, "domain": comparison.domains[key], "key": key}
                    for key, value in comparison.metrics.items()
                ],
                "unmeasured": [
                    {"label": METRICS[key].label, "reason": reason} for key, reason in comparison.unmeasured.items()
                ],
                "test": comparison.verdict_text(),
                "notes": [*comparison.other_findings(), *comparison.notes],
                "tests": _list_tests(comparison),
                "passed": comparison.passed,
                "failures": comparison.failures,
            }
        )

    def page(self, title: str) -> bytes:
        """Make the file that shows all pairs."""
        data = {
            "title": title,
            "pairs": self._pairs,
            "colours": {"signed": signed_colours().ravel(), "size": false_colours().ravel()},
        }
        return html.page("compare", title, data, parts=("wipe",))


def _list_tests(comparison: Comparison) -> list[dict[str, Any]]:
    """List the parts of the z-test for the page: label, p, and True for failed."""
    verdict = comparison.verdict
    if verdict is None:
        return []
    limit = comparison.alpha / TESTS
    return [{"label": TEST_LABELS[name], "p": p, "failed": not p >= limit} for name, p in verdict.p_values().items()]


def pack_halves(values: Array) -> NDArray[np.uint8]:
    """Pack values (height, width, 3) as upper bytes above lower bytes of halves: uint8 (2 height, width, 3)."""
    largest = float(np.finfo(np.float16).max)
    bits = np.clip(values, -largest, largest).astype(np.float16).view(np.uint16).astype(np.uint32)
    step = 1 << _MANTISSA_DROPPED
    rounded = (bits + step // 2) & ~np.uint32(step - 1)
    # The largest would round up to infinity.
    infinite = (rounded & 0x7C00) == 0x7C00
    rounded = np.where(infinite & ~np.isnan(values), bits & ~np.uint32(step - 1), rounded)
    return np.concatenate([rounded >> 8, rounded & 255]).astype(np.uint8)


def _scale(comparison: Comparison, is_linear: bool) -> dict[str, float]:
    """Choose the initial scales of differences, in the unit of the page's values."""
    if is_linear or comparison.is_display:
        scales = {kind: show(comparison, kind).scale for kind in ("absolute", "relative")}
    else:
        a, b = (picture.to_display_bytes() / 255.0 for picture in comparison.images())
        most = float(np.abs(a - b).max())
        scales = {"absolute": most, "relative": most}
    return {kind: scale if math.isfinite(scale) and scale > 0.0 else 1.0 for kind, scale in scales.items()}


def _map(comparison: Comparison, kind: str) -> dict[str, Any]:
    """Encode a difference image that the page cannot compute itself."""
    difference = show(comparison, kind)
    return {"image": html.png(difference.pixels), "ends": difference.ends, "caption": difference.caption}
