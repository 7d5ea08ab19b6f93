"""Statistics of a capture: those of all bands together."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from raytracer.rendering.session import Rendered
from raytracer.rendering.statistics import Stats, peak_rss_bytes


class BandStats(NamedTuple):
    """Statistics of one band.

    stats : of its render.
    pixels : number of its pixels.
    mean : of its picture's magnitudes.
    """

    stats: Stats
    pixels: int
    mean: float


def band_stats(rendered: Rendered, pixels: int) -> BandStats:
    """Collect the statistics of a band."""
    return BandStats(rendered.stats, pixels, float(np.abs(rendered.image.radiance).mean()))


def merge_stats(bands: Sequence[BandStats], before: dict[str, float], writing: float) -> Stats:
    """Merge the statistics of all bands.

    before : seconds by phase up to the first band, which each band has included.
    writing : seconds that the file took.
    """
    first = bands[0].stats
    seconds = dict(before)
    for band in bands:
        for phase, passed in band.stats.seconds.items():
            if phase != "total":
                seconds[phase] = seconds.get(phase, 0.0) + passed - before.get(phase, 0.0)
    seconds["write"] = writing
    seconds["total"] = sum(seconds.values())
    light_of_bands = [band.pixels * band.mean for band in bands]
    light, pixels = sum(light_of_bands), sum(band.pixels for band in bands)
    samples = sum(band.stats.samples for band in bands)
    first_nans = [band.stats.first_nan for band in bands if band.stats.first_nan is not None]
    return replace(
        first,
        seconds=seconds,
        rays=sum(band.stats.rays for band in bands),
        samples=samples,
        resumed=_resumed(bands),
        spp={
            "fewest": min(band.stats.spp["fewest"] for band in bands),
            "mean": samples / pixels,
            "most": max(band.stats.spp["most"] for band in bands),
        },
        nan_samples=sum(band.stats.nan_samples for band in bands),
        first_nan=first_nans[0] if first_nans else None,
        fireflies=_fireflies(bands, light_of_bands),
        negative_pixels=sum(band.stats.negative_pixels for band in bands),
        negative=min((band.stats.negative for band in bands), key=lambda negative: negative.get("lowest", 0.0)),
        clamp=_clamp(bands, light_of_bands),
        error=_error(bands, light / pixels),
        peak_rss_bytes=peak_rss_bytes(),
    )


def _resumed(bands: Sequence[BandStats]) -> dict[str, float]:
    """Add what all bands resumed from; empty where none did."""
    resumed = [band.stats.resumed for band in bands if band.stats.resumed]
    return {name: sum(each[name] for each in resumed) for name in resumed[0]} if resumed else {}


def _fireflies(bands: Sequence[BandStats], light_of_bands: Sequence[float]) -> dict[str, Any]:
    """Merge the fireflies of all bands; the brightest is that of the band in which they have most of the light."""
    fireflies = [
        (band.stats.fireflies, light) for band, light in zip(bands, light_of_bands, strict=True) if band.stats.fireflies
    ]
    if not fireflies:
        return {}
    brightest, _ = max(fireflies, key=lambda item: item[0]["light"] * item[1])
    share = sum(each["light"] * light for each, light in fireflies) / sum(light_of_bands)
    return {**brightest, "pixels": sum(each["pixels"] for each, _ in fireflies), "light": share}


def _clamp(bands: Sequence[BandStats], light_of_bands: Sequence[float]) -> dict[str, float]:
    """Merge the shares of the light and the samples that a clamp took."""
    limits = bands[0].stats.clamp
    if not limits:
        return {}
    light, samples = sum(light_of_bands), sum(band.stats.samples for band in bands)
    return {
        "limit": limits["limit"],
        "light": sum(p.stats.clamp["light"] * of for p, of in zip(bands, light_of_bands, strict=True)) / light
        if light
        else 0.0,
        "samples": sum(band.stats.clamp["samples"] * band.stats.samples for band in bands) / samples,
    }


def _error(bands: Sequence[BandStats], mean: float) -> dict[str, float]:
    """Merge the relative errors of all bands, and the ends of their interval; empty where one is not known.

    Errors of pixels are independent, so that their mean squares, weighted by pixels, are those of the whole.
    """
    if mean == 0.0 or not all(band.stats.error for band in bands):
        return {}
    pixels = sum(band.pixels for band in bands)

    def whole(name: str) -> float:
        squares = sum(band.pixels * (band.stats.error[name] * band.mean) ** 2 for band in bands)
        return math.sqrt(squares / pixels) / mean

    error = {name: whole(name) for name in ("relative", "low", "high")}
    exponent = sum(band.pixels * band.stats.error["exponent"] for band in bands) / pixels
    return {**error, "exponent": exponent}


def replace_error_settings(settings: dict[str, str | float | int], stats: Stats) -> None:
    """Write the error of all views into the settings, in place of that of some."""
    names = {"relative": "relative_error", "low": "relative_error_low", "high": "relative_error_high"}
    for key, name in names.items():
        settings.pop(name, None)
        if stats.error:
            settings[name] = stats.error[key]
    if stats.clamp:
        settings["clamp_took"] = stats.clamp["light"]
