"""Files of differences: PNG with a legend, images side by side, or an HTML page to wipe between pairs of images.

The script of the page has the values themselves, so that the exposure and the scale of the difference can be moved.
Linear light is sent in 12 bits: numbers of half precision (IEEE 754) with 7 bits of mantissa in place of 10, which
differ by 0.4 % at most, less than what a display tells apart.  Their upper and lower bytes are two pictures, one below
the other, in one PNG.
"""

import io
import math
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.analysis.compare.compared_image import Array, ComparedImage
from raytracer.analysis.compare.difference_image import DifferenceImage, show
from raytracer.analysis.compare.metrics import METRICS
from raytracer.analysis.compare.result import Comparison
from raytracer.analysis.compare.z_test import TEST_LABELS, TESTS
from raytracer.report import page as html
from raytracer.report.colour_maps import Pixels, false_colours, signed_colours
from raytracer.report.lettering import load_font
from raytracer.report.palette import FAINT, INK, PAPER

# Size of letters, and margins, below and above pictures (px).
_TEXT, _PAD = 13, 8
_LEGEND = 54
_NARROWEST_LEGEND = 240

_MANTISSA_DROPPED = 3

# Pixels above which images are sent as display values, without a slider of exposure: some browsers take no larger
# canvas.
_LARGEST_LINEAR = 2**22


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
