"""A scene made ready, and parts of its picture rendered by themselves: what measurements of a warm renderer need."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.accumulation import FilmView
from raytracer.embree import PACKET, Accel
from raytracer.film.film import Film
from raytracer.integrator import Scene, render_tile
from raytracer.interior import ranks_of
from raytracer.interrupts import unhindered
from raytracer.jit import alone
from raytracer.paths import Workspace, workspace
from raytracer.sampling import SAMPLERS
from raytracer.scene.pack import Packed, pack
from raytracer.scene.spec import SceneSpec
from raytracer.scheduling import TILE, Crew, Window, now


class Prepared(NamedTuple):
    """A scene that is ready to be rendered, and compiled for plain radiance.

    spec, its camera focused at a distance; packed; accel, the ray caster's structure, which lives as long as this
    does; scene, packed and with the structure's address; seconds, by phase: pack, build and compile.
    """

    spec: SceneSpec
    packed: Packed
    accel: Accel
    scene: Scene
    seconds: dict[str, float]


class Patch(NamedTuple):
    """Some tiles of a picture, T of them, rendered by themselves.

    mean (T, TILE, TILE, 3) float64, and count (T, TILE, TILE) int64, which is 0 beyond the edges of a smaller tile;
    rays (T,) int64; busy (T,) float64, seconds that a thread took for the tile; seconds, for all, on the wall's clock;
    nan_samples; levels, the means (T, TILE, TILE, 3) at numbers of samples on the way.
    """

    mean: NDArray[np.float64]
    count: NDArray[np.int64]  # type: ignore[assignment]  # takes the place of tuple.count
    rays: NDArray[np.int64]
    busy: NDArray[np.float64]
    seconds: float
    nan_samples: int
    levels: dict[int, NDArray[np.float64]]


def prepare(spec: SceneSpec, packed: Packed | None = None) -> Prepared:
    """Pack, build and compile a scene; only the latter two if it is `packed` already.

    Raises
    ------
    InputError : the scene cannot be packed.
    """
    times = [now()]
    packed = packed or pack(spec)
    times.append(now())
    accel = packed.build()
    scene = packed.scene._replace(accel=accel.address)
    times.append(now())
    compile_for(scene, view(film_for(scene, 1, 1)))
    times.append(now())
    phases = ("pack", "build", "compile")
    seconds = {phase: end - begin for phase, begin, end in zip(phases, times, times[1:], strict=False)}
    return Prepared(packed.spec, packed, accel, scene, seconds)


def compile_for(scene: Scene, target: FilmView, room: Workspace | None = None) -> int:
    """Compile the path tracer for a scene, a film and a workspace of these types, or take it from the cache.

    Returns how many kernels this process has now that it did not have before.

    Raises
    ------
    KeyboardInterrupt : at once; what is being compiled gets done all the same.
    """

    def work() -> int:
        with alone:
            before = _versions()
            render_tile(scene, target, room or workspace(solids=ranks_of(scene.interior)), 0, 0, 0, 0, 0, 0)
            return _versions() - before

    return unhindered(work)


def _versions() -> int:
    """How many versions of the path tracer there are; none where it is not compiled at all."""
    return len(getattr(render_tile, "signatures", ()))


def film_for(scene: Scene, width: int, height: int) -> Film:
    """An empty film that holds what a scene has to tell."""
    return Film.empty(width, height, is_clamped=scene.clamp is not None)


def view(film: Film, left: int = 0, top: int = 0, aovs: object = None) -> FilmView:
    """A film as kernels see it, its first pixel being (left, top) of the picture."""
    return FilmView(film.mean, film.m2, film.count, film.nan_count, left, top, aovs, film.removed)


def render_tiles(
    prepared: Prepared,
    windows: Sequence[Window],
    spp: int,
    seed: int,
    threads: int,
    keep: Sequence[int] = (),
) -> Patch:
    """Render some tiles of a picture: the pixels are those of the whole picture with that seed and spp.

    Parameters
    ----------
    windows : of at most TILE x TILE pixels each.
    keep : multiples of 8 up to `spp`, numbers of samples at which to note the means on the way.

    Raises
    ------
    ValueError : a window is empty or too large, or a number to keep is none of the above.
    KeyboardInterrupt : as soon as the tiles in work are finished.
    """
    if any(not 0 < edge <= TILE for w in windows for edge in (w.right - w.left, w.bottom - w.top)):
        raise ValueError(f"windows have 1 to {TILE} pixels a side")
    if any(n % PACKET or not 0 < n <= spp for n in keep):
        raise ValueError(f"means can be noted at multiples of {PACKET} samples up to {spp}, got {tuple(keep)}")
    scene = prepared.scene._replace(sampler=SAMPLERS[prepared.spec.render.sampler](seed, spp))
    shape = (len(windows), TILE, TILE)
    mean, m2 = np.zeros((*shape, 3)), np.zeros((*shape, 3))
    count, bad = np.zeros(shape, dtype=np.int64), np.zeros(shape, dtype=np.int64)
    levels = {n: np.zeros((*shape, 3)) for n in keep}
    rays, busy = np.zeros(len(windows), dtype=np.int64), np.zeros(len(windows))

    def work(room: Workspace, tile: int) -> None:
        window = windows[tile]
        removed = film_for(scene, TILE, TILE).removed
        target = FilmView(mean[tile], m2[tile], count[tile], bad[tile], window.left, window.top, None, removed)
        begin = 0
        for end in sorted({*keep, spp}):
            start = now()
            rays[tile] += render_tile(scene, target, room, *window, begin, end)
            busy[tile] += now() - start
            if end in levels:
                levels[end][tile] = mean[tile]
            begin = end

    crew = Crew(threads, solids=ranks_of(scene.interior))
    start = now()
    crew.run(range(len(windows)), work)
    if crew.interrupted:
        raise KeyboardInterrupt
    return Patch(mean, count, rays, busy, now() - start, int(bad.sum()), levels)
