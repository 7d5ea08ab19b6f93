"""Measurement of a scene itself: a warm-up, a pilot, and replicates of some of its tiles."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.analysis.cost.bench import Subject
from raytracer.analysis.cost.pilot import Pilot, draw_tiles, run_pilot, warm_up
from raytracer.analysis.cost.predict import relative_weights
from raytracer.analysis.cost.replicates import Replicates, render_replicates
from raytracer.analysis.cost.study_options import StudySettings
from raytracer.analysis.cost.tile_sample import TileSample
from raytracer.analysis.cost.workload import replicate_workload, sample_levels
from raytracer.film.window import Window
from raytracer.rendering.tile_scheduler import split_into_tiles
from raytracer.scene.spec import SceneSpec

Array = NDArray[np.float64]

PREDICTION_SECONDS = 60.0
"""Approximate render time of a scene for its prediction."""


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


class SceneMeasurement(NamedTuple):
    """Replicates of a scene.

    scale : mean of the picture.
    weight : (P, 3), weights of squared errors.
    """

    replicates: Replicates
    scale: float
    weight: Array


def picture_tiles(spec: SceneSpec) -> list[Window]:
    """List all tiles of the picture."""
    return split_into_tiles(Window(0, 0, *spec.picture()))


def warm_scene(subject: Subject, seed: int) -> WarmScene:
    """Warm up a scene, and look at the whole picture."""
    windows = picture_tiles(subject.prepared.spec)
    pace = warm_up(subject, windows, seed)
    return WarmScene(subject, windows, pace, run_pilot(subject, windows, PREDICTION_SECONDS, pace, seed))


def measure_scene(warm: WarmScene, settings: StudySettings, tick: Callable[[float], None]) -> SceneMeasurement:
    """Render replicates of some tiles.  `tick` is called with the fraction that is done."""
    workload = replicate_workload(warm.windows, PREDICTION_SECONDS, warm.pace, settings.tiles)
    sample = draw_tiles(warm.windows, workload.tiles, warm.pilot, settings.seed)
    levels = sample_levels(workload.spp, warm.subject.is_progressive)
    replicates = render_replicates(warm.subject, sample, levels, settings.seed, tick)
    best = replicates.means[levels[-1]].mean(axis=0)
    scale = _estimate_scale(warm, sample, best)
    return SceneMeasurement(replicates, scale, relative_weights(best, scale))


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
    place = {window: tile for tile, window in enumerate(warm.windows)}
    seen = np.isin(warm.pilot.tiles.owner, [place[window] for window in sample.windows])
    error = (best - warm.pilot.mean[seen]).mean(axis=1)
    return abs(float(warm.pilot.mean.mean() + (stands @ error) / len(warm.pilot.mean)))


def assemble_picture(warm: WarmScene, measurement: SceneMeasurement) -> Array:
    """Assemble the best of what was rendered, (height, width, 3), nan where nothing was."""
    width, height = warm.subject.prepared.spec.picture()
    picture = np.full((height, width, 3), math.nan)
    if warm.pilot:
        warm.pilot.tiles.spread(warm.pilot.mean, picture)
    replicates = measurement.replicates
    replicates.tiles.spread(replicates.means[replicates.levels[-1]].mean(axis=0), picture)
    return picture
