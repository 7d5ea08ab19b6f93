"""Replicates of a scene: independent renders of the same tiles, whose differences tell the noise."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.analysis.cost.bench import Purpose, Subject, seeds
from raytracer.analysis.cost.tile_sample import TileSample
from raytracer.analysis.cost.workload import REPLICATES

Array = NDArray[np.float64]


class Replicates(NamedTuple):
    """R independent renders of the same tiles.

    means : by samples per pixel, (R, P, 3), each what a render of that many samples holds.
    busy : (R, T), seconds of a thread for one sample in every pixel of a tile.
    rays : (R, T), rays for the same.
    bad : number of samples that were not finite.
    """

    tiles: TileSample
    means: dict[int, Array]
    busy: Array
    rays: Array
    bad: int

    @property
    def levels(self) -> tuple[int, ...]:
        """Samples per pixel, rising."""
        return tuple(self.means)


def render_replicates(
    subject: Subject, tiles: TileSample, levels: Sequence[int], seed: int, tick: Callable[[float], None]
) -> Replicates:
    """Render the replicates of a scene.  `tick` is called with the fraction that is done."""
    runs = seeds(seed, Purpose.REPLICATE, REPLICATES)
    means: dict[int, list[Array]] = {spp: [] for spp in levels}
    busy, rays, bad = [], [], 0
    for number, own in enumerate(runs):
        for keep, spp in _plan_runs(levels, subject.is_progressive):
            patch = subject.render(tiles.windows, spp, own, keep)
            for n in keep:
                means[n].append(tiles.flat(patch.levels[n]))
            bad += patch.nan_samples
        busy.append(patch.busy / levels[-1])
        rays.append(patch.rays / levels[-1])
        tick((number + 1) / len(runs))
    return Replicates(
        tiles, {spp: np.stack(parts) for spp, parts in means.items()}, np.stack(busy), np.stack(rays), bad
    )


def _plan_runs(levels: Sequence[int], is_progressive: bool) -> list[tuple[tuple[int, ...], int]]:
    """Group levels into renders, each with its samples: one render of all levels if the sampler is progressive."""
    return [(tuple(levels), levels[-1])] if is_progressive else [((spp,), spp) for spp in levels]
