"""A page of what was checked: reference, picture, their difference, and how far beyond the noise it is."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer import __version__, pages
from raytracer.comparison.pictures import signed
from raytracer.film import srgb
from raytracer.film.exposure import luminance
from raytracer.film.image import Image
from raytracer.regression.checking import TILE, Checked
from raytracer.regression.references import Reference

_Z_SCALE = 6.0
"""Standard deviations that are shown in the strongest colour; one pixel in 5e8 is farther off by noise."""

_LEGEND = 129

# The part of the pixels whose differences are told apart.
_MOST = 0.99

# Of what is brighter than this part of the picture nothing need be seen; and what the rest is brought to if it is dark.
_BRIGHT_PART = 0.98
_DARK, _LIGHT = 0.25, 1.5


def report(results: Sequence[Checked]) -> bytes:
    """A self-contained HTML page of all results, those that failed first."""
    failed = sum(not result.passed for result in results)
    title = f"{failed} of {len(results)} failed" if failed else f"{sum(not r.skipped for r in results)} passed"
    ordered = sorted(results, key=lambda result: result.passed)
    data = {
        "version": __version__,
        "z_scale": _Z_SCALE,
        "legend": pages.png(signed(np.linspace(-1.0, 1.0, _LEGEND)[None, :], 1.0)),
        "results": [_shown(result) for result in ordered],
    }
    return pages.page("check", f"rt check: {title}", data, parts=("wipe",))


def _shown(result: Checked) -> dict[str, Any]:
    """What the page tells of a result."""
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
    scale = _scale(difference)
    shown |= {
        "brightness": factor,
        "means": {
            "reference": reference.mean.mean(axis=(0, 1)),
            "picture": image.radiance.mean(axis=(0, 1)),
            "z": verdict.mean_z,
        },
        "difference_scale": scale,
        "pictures": {
            "reference": _png(reference, image, factor),
            "picture": pages.png(_display(image.radiance, image, factor)),
            "difference": pages.png(signed(difference, scale)),
            "pixels": pages.png(signed(_farthest(verdict.pixel_z), _Z_SCALE)),
            "tiles": pages.png(signed(_spread(_farthest(verdict.tile_z), height, width), _Z_SCALE)),
        },
    }
    return shown


def _scale(difference: NDArray[np.float64]) -> float:
    """What is shown in the strongest colour: few pixels differ by more, as lamps do by their noise."""
    finite = np.abs(difference[np.isfinite(difference)])
    most = [float(np.quantile(finite, part)) for part in (_MOST, 1.0)] if finite.size else []
    return next((value for value in most if value > 0.0), 1.0)


def _png(reference: Reference, image: Image, factor: float) -> str:
    return pages.png(_display(reference.mean, image, factor))


def _display(values: NDArray[np.float64], image: Image, factor: float) -> NDArray[np.uint8]:
    """Values as a display shows them, by the tone curve of an image."""
    values = factor * np.nan_to_num(values)
    return srgb.to_uint8(values if image.tone_curve is None else image.tone_curve(values))


def _brightness(values: NDArray[np.float64]) -> float:
    """A power of two by which a picture of plain radiance is multiplied, if hardly anything could be seen of it."""
    bright = float(np.quantile(luminance(values), _BRIGHT_PART))
    if not math.isfinite(bright) or bright <= 0.0 or _DARK <= bright <= _LIGHT:
        return 1.0
    return 2.0 ** -round(math.log2(bright))


def _farthest(z: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of the channels (..., 3) that which is farthest from 0 (...)."""
    return np.take_along_axis(z, np.argmax(np.abs(z), axis=-1)[..., None], axis=-1)[..., 0]


def _spread(tiles: NDArray[np.float64], height: int, width: int) -> NDArray[np.float64]:
    """Values of tiles in each of their pixels."""
    return np.repeat(np.repeat(tiles, TILE, axis=0), TILE, axis=1)[:height, :width]
