"""Bands: the parts of all views that are rendered at a time, as many as fit into memory, and their statistics together.

A band is as many rows of views as fit, or as many views of one row.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from raytracer.film.light_field.layout import Layout, ViewLayout
from raytracer.film.light_field.posed_views import PosedViews
from raytracer.film.light_field.views import Views
from raytracer.film.white_balance import AUTO
from raytracer.film.window import Window
from raytracer.kernel.aovs.base.interface import per_sample_aovs, unique_aovs
from raytracer.lightfield.memory import MORE_MEMORY
from raytracer.rendering.compilation import PreparedScene
from raytracer.rendering.memory_budget import ERROR_ESTIMATOR_BYTES, picture_memory
from raytracer.rendering.session import Rendered
from raytracer.rendering.statistics import Stats, peak_rss_bytes
from raytracer.scene.spec import SceneSpec
from raytracer.util.errors import InputError


class ViewBand(NamedTuple):
    """Band of views: the rows `row` <= r < `row_end`, and the columns `column` <= c < `column_end`."""

    row: int
    row_end: int
    column: int
    column_end: int

    def window(self, views: Views | PosedViews) -> Window:
        """Return the window of the picture that these views cover."""
        width, height = views.width, views.height
        return Window(self.column * width, self.row * height, self.column_end * width, self.row_end * height)

    def layout(self, whole: ViewLayout) -> ViewLayout:
        """Return the layout of this band's picture."""
        return whole.part(slice(self.row, self.row_end), slice(self.column, self.column_end))


def split_into_bands(views: Views | PosedViews, most: int) -> list[ViewBand]:
    """Split all views into bands of at most `most`, 1 or more: of about equal numbers of rows, or parts of a row."""
    rows, columns = views.rows, views.columns
    if most >= columns:
        return [ViewBand(begin, end, 0, columns) for begin, end in _split_row(rows, most // columns)]
    return [ViewBand(row, row + 1, begin, end) for row in range(rows) for begin, end in _split_row(columns, most)]


def _split_row(count: int, most: int) -> list[tuple[int, int]]:
    """Split a row into as few parts as possible of at most `most` each, of nearly equal size: begin and end of each."""
    parts = math.ceil(count / most)
    return list(pairwise(count * part // parts for part in range(parts + 1)))


def bytes_per_pixel(prepared: PreparedScene, *, keeps: bool = False) -> int:
    """Bound the bytes of a pixel, from its first sample to the end of its development; without those of a denoiser.

    keeps : True if checkpoints are written, for which the film and the error estimator are copied.

    A picture and its layers are no larger than the film that they are made of: measured by the process's
    peak, 158 of 176 bytes for plain radiance, 265 of 336 with three AOVs, 490 of 506 with a simulated sensor.
    """
    picture = picture_memory(prepared.packed, 1, None, prepared.options.aovs, denoise=prepared.options.denoise)
    return 2 * picture.film + (1 + keeps) * ERROR_ESTIMATOR_BYTES + picture.photograph


def choose_bands(
    spec: SceneSpec, layout: Layout, pixel_bytes: int, memory: int, aovs: Sequence[str]
) -> list[ViewBand] | None:
    """Choose the bands for a memory (bytes) and the bytes of a pixel; None for a picture that is no mosaic of views.

    Raises InputError: not even a view fits into the memory, or the picture has to be seen as a whole and does not.
    """
    views = layout.views
    width, height = spec.picture()
    whole, view = pixel_bytes * width * height, pixel_bytes * views.width * views.height
    if whole <= memory:
        return [ViewBand(0, views.rows, 0, views.columns)] if layout.is_by_view else None
    reason = _whole_picture_reason(spec, layout, aovs)
    if reason is not None:
        raise InputError(
            f"memory: {reason}, for which {_gigabytes(whole)} are needed, and {_gigabytes(memory)} given; {MORE_MEMORY}"
        )
    if view > memory:
        size = f"{views.width} x {views.height}"
        raise InputError(
            f"memory: must be at least what a view of {size} pixels takes, {_gigabytes(view)}, "
            f"got {_gigabytes(memory)}; {MORE_MEMORY}"
        )
    return split_into_bands(views, memory // view)


def _whole_picture_reason(spec: SceneSpec, layout: Layout, aovs: Sequence[str]) -> str | None:
    """Return the reason for which a picture cannot be rendered in parts; None if it can."""
    if not layout.is_by_view:
        return f"the picture of a {spec.camera.type} camera holds all views in all of its parts"
    if spec.camera.exposure is not None:
        return "camera.exposure measures the whole picture"
    if spec.film.white_balance == AUTO:
        return "film.white_balance: auto measures the whole picture"
    whole_aovs = per_sample_aovs(unique_aovs(aovs))
    return f"the AOV {whole_aovs[0]} is kept of the whole picture" if whole_aovs else None


def _gigabytes(size: float) -> str:
    return f"{size / 1e9:.3g} GB"


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
