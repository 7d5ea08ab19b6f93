"""Files of differences: PNG with a legend, images side by side, or an HTML page."""

import io

import numpy as np

from raytracer.analysis.compare.difference_image import DifferenceImage, check_kind, compared_images, show
from raytracer.analysis.compare.result import Comparison
from raytracer.analysis.compare.wipe_page import wipe_page
from raytracer.report.colour_maps import Pixels
from raytracer.report.lettering import load_font
from raytracer.report.palette import FAINT, INK, PAPER

_TEXT = 13
_PAD = 8
_LEGEND = 54
_NARROWEST_LEGEND = 240


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
    pictures = _displayed(comparison)
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


def _displayed(comparison: Comparison) -> tuple[Pixels, Pixels]:
    """Convert both images to display values."""
    a, b = compared_images(comparison)
    return a.to_display_bytes(), b.to_display_bytes()


def encode(comparison: Comparison, kind: str) -> bytes:
    """Encode the file of a kind: PNG, or HTML for `wipe`.

    Raises
    ------
    InputError : the kind is not known, or cannot be shown of these images.
    """
    check_kind(kind)
    if kind == "wipe":
        return wipe_page(comparison)
    from PIL import Image

    pixels = side_by_side(comparison) if kind == "side-by-side" else with_legend(show(comparison, kind))
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG")
    return buffer.getvalue()
