"""Hardware access of a study: compiling, rendering tiles and developing, the seeds of renders, and the clock.

Tests put a `Bench` of their own in place of the machine, with pictures and times that are known.
"""

import enum
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.analysis.cost.tile_sample import FIRST_LEVEL_SPP
from raytracer.core.sampling import SAMPLERS
from raytracer.film.film import Film
from raytracer.film.window import Window
from raytracer.rendering.compilation import CompiledScene, compile_scene
from raytracer.rendering.develop import develop_image
from raytracer.rendering.film_region import FilmRegion
from raytracer.rendering.statistics import PhaseTimer
from raytracer.rendering.tile_renderer import RenderedTiles, render_tiles
from raytracer.scene.pack.scene import PackedScene
from raytracer.scene.spec import SceneSpec

Array = NDArray[np.float64]


def develop(prepared: CompiledScene, picture: Array) -> float:
    """Measure the seconds to develop an image from a film with these means (height, width, 3)."""
    height, width, _ = picture.shape
    film = Film.empty(width, height)
    film.mean[...], film.count[...] = picture, 2
    start = time.perf_counter()
    develop_image(FilmRegion(film, None), prepared.spec)
    return time.perf_counter() - start


class Bench(NamedTuple):
    """Functions that use the machine: those of `rendering.tile_renderer`, and `develop`; tests replace them."""

    prepare: Callable[[SceneSpec, PackedScene | None], CompiledScene]
    render: Callable[[CompiledScene, Sequence[Window], int, int, int, Sequence[int]], RenderedTiles]
    develop: Callable[[CompiledScene, Array], float]


MACHINE = Bench(compile_scene, render_tiles, develop)


class Subject(NamedTuple):
    """A compiled scene, and the bench and threads that render it."""

    prepared: CompiledScene
    bench: Bench
    threads: int

    def render(self, windows: Sequence[Window], spp: int, seed: int, keep: Sequence[int] = ()) -> RenderedTiles:
        """Render tiles; see `tile_renderer.render_tiles`."""
        return self.bench.render(self.prepared, windows, spp, seed, self.threads, keep)

    @property
    def sampler(self) -> str:
        """Name of the scene's sampler."""
        return self.prepared.spec.render.sampler

    @property
    def is_progressive(self) -> bool:
        """Tell if the first samples of a long run are those of a short one."""
        short, long = (SAMPLERS[self.sampler](0, spp) for spp in (FIRST_LEVEL_SPP, 2 * FIRST_LEVEL_SPP))
        return short == long


class Purpose(enum.IntEnum):
    """Purposes that seeds are drawn for."""

    PILOT = 1
    REPLICATE = 2
    ROUND = 3
    CONTROL = 4


def seeds(seed: int, purpose: Purpose, count: int) -> list[int]:
    """Draw seeds that are independent of each other and of those of another purpose."""
    return [int(state) for state in np.random.SeedSequence((seed, purpose)).generate_state(count)]


class Progress(NamedTuple):
    """Phase of a study that is under way, and the fraction of it that is done."""

    phase: str
    fraction: float


class StudyTimer(PhaseTimer):
    """Seconds by phase, and reports of progress."""

    def __init__(self, seconds: dict[str, float], progress: Callable[[Progress], None] | None) -> None:
        super().__init__(seconds)
        self._progress = progress or (lambda _: None)

    @contextmanager
    def phase(self, name: str, label: str = "") -> Iterator[Callable[[float], None]]:
        """Time the phase within; yields a function that reports the fraction of it that is done.

        label : what users read, if that is not the name.
        """
        shown = label or name
        self.resume()
        self._progress(Progress(shown, 0.0))
        try:
            yield lambda fraction: self._progress(Progress(shown, fraction))
        finally:
            self.lap(name)
