"""Rendering, as five calls on explicit state: load, pack, build, render, develop."""

import os
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

from raytracer import __version__
from raytracer.embree import PACKET
from raytracer.errors import InputError
from raytracer.film.exposure import Frame, Setting
from raytracer.film.film import Film, develop
from raytracer.film.image import Image
from raytracer.film.photograph import RADIANCE, Process, check_process, photograph
from raytracer.integrator import FilmView, Scene, render_tile
from raytracer.kinds import AOVS
from raytracer.paths import workspace
from raytracer.scene.effects import effects_of
from raytracer.scene.pack import Packed, pack
from raytracer.scene.spec import SceneSpec

if TYPE_CHECKING:
    from raytracer.aovs.recording import Recording

TILE = 16
"""Edge of the square of pixels that one thread takes at a time."""

# Samples that one call adds to each pixel of a tile: few at first, for an early picture; never so many that Ctrl-C
# or a time limit has to wait.
_FIRST_PASS = 2 * PACKET
_LONGEST_PASS = 32 * PACKET

_WAKE_UP_SECONDS = 0.1


class Window(NamedTuple):
    """Pixels left <= x < right, top <= y < bottom of the picture."""

    left: int
    top: int
    right: int
    bottom: int


class Progress(NamedTuple):
    """How far a render is: samples done and wanted over all pixels, and seconds since its start."""

    done: int
    wanted: int
    seconds: float


@dataclass
class Stats:
    """What a render took.

    seconds, by phase; rays, camera, bounce and shadow rays; samples, over all pixels; nan_samples, samples dropped
    because they were not finite; threads; effects, the names of those simulated; exposure, its numbers by name, none
    for a picture of plain radiance; peak_rss_bytes, of the process.
    """

    seconds: dict[str, float] = field(default_factory=dict)
    rays: int = 0
    samples: int = 0
    nan_samples: int = 0
    threads: int = 0
    effects: list[str] = field(default_factory=list)
    exposure: dict[str, float] = field(default_factory=dict)
    peak_rss_bytes: int = 0
    version: str = __version__

    def json(self) -> dict[str, Any]:
        """As `--stats` writes it."""
        return dict(vars(self))


class Rendered(NamedTuple):
    """An image and what it took.

    complete, whether all samples were taken; interrupted, whether a KeyboardInterrupt ended it early;
    fewest_samples, of any pixel (image.samples is the most); setting, how it was exposed, None for plain radiance.
    """

    image: Image
    stats: Stats
    complete: bool
    interrupted: bool
    fewest_samples: int
    setting: Setting | None


def peak_rss_bytes() -> int:
    """The largest resident memory that this process has had; 0 on Windows, which Python has no call for."""
    if sys.platform == "win32":
        return 0
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return int(peak) if sys.platform == "darwin" else 1024 * int(peak)


