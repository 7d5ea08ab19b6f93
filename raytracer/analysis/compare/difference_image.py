"""Files that show how two images differ.

| kind | shows |
|---|---|
| signed | the difference of the channel that differs most: red where A is brighter, blue where B is |
| absolute | its size, in false colours |
| relative | its size relative to B: the root of the pixel's relMSE, in false colours |
| flip | what is seen of it, as FLIP tells, in false colours |
| z | the difference in standard deviations of the noise, in red and blue |
| side-by-side | A, B, and the size of the difference |
| wipe | a page: both images with a divider, their difference, and a slider of exposure |

A picture of a kind has a legend below, so that its pixels are where the images have theirs.
"""

import io
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from raytracer.comparison.metrics import flip_map
from raytracer.comparison.pictures import Pixels, false_colour, false_colours, signed, signed_colours
from raytracer.comparison.reading import Array, Picture
from raytracer.comparison.result import Comparison
from raytracer.errors import InputError, nearest
from raytracer.noise.metric import weights

if TYPE_CHECKING:
    from PIL import ImageFont

# Part of the pixels that reach the ends of the scale of colours.
_BEYOND = 0.01

# Standard deviations at the ends of the scale.
_Z_SCALE = 5.0

_PAPER, _INK, _FAINT = (255, 255, 255), (20, 20, 20), (110, 110, 110)
_TEXT = 13
_PAD = 8
_LEGEND = 54
_NARROWEST_LEGEND = 240


class Shown(NamedTuple):
    """A picture of a difference, with what its colours mean.

    pixels, uint8 (height, width, 3); colours, uint8 (n, 3), of its scale; scale, the value at its upper end; ends,
    texts along it; caption.
    """

    pixels: Pixels
    colours: Pixels
    scale: float
    ends: tuple[str, ...]
    caption: str


def show(comparison: Comparison, kind: str) -> Shown:
    """The picture of a kind, without its legend.

    Raises
    ------
    InputError : the kind is not known, or cannot be shown of these images.
    """
    check_kind(kind)
    return _KINDS[kind](comparison)


def check_kind(kind: str) -> None:
    """Refuse a kind of picture that is not known.

    Raises
    ------
    InputError : it is not.
    """
    if kind not in KINDS:
        near = nearest(kind, KINDS)
        raise InputError(
            f"unknown kind of picture {kind!r}: "
            + (f"did you mean {near!r}?" if near else f"known: {', '.join(KINDS)}")
        )


def _pictures(comparison: Comparison) -> tuple[Picture, Picture]:
    if comparison.pictures is None:
        raise InputError("the pixels of this comparison were let go of")
    return comparison.pictures


def _values(comparison: Comparison) -> tuple[Array, Array]:
    a, b = _pictures(comparison)
    return a.values, b.values


def _largest(difference: Array) -> Array:
    """Of each pixel the value of the channel in which it is largest, with its sign: (height, width)."""
    size = np.abs(difference)
    found = difference[..., 0].copy()
    largest = size[..., 0].copy()
    for channel in (1, 2):
        # What is not a number is the largest of all.
        is_larger = (size[..., channel] > largest) | np.isnan(size[..., channel])
        np.copyto(found, difference[..., channel], where=is_larger)
        np.copyto(largest, size[..., channel], where=is_larger)
    return found


def _scale(values: Array) -> float:
    """What all but a few pixels stay below, or the largest of all where only those few differ."""
    finite = values[np.isfinite(values)]
    if finite.size == 0:
        return 0.0
    most = float(np.quantile(finite, 1.0 - _BEYOND))
    return most if most > 0.0 else float(finite.max())


def _raw(comparison: Comparison) -> Array:
    a, b = _values(comparison)
    with np.errstate(invalid="ignore", over="ignore"):
        return _largest(a - b)


def _signed(comparison: Comparison) -> Shown:
    found = _raw(comparison)
    scale = _scale(np.abs(found))
    return Shown(
        signed(found, scale),
        signed_colours(),
        scale,
        (f"-{scale:.3g}", "0", f"+{scale:.3g}"),
        "A - B in the channel that differs most",
    )


def _absolute(comparison: Comparison) -> Shown:
    found = np.abs(_raw(comparison))
    scale = _scale(found)
    caption = "|A - B| in the channel that differs most"
    return Shown(false_colour(found, scale), false_colours(), scale, ("0", f"{scale:.3g}"), caption)


def _relative(comparison: Comparison) -> Shown:
    a, b = _values(comparison)
    with np.errstate(invalid="ignore", over="ignore"):
        found = np.sqrt(np.mean(weights(b, 1.0) * (a - b) ** 2, axis=2))
    scale = _scale(found)
    caption = "root of the relative squared error"
    return Shown(false_colour(found, scale), false_colours(), scale, ("0", f"{100.0 * scale:.3g} %"), caption)


