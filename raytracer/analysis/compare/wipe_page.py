"""HTML page of pairs of images: a divider to wipe between them, their difference, and their metrics.

The script of the page has the values themselves, so that the exposure and the scale of the difference can be moved.
Linear light is sent in 12 bits: numbers of half precision (IEEE 754) with 7 bits of mantissa in place of 10, which
differ by 0.4 % at most, less than what a display tells apart.  Their upper and lower bytes are two pictures, one below
the other, in one PNG.
"""

import math
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.analysis.compare.compared_image import Array, ComparedImage
from raytracer.analysis.compare.difference_image import check_kind, show
from raytracer.analysis.compare.metrics import METRICS
from raytracer.analysis.compare.result import Comparison
from raytracer.analysis.compare.z_test import TEST_LABELS, TESTS
from raytracer.report import page as html
from raytracer.report.colour_maps import false_colours, signed_colours
from raytracer.util.errors import InputError

_MANTISSA_DROPPED = 3

# Pixels above which images are sent as display values, without a slider of exposure: some browsers take no larger
# canvas.
_LARGEST_LINEAR = 2**22


def wipe_page(comparison: Comparison) -> bytes:
    """Make a self-contained HTML file for a pair of images.

    Raises
    ------
    InputError : the pixels of the comparison were released.
    """
    views = WipePage()
    title = f"{comparison.a} against {comparison.b}"
    views.add(comparison, title)
    return views.page(title)


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
        if comparison.pictures is None:
            raise InputError("the pixels of this comparison were released")
        is_linear = not comparison.is_display and comparison.width * comparison.height <= _LARGEST_LINEAR
        with ThreadPoolExecutor() as threads:
            images = list(threads.map(lambda picture: _encoded_values(picture, is_linear), comparison.pictures))
        maps = []
        if comparison.flip is not None:
            maps.append("flip")
        if comparison.verdict is not None:
            maps.append("z")
        self._pairs.append(
            {
                "name": name,
                "linear": is_linear,
                "images": images,
                "labels": comparison.labels,
                "scale": _scale(comparison, is_linear),
                "maps": {kind: _map(comparison, kind) for kind in maps},
                "metrics": [
                    {"label": METRICS[key].label, "value": value, "domain": comparison.domains[key], "key": key}
                    for key, value in comparison.metrics.items()
                ],
                "unmeasured": [
                    {"label": METRICS[key].label, "reason": reason} for key, reason in comparison.unmeasured.items()
                ],
                "test": comparison.verdict_text(),
                "notes": [*comparison.other_findings(), *comparison.notes],
                "tests": list_tests(comparison),
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


def list_tests(comparison: Comparison) -> list[dict[str, Any]]:
    """List the parts of the z-test for the page: label, p, and True for failed."""
    verdict = comparison.verdict
    if verdict is None:
        return []
    limit = comparison.alpha / TESTS
    return [{"label": TEST_LABELS[name], "p": p, "failed": not p >= limit} for name, p in verdict.p_values().items()]


def _encoded_values(picture: ComparedImage, is_linear: bool) -> str:
    """Encode an image's values as a data URI: display bytes, or the bytes of halves."""
    return html.png(pack_halves(picture.values) if is_linear else picture.to_display_bytes())


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
        a, b = (picture.to_display_bytes() / 255.0 for picture in comparison.pictures or ())
        most = float(np.abs(a - b).max())
        scales = {"absolute": most, "relative": most}
    return {kind: scale if math.isfinite(scale) and scale > 0.0 else 1.0 for kind, scale in scales.items()}


def _map(comparison: Comparison, kind: str) -> dict[str, Any]:
    """Encode a difference image that the page cannot compute itself."""
    check_kind(kind)
    difference = show(comparison, kind)
    return {"image": html.png(difference.pixels), "ends": difference.ends, "caption": difference.caption}