def available_threads() -> int:
    """Processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def render(
    spec: SceneSpec,
    *,
    spp: int | None = None,
    seed: int | None = None,
    threads: int | None = None,
    crop: tuple[int, int, int, int] | None = None,
    time_limit: float | None = None,
    aovs: Sequence[str] = (),
    denoise: bool = False,
    progress: Callable[[Progress], None] | None = None,
    load_seconds: float = 0.0,
) -> Rendered:
    """Render a scene.  The same scene, seed and spp give the same bits for any number of threads.

    Parameters
    ----------
    spp, seed : in place of the scene's.
    threads : how many work; all processors if None.
    crop : (x0, y0, x1, y1), the pixels x0 <= x < x1, y0 <= y < y1 only; they are those of the whole picture, but that
        `exposure: auto` and `white_balance: auto` measure these alone, and a Bayer mosaic ends at their edges.
    time_limit : seconds after which no further samples are started.
    aovs : names of AOVs, which become layers of the image (docs/aovs.md); the radiance keeps its bits.
    denoise : whether Open Image Denoise is to clean the image, which then is biased.
    progress : called about ten times a second; a KeyboardInterrupt out of it, or out of a signal, ends the render
        early with the samples taken so far.

    Raises
    ------
    InputError : a crop outside the film, a scene that cannot be packed, an unknown AOV, no denoiser, or what
        `check_process` refuses.
    """
    if denoise:
        from raytracer.film.denoise import require_denoiser

        require_denoiser()
    stats = Stats(threads=threads or available_threads(), effects=[])
    clock = _Clock(stats.seconds, load_seconds)
    settings = spec.render.model_copy(
        update={name: value for name, value in (("spp", spp), ("seed", seed)) if value is not None}
    )
    spec = spec.model_copy(update={"render": settings})
    window = _window(spec, crop)

    packed = pack(spec)
    spec = packed.spec
    process, frame = _process(spec), Frame(spec.film.width, spec.film.height, window.left, window.top)
    check_process(process, frame, window.bottom - window.top, window.right - window.left)
    stats.effects = [name for name, effect in effects_of(spec, packed.scene).items() if effect.active]
    clock.lap("pack")
    accel = packed.build()
    scene = packed.scene._replace(accel=accel.address)
    clock.lap("build")
    film = Film.empty(window.right - window.left, window.bottom - window.top)
    recording = _recording(spec, packed, film, aovs, denoise)
    view = recording.view if recording else None
    target = FilmView(film.mean, film.m2, film.count, film.nan_count, window.left, window.top, view)
    render_tile(scene, target, workspace(), 0, 0, 0, 0, 0, 0)
    clock.lap("compile")
    job = _Job(scene, target, window, settings.spp, time_limit)
    job.run(stats.threads, progress)
    stats.rays = job.rays
    clock.lap("render")

    stats.samples, stats.nan_samples = int(film.count.sum() + film.nan_count.sum()), int(film.nan_count.sum())
    image = develop(film, _header(spec, crop))
    if recording:
        image = _with_layers(image, film, recording, aovs)
    clock.lap("develop")
    if recording and denoise:
        image = _denoised(image, film, recording, stats.threads)
        clock.lap("denoise")
    image, setting = photograph(image, process, frame, spec.render.seed, _units(aovs))
    clock.lap("develop")
    stats.exposure = {} if setting is None else setting.numbers()
    stats.seconds["total"] = sum(stats.seconds.values())
    stats.peak_rss_bytes = peak_rss_bytes()
    fewest = int((film.count + film.nan_count).min())
    return Rendered(image, stats, job.is_complete, job.interrupted, fewest, setting)


def render_image(
    scene: SceneSpec,
    *,
    spp: int | None = None,
    seed: int | None = None,
    threads: int | None = None,
    crop: tuple[int, int, int, int] | None = None,
    time_limit: float | None = None,
    aovs: Sequence[str] = (),
    denoise: bool = False,
) -> Image:
    """The image of a scene: `image.radiance` is float64 (height, width, 3), row 0 at the top.  See `render`."""
    return render(
        scene,
        spp=spp,
        seed=seed,
        threads=threads,
        crop=crop,
        time_limit=time_limit,
        aovs=aovs,
        denoise=denoise,
    ).image


def _process(spec: SceneSpec) -> Process:
    """How the picture is to be developed."""
    return Process(
        exposure=spec.camera.photograph(spec.film.width, spec.film.height),
        sensor=spec.camera.simulated_sensor(),
        white_balance=spec.film.white_balance,
        tone_curve=spec.film.tone_curve,
    )


def _units(aovs: Sequence[str]) -> dict[str, str]:
    """The units of an image's layers: of AOVs, and of the picture that a denoiser has left as it was."""
    return {"noisy": RADIANCE, **{name: AOVS.specs()[name].unit for name in aovs}}


# What the denoiser is guided by, and how much of a pixel it holds for.
_GUIDES = ("albedo", "normal", "coverage")


def _recording(spec: SceneSpec, packed: Packed, film: Film, aovs: Sequence[str], denoise: bool) -> "Recording | None":
    """What is gathered besides radiance; None where that is nothing."""
    if not aovs and not denoise:
        return None
    from raytracer.aovs.recording import Recording, known_aovs
    from raytracer.scene.identities import identify

    names = known_aovs([*aovs, *(_GUIDES if denoise else ())])
    height, width = film.count.shape
    return Recording(names, height, width, identify(spec, packed))


def _with_layers(image: Image, film: Film, recording: "Recording", aovs: Sequence[str]) -> Image:
    """The image with the AOVs that were asked for."""
    return replace(
        image,
        settings={**image.settings, **recording.settings(aovs)},
        layers={name: recording.develop(name, film) for name in aovs},
        channels=recording.channels(aovs),
    )


def _denoised(image: Image, film: Film, recording: "Recording", threads: int) -> Image:
    """The image without its noise, as far as the denoiser can tell."""
    from raytracer.film.denoise import denoise

    albedo, normal, coverage = (recording.develop(name, film) for name in _GUIDES)
    return denoise(image, coverage[..., None] * albedo, coverage[..., None] * normal, threads=threads)


class _Clock:
    """Seconds by phase."""

    def __init__(self, seconds: dict[str, float], load_seconds: float) -> None:
        self._seconds = seconds
        seconds["load"] = load_seconds
        self._start = time.perf_counter()

    def lap(self, phase: str) -> None:
        """Count what has passed since the last lap as this phase's."""
        now = time.perf_counter()
        self._seconds[phase] = self._seconds.get(phase, 0.0) + now - self._start
        self._start = now


