"""Find what is wrong with a picture: samples that are not finite, fireflies, clamped light and negative pixels."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.core.error_estimate.fireflies import Fireflies, find_fireflies
from raytracer.film.image import Image
from raytracer.film.negative_pixels import find_negative_pixels
from raytracer.kernel.packed_scene import Scene
from raytracer.kernel.pixel_accumulator import FilmView
from raytracer.rendering.develop import negative_causes
from raytracer.rendering.film_region import FilmRegion
from raytracer.rendering.sample_replay import brightest_sample, first_nan_sample, replay_samples
from raytracer.rendering.statistics import Stats
from raytracer.scene.spec import SceneSpec


def diagnose_samples(
    stats: Stats, scene: Scene, clamp: float | None, region: FilmRegion, scratch: Callable[[], FilmView]
) -> None:
    """Note in the statistics what is wrong with the samples on a film.

    Parameters
    ----------
    clamp : the limit of the scene's clamp, if it has one.
    scratch : makes a film of one tile, of the same type, to take samples again.
    """
    film = region.film
    stats.nan_samples = int(film.nan_count.sum())
    if film.removed is not None and clamp is not None:
        stats.clamp = {"limit": clamp, **_clamped_fractions(film.mean, film.count, film.removed)}
    if stats.nan_samples:
        row, column = (int(place) for place in np.argwhere(film.nan_count)[0])
        x, y = region.left + column, region.top + row
        sample = first_nan_sample(scene, scratch(), x, y, _samples_taken(region, row, column))
        stats.first_nan = {"pixel": [x, y], "sample": sample}
    fireflies = find_fireflies(film.mean, film.m2, film.count)
    if fireflies is not None:
        stats.fireflies = _firefly_stats(fireflies, scene, region, scratch())


def diagnose_picture(stats: Stats, spec: SceneSpec, scene: Scene, image: Image, left: int, top: int) -> None:
    """Note in the statistics what is wrong with a finished picture, whose first pixel is (left, top)."""
    causes = negative_causes(spec, scene)
    stats.negative_pixels, stats.negative = find_negative_pixels(image.radiance, causes, left, top)


def _samples_taken(region: FilmRegion, row: int, column: int) -> int:
    """Count the samples that a pixel of the film was given."""
    return int(region.film.count[row, column] + region.film.nan_count[row, column])


def _firefly_stats(fireflies: Fireflies, scene: Scene, region: FilmRegion, scratch: FilmView) -> dict[str, Any]:
    """Describe fireflies as `Stats` does."""
    row, column = fireflies.brightest
    x, y = region.left + column, region.top + row
    packets = list(replay_samples(scene, scratch, x, y, _samples_taken(region, row, column)))
    limit = fireflies.limit
    if limit is not None:
        # From the film's unit to that of radiance, by what the camera's rays count for there.
        weights = np.concatenate([packet.weights for packet in packets])
        weights = weights[weights > 0.0]
        limit = float(f"{limit / weights.mean():.2g}") if len(weights) else None
    return {
        "pixels": fireflies.pixels,
        "light": fireflies.light,
        "brightest": [x, y],
        "sample": brightest_sample(packets),
        "clamp": limit,
    }


def _clamped_fractions(
    mean: NDArray[np.float64], count: NDArray[np.int64], removed: NDArray[np.float64]
) -> dict[str, float]:
    """Return the parts of the light that a clamp took, and of the samples that it did so from."""
    lost = removed[..., :3] / np.maximum(count, 1)[..., None]
    whole, samples = float(mean.sum() + lost.sum()), int(count.sum())
    return {
        "light": float(lost.sum()) / whole if whole else 0.0,
        "samples": float(removed[..., 3].sum()) / samples if samples else 0.0,
    }
