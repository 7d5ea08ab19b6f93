"""HTML page of checks: reference, picture, their difference, and its size in standard deviations of the noise."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer import __version__
from raytracer.analysis.compare.difference_image import colour_scale, largest_channel
from raytracer.analysis.regression.check import TILE, CheckResult
from raytracer.film.exposure import luminance
from raytracer.film.image import Image
from raytracer.report import page as html
from raytracer.report.colour_maps import signed
from raytracer.util import srgb

_Z_SCALE = 6.0
"""Standard deviations at the strongest colour; noise exceeds them in one pixel of 5e8."""

_LEGEND = 129

# Part of the pixels that should not be clipped, and the range of their maximum within which a picture stays as it is.
_BRIGHT_PART = 0.98
_DARK, _LIGHT = 0.25, 1.5


def check_page(results: Sequence[CheckResult]) -> bytes:
    """Make a self-contained HTML page of all results, failures first."""
    failed = sum(not result.passed for result in results)
    title = f"{failed} of {len(results)} failed" if failed else f"{sum(not r.skipped for r in results)} passed"
    ordered = sorted(results, key=lambda result: result.passed)
    data = {
        "version": __version__,
        "z_scale": _Z_SCALE,
        "legend": html.png(signed(np.linspace(-1.0, 1.0, _LEGEND)[None, :], 1.0)),
        "results": [_result_data(result) for result in ordered],
    }
    return html.page("check", f"rt check: {title}", data, parts=("wipe",))


def _result_data(result: CheckResult) -> dict[str, Any]:
    """Collect the data of a result that the page shows."""
    shown: dict[str, Any] = {**result.json(), "line": result.sentence()}
    reference, image, verdict = result.reference, result.image, result.verdict
    if reference is None:
        return shown
    recipe = reference.recipe
    height, width, _ = reference.mean.shape
    shown["size"] = [width, height]
    shown["kept"] = {"spp": recipe.spp, "seed": recipe.seed, "version": recipe.version}
    shown["overrides"] = recipe.overrides
    if image is None or verdict is None:
        return shown

    factor = _brightness(reference.mean) if image.tone_curve is None and "exposure_gain" not in image.settings else 1.0
    difference = luminance(image.radiance - reference.mean)
    # Few pixels differ by more, as lamps do by their noise.
    scale = colour_scale(np.abs(difference)) or 1.0
    shown |= {
        "brightness": factor,
        "means": {
            "reference": reference.mean.mean(axis=(0, 1)),
            "picture": image.radiance.mean(axis=(0, 1)),
            "z": verdict.mean_z,
        },
        "difference_scale": scale,
        "pictures": {
            "reference": html.png(_display(reference.mean, image, factor)),
            "picture": html.png(_display(image.radiance, image, factor)),
            "difference": html.png(signed(difference, scale)),
            "pixels": html.png(signed(largest_channel(verdict.pixel_z), _Z_SCALE)),
            "tiles": html.png(signed(_expand_tiles(largest_channel(verdict.tile_z), height, width), _Z_SCALE)),
        },
    }
    return shown


def _display(values: NDArray[np.float64], image: Image, factor: float) -> NDArray[np.uint8]:
    """Convert values to those of a display, by the tone curve of an image."""
    values = factor * np.nan_to_num(values)
    return srgb.to_uint8(values if image.tone_curve is None else image.tone_curve(values))


def _brightness(values: NDArray[np.float64]) -> float:
    """Choose a power of two that brightens or darkens a picture of plain radiance, if it is far from visible."""
    bright = float(np.quantile(luminance(values), _BRIGHT_PART))
    if not math.isfinite(bright) or bright <= 0.0 or _DARK <= bright <= _LIGHT:
        return 1.0
    return 2.0 ** -round(math.log2(bright))


def _expand_tiles(tiles: NDArray[np.float64], height: int, width: int) -> NDArray[np.float64]:
    """Repeat values of tiles in each of their pixels."""
    return np.repeat(np.repeat(tiles, TILE, axis=0), TILE, axis=1)[:height, :width]