def _window(spec: SceneSpec, crop: tuple[int, int, int, int] | None) -> Window:
    width, height = spec.film.width, spec.film.height
    if crop is None:
        return Window(0, 0, width, height)
    window = Window(*crop)
    if not (0 <= window.left < window.right <= width and 0 <= window.top < window.bottom <= height):
        corners = ",".join(map(str, crop))
        raise InputError(f"crop {corners} must lie within the film, 0,0,{width},{height}, and hold at least a pixel")
    return window


def _header(spec: SceneSpec, crop: tuple[int, int, int, int] | None) -> Mapping[str, str | float | int]:
    """Settings for the headers of image files."""
    settings = spec.render
    header: dict[str, str | float | int] = {
        "renderer": f"rt {__version__}",
        "spp": settings.spp,
        "max_depth": settings.max_depth,
        "sampler": settings.sampler,
        "accuracy": settings.accuracy,
        "seed": settings.seed,
        "filter": spec.film.filter.type,
        "camera": spec.camera.type,
    }
    if crop is not None:
        header["crop"] = ",".join(map(str, crop))
    return header


class _Tile(NamedTuple):
    """Pixels that one thread works on, and the first sample that they still lack."""

    window: Window
    begin: int


class _Job:
    """Tiles in a queue, taken by threads: pass after pass over the picture, each with more samples than the last.

    A tile goes back to the end of the queue after a pass, so its samples are added in order whoever adds them, and
    an early end leaves a whole picture.
    """

    def __init__(self, scene: Scene, target: FilmView, window: Window, spp: int, time_limit: float | None) -> None:
        self._scene, self._target, self._spp = scene, target, spp
        self._queue: deque[_Tile] = deque(_Tile(tile, 0) for tile in _tiles(window))
        self._wanted = (window.right - window.left) * (window.bottom - window.top) * spp
        self._done = 0
        self._start = time.perf_counter()
        self._deadline = None if time_limit is None else self._start + time_limit
        self._stopped = threading.Event()
        self._lock = threading.Lock()
        self._failure: BaseException | None = None
        self.rays = 0
        self.interrupted = False

    @property
    def is_complete(self) -> bool:
        """Whether every pixel has all its samples."""
        return self._done == self._wanted

    def run(self, threads: int, progress: Callable[[Progress], None] | None) -> None:
        """Work until all is done, the time is up, or the caller interrupts; then the running tiles are finished."""
        workers = [threading.Thread(target=self._work, daemon=True) for _ in range(threads)]
        for worker in workers:
            worker.start()
        try:
            for worker in workers:
                while worker.is_alive():
                    worker.join(_WAKE_UP_SECONDS)
                    if progress is not None:
                        progress(Progress(self._done, self._wanted, time.perf_counter() - self._start))
        except KeyboardInterrupt:
            self.interrupted = True
        finally:
            self._stopped.set()
            for worker in workers:
                worker.join()
        if self._failure is not None:
            raise self._failure

    def _work(self) -> None:
        room = workspace()
        while not self._stopped.is_set():
            try:
                tile = self._queue.popleft()
            except IndexError:
                return
            end = _pass_end(tile.begin, self._spp)
            try:
                rays = render_tile(self._scene, self._target, room, *tile.window, tile.begin, end)
            except BaseException as error:  # noqa: BLE001
                # Raised where the threads are waited for.
                self._failure = error
                self._stopped.set()
                return
            self._finish(tile, end, rays)

    def _finish(self, tile: _Tile, end: int, rays: int) -> None:
        left, top, right, bottom = tile.window
        with self._lock:
            self.rays += rays
            self._done += (right - left) * (bottom - top) * (end - tile.begin)
        if end < self._spp:
            self._queue.append(_Tile(tile.window, end))
        if self._deadline is not None and time.perf_counter() >= self._deadline:
            self._stopped.set()


def _tiles(window: Window) -> list[Window]:
    """The window cut into squares, row by row."""
    return [
        Window(left, top, min(left + TILE, window.right), min(top + TILE, window.bottom))
        for top in range(window.top, window.bottom, TILE)
        for left in range(window.left, window.right, TILE)
    ]


def _pass_end(begin: int, spp: int) -> int:
    """Where the pass that starts at sample `begin` ends; always a whole number of packets, but for the last."""
    return min(spp, begin + min(_LONGEST_PASS, max(_FIRST_PASS, 3 * begin)))
