"""Find what is wrong with a picture: samples that are not finite, fireflies, clamped light and negative pixels.

A film keeps no samples; to look at one of them, its whole packet is traced again, with the bits that it has in the
picture: a packet of other rays may reach other code of the ray caster.
"""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.embree import PACKET
from raytracer.core.error_estimate.fireflies import Fireflies, find_fireflies
from raytracer.kernel.packed_scene import Scene
from raytracer.kernel.path_log import path_log
from raytracer.kernel.path_state import Workspace
from raytracer.kernel.path_state import workspace as make_workspace
from raytracer.kernel.path_tracer import render_tile
from raytracer.kernel.pixel_accumulator import FilmView
from raytracer.rendering.compilation import PreparedScene
from raytracer.rendering.film_region import FilmRegion
from raytracer.rendering.statistics import Stats

# ---- Samples, taken again

# Size of the buffer for the events of a path, at first.
_INITIAL_EVENTS = 4096


class SamplePacket(NamedTuple):
    """A packet of a pixel's samples.

    first : number of its first sample.
    values : float64 (n, 3), what each sample adds to the pixel; meaningless if a weight is NaN.
    weights : float64 (n,), factor of its radiance; NaN if the sample is dropped because it is not finite.
    """

    first: int
    values: NDArray[np.float64]
    weights: NDArray[np.float64]


def replay_samples(scene: Scene, scratch: FilmView, x: int, y: int, taken: int) -> Iterator[SamplePacket]:
    """Trace all samples of pixel (x, y) of the picture again, packet by packet.

    scratch : a film to write on, of any size.
    taken : number of samples.
    """
    workspace = make_workspace(scene)
    for first in range(0, taken, PACKET):
        end = min(first + PACKET, taken)
        _retrace(scene, scratch, workspace, x, y, first, end)
        size = end - first
        yield SamplePacket(first, workspace.radiance[:size].copy(), workspace.weight[:size].copy())


def first_nan_sample(scene: Scene, scratch: FilmView, x: int, y: int, taken: int) -> int | None:
    """Find the first sample of pixel (x, y) that is not finite, of those taken; None if all are finite."""
    for packet in replay_samples(scene, scratch, x, y, taken):
        dropped = np.flatnonzero(np.isnan(packet.weights))
        if len(dropped):
            return packet.first + int(dropped[0])
    return None


def brightest_sample(packets: Sequence[SamplePacket]) -> int:
    """Find the sample that adds the most, the first of equal ones; packets that are not all finite do not count."""
    sums = [np.where(np.isnan(packet.weights).any(), -np.inf, packet.values.sum(axis=1)) for packet in packets]
    return int(np.argmax(np.concatenate(sums)))


def log_path(
    scene: Scene, scratch: FilmView, x: int, y: int, sample: int, taken: int | None = None
) -> NDArray[np.float64]:
    """Trace a sample of pixel (x, y) again, and return its log, float64 (events, path_log.COLUMNS).

    taken : samples that the pixel gets, which may cut its last packet short; None if that is whole.
    """
    first = sample - sample % PACKET
    end = first + PACKET if taken is None or sample >= taken else min(first + PACKET, taken)
    events = _INITIAL_EVENTS
    while True:
        log = path_log(sample - first, events)
        workspace = make_workspace(scene, log)
        _retrace(scene, scratch, workspace, x, y, first, end)
        written = int(log.state[0])
        if written <= events:
            return log.rows[:written]
        events = written


def _retrace(scene: Scene, scratch: FilmView, workspace: Workspace, x: int, y: int, first: int, end: int) -> None:
    film = scratch._replace(left=x, top=y)
    render_tile(scene, film, workspace, x, y, x + 1, y + 1, first, end)


# ---- Diagnosis


def diagnose_samples(stats: Stats, prepared: PreparedScene, region: FilmRegion) -> None:
    """Note in the statistics what is wrong with the samples on a film."""
    scene, clamp = prepared.scene, prepared.packed.spec.render.clamp
    film = region.film
    stats.nan_samples = int(film.nan_count.sum())
    if film.removed is not None and clamp is not None:
        stats.clamp = {"limit": clamp, **_clamped_fractions(film.mean, film.count, film.removed)}
    if stats.nan_samples:
        row, column = (int(place) for place in np.argwhere(film.nan_count)[0])
        x, y = region.left + column, region.top + row
        taken = int(film.count[row, column] + film.nan_count[row, column])
        sample = first_nan_sample(scene, prepared.empty_tile(), x, y, taken)
        stats.first_nan = {"pixel": [x, y], "sample": sample}
    fireflies = find_fireflies(film.mean, film.m2, film.count)
    if fireflies is not None:
        stats.fireflies = _firefly_stats(fireflies, scene, region, prepared.empty_tile())


def _firefly_stats(fireflies: Fireflies, scene: Scene, region: FilmRegion, scratch: FilmView) -> dict[str, Any]:
    """Describe fireflies as `Stats` does."""
    row, column = fireflies.brightest
    x, y = region.left + column, region.top + row
    taken = int(region.film.count[row, column] + region.film.nan_count[row, column])
    packets = list(replay_samples(scene, scratch, x, y, taken))
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
