"""Measurement of a scene itself: a warm-up, a first look that tells where its noise is, and replicates of some tiles.

Replicates are independent renders of the same tiles, whose differences tell the noise.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.analysis.cost.bench import Purpose, Subject, seeds
from raytracer.analysis.cost.study_options import StudySettings
from raytracer.analysis.cost.tile_sample import (
    REPLICATES,
    TileSample,
    choose_tiles,
    replicate_workload,
    sample_levels,
)
from raytracer.core.embree import PACKET
from raytracer.core.error_estimate.metric import error_weights, mean_scale, mse_by_tile
from raytracer.film.window import Window
from raytracer.rendering.tile_scheduler import split_into_tiles
from raytracer.scene.spec import SceneSpec

Array = NDArray[np.float64]

PREDICTION_SECONDS = 60.0
"""Approximate render time of a scene for its prediction."""

# Least duration of the first measurement of the pace (s).
_WARM_SECONDS = 0.25

# Part of the time for the prediction that the pilot may take, and samples per pixel of each of its two pictures.
_PILOT_SHARE = 0.2
_PILOT_SPP = 8

# Tiles are drawn half evenly, half by the pilot's error: a tile that the pilot misjudges counts at most twice as much.
_EVEN_SHARE = 0.5


# ---- First look


def warm_up(subject: Subject, windows: Sequence[Window], seed: int) -> float:
    """Measure the samples per second of all threads, once caches are warm.

    Renders ever more of the picture, until its time can be measured.
    """
    rng = np.random.default_rng(seed)
    count, spp = 1, PACKET
    while True:
        tiles = choose_tiles(windows, count, rng)
        patch = subject.render(tiles.windows, spp, seed)
        if patch.busy.sum() >= _WARM_SECONDS * subject.threads:
            return float(tiles.pixels.sum() * spp * subject.threads / patch.busy.sum())
        # Four times the work: more of the picture first, then more samples.
        more = min(4 * count, len(windows))
        count, spp = more, spp * max(1, (4 * count) // more)


class Pilot(NamedTuple):
    """A first look at the whole picture, at few samples.

    tiles : all tiles of the picture.
    mean : (P, 3), means of the pixels.
    squares : (T,), squared error of each tile.
    rays : (2, T), rays of one sample in every pixel of a tile, by each of its two pictures.
    """

    tiles: TileSample
    mean: Array
    squares: Array
    rays: Array


def _run_pilot(subject: Subject, windows: Sequence[Window], pace: float, seed: int) -> Pilot | None:
    """Render two pictures of a few samples; None if that takes too much of the time for the prediction."""
    tiles = choose_tiles(windows, len(windows), np.random.default_rng(seed))
    if 2 * _PILOT_SPP * tiles.pixels.sum() / pace > _PILOT_SHARE * PREDICTION_SECONDS:
        return None
    patches = [subject.render(windows, _PILOT_SPP, own) for own in seeds(seed, Purpose.PILOT, 2)]
    pictures = np.stack([tiles.flat(patch.mean) for patch in patches])
    mean = pictures.mean(axis=0)
    squares = mse_by_tile(pictures, error_weights(mean, mean_scale(mean)), tiles.owner).sums
    return Pilot(tiles, mean, squares, np.stack([patch.rays for patch in patches]) / _PILOT_SPP)


# ---- Replicates


class Replicates(NamedTuple):
    """R independent renders of the same tiles.

    means : by samples per pixel, (R, P, 3), each what a render of that many samples holds.
    busy : (R, T), seconds of a thread for one sample in every pixel of a tile.
    rays : (R, T), rays for the same.
    bad : number of samples that were not finite.
    scale : mean of the picture, which errors are relative to; if it is 0, errors are unknown.
    """

    tiles: TileSample
    means: dict[int, Array]
    busy: Array
    rays: Array
    bad: int
    scale: float

    @property
    def levels(self) -> tuple[int, ...]:
        """Samples per pixel, rising."""
        return tuple(self.means)

    @property
    def last(self) -> Array:
        """Means at the last level, (R, P, 3)."""
        return self.means[self.levels[-1]]

    @property
    def best(self) -> Array:
        """Mean of all at the last level, (P, 3)."""
        return np.asarray(self.last.mean(axis=0))

    def weight(self, level: int) -> Array:
        """Compute weights (P, 3) of squared errors from the mean at a level; nan if the picture is black."""
        best = self.means[level].mean(axis=0)
        return error_weights(best, self.scale) if self.scale > 0.0 else np.full_like(best, math.nan)


def _render_replicates(
    subject: Subject, tiles: TileSample, levels: Sequence[int], seed: int, tick: Callable[[float], None]
) -> Replicates:
    """Render the replicates of a scene.  `tick` is called with the fraction that is done."""
    means: dict[int, list[Array]] = {spp: [] for spp in levels}
    busy, rays, bad = [], [], 0
    # One render of all levels if the sampler is progressive, else one of each.
    runs = [tuple(levels)] if subject.is_progressive else [(spp,) for spp in levels]
    for number, own in enumerate(seeds(seed, Purpose.REPLICATE, REPLICATES)):
        for keep in runs:
            patch = subject.render(tiles.windows, keep[-1], own, keep)
            for spp in keep:
                means[spp].append(tiles.flat(patch.levels[spp]))
            bad += patch.nan_samples
        busy.append(patch.busy / levels[-1])
        rays.append(patch.rays / levels[-1])
        tick((number + 1) / REPLICATES)
    stacked = {spp: np.stack(parts) for spp, parts in means.items()}
    return Replicates(tiles, stacked, np.stack(busy), np.stack(rays), bad, math.nan)


# ---- Scene


class WarmScene(NamedTuple):
    """A compiled scene whose caches are warm.

    windows : all tiles of the picture.
    pace : samples per second of all threads.
    pilot : a first look at the whole picture; None if that takes too long.
    """

    subject: Subject
    windows: Sequence[Window]
    pace: float
    pilot: Pilot | None


def picture_tiles(spec: SceneSpec) -> list[Window]:
    """List all tiles of the picture."""
    return split_into_tiles(Window(0, 0, *spec.picture()))


def warm_scene(subject: Subject, seed: int) -> WarmScene:
    """Warm up a scene, and look at the whole picture."""
    windows = picture_tiles(subject.prepared.spec)
    pace = warm_up(subject, windows, seed)
    return WarmScene(subject, windows, pace, _run_pilot(subject, windows, pace, seed))


def measure_scene(warm: WarmScene, settings: StudySettings, tick: Callable[[float], None]) -> Replicates:
    """Render replicates of some tiles, most where the pilot saw most noise.

    tick : called with the fraction that is done.
    """
    windows, size = warm.windows, None
    if warm.pilot is not None and (total := float(warm.pilot.squares.sum())) > 0.0:
        size = _EVEN_SHARE / len(windows) + (1.0 - _EVEN_SHARE) * warm.pilot.squares / total
    workload = replicate_workload(windows, PREDICTION_SECONDS, warm.pace, settings.tiles)
    sample = choose_tiles(windows, workload.tiles, np.random.default_rng(settings.seed), size)
    levels = sample_levels(workload.spp, warm.subject.is_progressive)
    replicates = _render_replicates(warm.subject, sample, levels, settings.seed, tick)
    return replicates._replace(scale=_estimate_scale(warm, sample, replicates.best))


def _estimate_scale(warm: WarmScene, sample: TileSample, best: Array) -> float:
    """Estimate the picture's mean from the measured tiles, `best` (P, 3), and the pilot's look at all of them.

    The pilot's mean is corrected by its error in the tiles that have been measured: it has so few samples that all of
    them may have missed a small light.

    References: Särndal, Swensson and Wretman 1992, "Model Assisted Survey Sampling", section 6.3 (the difference
        estimator).
    """
    stands = sample.weight[sample.owner]
    if warm.pilot is None:
        return abs(float(np.average(best.mean(axis=1), weights=stands)))
    seen = np.isin(warm.pilot.tiles.owner, _indices(warm, sample))
    error = (best - warm.pilot.mean[seen]).mean(axis=1)
    return abs(float(warm.pilot.mean.mean() + (stands @ error) / len(warm.pilot.mean)))


def _indices(warm: WarmScene, sample: TileSample) -> list[int]:
    """Return the indices of measured tiles among all."""
    place = {window: tile for tile, window in enumerate(warm.windows)}
    return [place[window] for window in sample.windows]


class RayCount(NamedTuple):
    """Rays of one sample in every pixel of the picture; nan if only a part has been looked at.

    error : standard error of the value.
    """

    value: float
    error: float


def count_rays(warm: WarmScene, measured: Replicates) -> RayCount:
    """Count the rays of a picture: those of the measured tiles, and those that the pilot saw in the others."""
    if warm.pilot is None:
        return RayCount(math.nan, math.nan)
    rays, is_seen = warm.pilot.rays, np.zeros(len(warm.windows), dtype=bool)
    is_seen[_indices(warm, measured.tiles)] = True
    value = rays.mean(axis=0)[~is_seen].sum() + measured.rays.mean(axis=0).sum()
    # Pictures differ by twice the error of their mean; what the replicates differ in is known by their times.
    return RayCount(float(value), float(np.linalg.norm(0.5 * np.diff(rays, axis=0)[0, ~is_seen])))


def assemble_picture(warm: WarmScene, measured: Replicates) -> Array:
    """Assemble the best of what was rendered, (height, width, 3), nan where nothing was."""
    width, height = warm.subject.prepared.spec.picture()
    picture = np.full((height, width, 3), math.nan)
    if warm.pilot:
        warm.pilot.tiles.spread(warm.pilot.mean, picture)
    measured.tiles.spread(measured.best, picture)
    return picture
