"""A page that shows pairs of images: a divider to wipe between them, their difference, and how far apart they are.

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

from raytracer import pages
from raytracer.comparison.difference import check_kind, show
from raytracer.comparison.metrics import METRICS
from raytracer.comparison.pictures import false_colours, signed_colours
from raytracer.comparison.reading import Array, Picture
from raytracer.comparison.result import Comparison
from raytracer.comparison.verdict import TEST_LABELS, TESTS
from raytracer.errors import InputError

_MANTISSA_DROPPED = 3

# Larger images are shown as a display does, without a slider of exposure: some browsers take no larger canvas.
_LARGEST_LINEAR = 2**22


def wipe_page(comparison: Comparison) -> bytes:
    """One self-contained HTML file for a pair of images.

    Raises
    ------
    InputError : the pixels of the comparison were let go of.
    """
    views = Views()
    title = f"{comparison.a} against {comparison.b}"
    views.add(comparison, title)
    return views.page(title)


class Views:
    """Pairs for one page, of which no more is kept than what it holds."""

    def __init__(self) -> None:
        self._pairs: list[dict[str, Any]] = []

    def add(self, comparison: Comparison, name: str) -> None:
        """Add a pair.

        Raises
        ------
        InputError : the pixels of the comparison were let go of.
        """
        if comparison.pictures is None:
            raise InputError("the pixels of this comparison were let go of")
        is_linear = not comparison.is_display and comparison.width * comparison.height <= _LARGEST_LINEAR
        with ThreadPoolExecutor() as threads:
            images = list(threads.map(lambda picture: _sent(picture, is_linear), comparison.pictures))
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
                "test": comparison.told(),
                "notes": [*comparison.also(), *comparison.notes],
                "tests": tests_of(comparison),
                "passed": comparison.passed,
                "failures": comparison.failures,
            }
        )

    def page(self, title: str) -> bytes:
        """The file that shows them all."""
        data = {
            "title": title,
            "pairs": self._pairs,
            "colours": {"signed": signed_colours().ravel(), "size": false_colours().ravel()},
        }
        return pages.page("compare", title, data, parts=("wipe",))


def tests_of(comparison: Comparison) -> list[dict[str, Any]]:
    """List the parts of the z-test for the page: what each is of, its p, and whether it failed."""
    verdict = comparison.verdict
    if verdict is None:
        return []
    limit = comparison.alpha / TESTS
    return [{"label": TEST_LABELS[name], "p": p, "failed": not p >= limit} for name, p in verdict.p_values().items()]


def _sent(picture: Picture, is_linear: bool) -> str:
    """The address of a picture's values, as its bytes for a display, or as the bytes of halves."""
    return pages.png(halves(picture.values) if is_linear else picture.in_bytes())


def halves(values: Array) -> NDArray[np.uint8]:
    """Values (height, width, 3) as upper bytes above lower bytes of halves: uint8 (2 height, width, 3)."""
    largest = float(np.finfo(np.float16).max)
    bits = np.clip(values, -largest, largest).astype(np.float16).view(np.uint16).astype(np.uint32)
    step = 1 << _MANTISSA_DROPPED
    rounded = (bits + step // 2) & ~np.uint32(step - 1)
    # The largest would round up to infinity.
    infinite = (rounded & 0x7C00) == 0x7C00
    rounded = np.where(infinite & ~np.isnan(values), bits & ~np.uint32(step - 1), rounded)
    return np.concatenate([rounded >> 8, rounded & 255]).astype(np.uint8)


def _scale(comparison: Comparison, is_linear: bool) -> dict[str, float]:
    """The size of differences that the page begins with, in what it has values of."""
    if is_linear or comparison.is_display:
        shown = {kind: show(comparison, kind).scale for kind in ("absolute", "relative")}
    else:
        a, b = (picture.in_bytes() / 255.0 for picture in comparison.pictures or ())
        most = float(np.abs(a - b).max())
        shown = {"absolute": most, "relative": most}
    return {kind: scale if math.isfinite(scale) and scale > 0.0 else 1.0 for kind, scale in shown.items()}


def _map(comparison: Comparison, kind: str) -> dict[str, Any]:
    """A picture that the page cannot work out itself."""
    check_kind(kind)
    shown = show(comparison, kind)
    return {"image": pages.png(shown.pixels), "ends": shown.ends, "caption": shown.caption}