def _flip(comparison: Comparison) -> Shown:
    a, b = (np.nan_to_num(values, posinf=0.0, neginf=0.0) for values in _values(comparison))
    found = comparison.flip
    if found is None:
        found = flip_map(a, b, "display" if comparison.is_display else "linear")
    return Shown(false_colour(found, 1.0), false_colours(), 1.0, ("0", "1"), "FLIP: how different it looks")


def _z(comparison: Comparison) -> Shown:
    pictures = _pictures(comparison)
    if comparison.verdict is None:
        lacking = [f"{picture.name} {picture.unknown}" for picture in pictures if picture.variance is None]
        raise InputError(
            f"there is no picture of z, since there was no z-test: {[*lacking, 'it was not asked for'][0]}"
        )
    found = _largest(comparison.verdict.pixel_z)
    ends = (f"-{_Z_SCALE:g}", "0", f"+{_Z_SCALE:g}")
    return Shown(signed(found, _Z_SCALE), signed_colours(), _Z_SCALE, ends, "A - B in standard deviations of the noise")


_KINDS: dict[str, Callable[[Comparison], Shown]] = {
    "signed": _signed,
    "absolute": _absolute,
    "relative": _relative,
    "flip": _flip,
    "z": _z,
}

KINDS = (*_KINDS, "side-by-side", "wipe")
"""All kinds of pictures, the first of which is the usual one."""


# ---- files ----


def with_legend(shown: Shown) -> Pixels:
    """A picture with its scale of colours below it, no narrower than that takes."""
    from PIL import Image, ImageDraw

    height, width, _ = shown.pixels.shape
    sheet = Image.new("RGB", (max(width, _NARROWEST_LEGEND), height + _LEGEND), _PAPER)
    sheet.paste(Image.fromarray(shown.pixels), (0, 0))
    bar_width = min(sheet.width - 2 * _PAD, 360)
    bar = Image.fromarray(np.ascontiguousarray(shown.colours[None, :, :])).resize(
        (bar_width, 10), Image.Resampling.NEAREST
    )
    sheet.paste(bar, (_PAD, height + 6))
    draw = ImageDraw.Draw(sheet)
    draw.rectangle((_PAD - 1, height + 5, _PAD + bar_width, height + 16), outline=_FAINT)
    anchors = ("la", "ra") if len(shown.ends) == 2 else ("la", "ma", "ra")
    for number, (text, anchor) in enumerate(zip(shown.ends, anchors, strict=True)):
        place = _PAD + bar_width * number / (len(shown.ends) - 1)
        draw.text((place, height + 18), text, fill=_INK, font=_font(), anchor=anchor)
    draw.text((_PAD, height + 35), shown.caption, fill=_FAINT, font=_font(), anchor="la")
    return np.asarray(sheet)


def _font() -> "ImageFont.FreeTypeFont | ImageFont.ImageFont":
    from PIL import ImageFont

    return ImageFont.load_default(_TEXT)


def side_by_side(comparison: Comparison) -> Pixels:
    """A, B and the size of their difference beside each other, each under its name."""
    from PIL import Image, ImageDraw

    shown = _absolute(comparison)
    pictures = _displayed(comparison)
    right = with_legend(shown)
    width = comparison.width
    heading = _TEXT + 2 * _PAD
    size = (2 * (width + _PAD) + max(width, right.shape[1]), heading + right.shape[0])
    sheet = Image.new("RGB", size, _PAPER)
    draw = ImageDraw.Draw(sheet)
    for number, (name, pixels) in enumerate(zip((*comparison.labels, "difference"), (*pictures, right), strict=True)):
        x = number * (width + _PAD)
        draw.text((x + 2, _PAD), _fitted(name, width), fill=_INK, font=_font(), anchor="la")
        sheet.paste(Image.fromarray(pixels), (x, heading))
    return np.asarray(sheet)


def _fitted(text: str, width: int) -> str:
    """The beginning and end of a name that fits into so many pixels."""
    font = _font()
    if font.getlength(text) <= width:
        return text
    for kept in range(len(text) - 1, 4, -1):
        short = f"{text[: (kept + 1) // 2]}...{text[len(text) - kept // 2 :]}"
        if font.getlength(short) <= width:
            return short
    return text[:1]


def _displayed(comparison: Comparison) -> tuple[Pixels, Pixels]:
    """Both images as a display shows them."""
    a, b = _pictures(comparison)
    return a.in_bytes(), b.in_bytes()


def encode(comparison: Comparison, kind: str) -> bytes:
    """The file of a kind: PNG, or HTML for `wipe`.

    Raises
    ------
    InputError : the kind is not known, or cannot be shown of these images.
    """
    check_kind(kind)
    if kind == "wipe":
        from raytracer.comparison.wipe import wipe_page

        return wipe_page(comparison)
    from PIL import Image

    pixels = side_by_side(comparison) if kind == "side-by-side" else with_legend(show(comparison, kind))
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG")
    return buffer.getvalue()
