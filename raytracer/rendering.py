"""Rendering, as five calls on explicit state: load, pack, build, render, develop."""

import math
import sys
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer import __version__
from raytracer.adaptive import Adaptive, Aim, Outcome, Pilots
from raytracer.development import check_development, finish, recording_of
from raytracer.embree import Accel
from raytracer.errors import InputError, SceneWarning
from raytracer.film.exposure import Setting
from raytracer.film.image import Image
from raytracer.integrator import FilmView, Scene
from raytracer.noise import Estimate, Tally, steepest_of
from raytracer.noise.fireflies import Fireflies, find_fireflies
from raytracer.noise.rates import SHALLOWEST
from raytracer.preparation import compile_for, film_for, view
from raytracer.replay import brightest_of, first_dropped, samples
from raytracer.sampling import SAMPLERS
from raytracer.scene.concerns import heed
from raytracer.scene.effects import effects_of
from raytracer.scene.pack import Packed, pack
from raytracer.scene.spec import SceneSpec
from raytracer.scheduling import FIRST_PASS, TILE, Canvas, Crew, Window, available_threads, now, tiles

if TYPE_CHECKING:
    from raytracer.aovs.recording import Recording


class Progress(NamedTuple):
    """How far a render is: samples done and wanted over all pixels, and seconds since its start.

    Where the samples are not given, `wanted` is a guess, and `error` the relative error as last estimated, or None.
    """

    done: int
    wanted: int
    seconds: float
    error: float | None = None


@dataclass
class Stats:
    """What a render took.

    seconds, by phase; rays, camera, bounce and shadow rays; samples, over all pixels; spp, the fewest, mean and most of
    them a pixel; pilot_samples, those besides that were thrown away; nan_samples, samples dropped because they were not
    finite; first_nan, `pixel` (x, y) and `sample` of the first of them, row by row, or None; fireflies, `pixels` that
    one sample has made far brighter than those around, `light`, by which part of the picture's light, `brightest` (x,
    y), the `sample` that made it so, and `clamp`, a limit for radiance that would take them away, or None; empty
    without any; clamp, its `limit`, and the parts of the `light` that it took and of the `samples` that it did so from;
    empty without one; error, `relative` (RMS, of the light that reached the film, before it was denoised), `low` and
    `high`, the ends of its 95 % interval, the local `exponent` of its square over samples, and `target`, if one was
    given; empty below 16 samples a pixel; threads; effects, the names of those simulated; exposure, its numbers by
    name, none for a picture of plain radiance; peak_rss_bytes, of the process.
    """

    seconds: dict[str, float] = field(default_factory=dict)
    rays: int = 0
    samples: int = 0
    spp: dict[str, float] = field(default_factory=dict)
    pilot_samples: int = 0
    nan_samples: int = 0
    first_nan: dict[str, Any] | None = None
    fireflies: dict[str, Any] = field(default_factory=dict)
    clamp: dict[str, float] = field(default_factory=dict)
    error: dict[str, float] = field(default_factory=dict)
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

    complete, whether all samples were taken, or the error asked for was reached; interrupted, whether a
    KeyboardInterrupt ended it early;
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


def render(
    spec: SceneSpec,
    *,
    spp: int | None = None,
    seed: int | None = None,
    threads: int | None = None,
    crop: tuple[int, int, int, int] | None = None,
    noise: float | None = None,
    time_limit: float | None = None,
    aovs: Sequence[str] = (),
    denoise: bool = False,
    progress: Callable[[Progress], None] | None = None,
    load_seconds: float = 0.0,
    rehearse: Callable[[Image], object] | None = None,
    warn: Callable[[str], object] | None = None,
    strict: bool = False,
) -> Rendered:
    """Render a scene.  The same scene, seed and spp, or noise, give the same bits for any number of threads.

    Parameters
    ----------
    spp, seed : in place of the scene's.
    threads : how many work; all processors if None.
    crop : (x0, y0, x1, y1), the pixels x0 <= x < x1, y0 <= y < y1 only; they are those of the whole picture, but that
        `exposure: auto` and `white_balance: auto` measure these alone, and a Bayer mosaic ends at their edges.
    noise : the relative error (`noise.metric`) to stop at, 0.01 for 1 %.  Samples go where they are needed, at most
        `spp` a pixel, without a limit if that is None.
    time_limit : seconds after which the image is to be there, `load_seconds` included; what takes samples then ends
        early, but no sooner than with 8 a pixel.  Without `spp` samples go where they are needed.
    aovs : names of AOVs, which become layers of the image (docs/aovs.md); the radiance keeps its bits.
    denoise : whether Open Image Denoise is to clean the image, which then is biased.
    progress : called about ten times a second; a KeyboardInterrupt out of it, or out of a signal, ends the render
        early with the samples taken so far.
    rehearse : what the caller will do with the image, to be done once with an early one, so that `time_limit` leaves
        the time for it.
    warn : told what the scene makes one doubt, a sentence each, before anything is rendered (docs/warnings.md).
    strict : whether that counts as an error.

    Raises
    ------
    StrictError : there is such a doubt, and `strict`.
    InputError : a crop outside the film, a noise or limit out of range, a scene that cannot be packed, an unknown AOV,
        no denoiser, or what `check_process` refuses.
    """
    if denoise:
        from raytracer.film.denoise import require_denoiser

        require_denoiser()
    _check_ends(noise, time_limit)
    stats = Stats(threads=threads or available_threads())
    clock = _Clock(stats.seconds, load_seconds)
    spec = _with_settings(spec, spp, seed)
    window = _window(spec, crop)

    packed = pack(spec)
    heed(packed, warn, strict=strict)
    check_development(packed.spec, window)
    stats.effects = [name for name, effect in effects_of(packed.spec, packed.scene).items() if effect.active]
    clock.lap("pack")
    accel = packed.build()
    clock.lap("build")
    sheet = _Sheet(packed, accel, window, aovs, stats.threads if denoise else None)
    compile_for(sheet.scene, sheet.target)
    clock.lap("compile")

    # Render a first picture, by which to see how long the end will take.
    is_adaptive = noise is not None or (time_limit is not None and spp is None)
    most = None if is_adaptive and spp is None else spec.render.spp
    watch = _Watch(progress, window.pixels * spec.render.spp)
    canvas = sheet.canvas(Crew(stats.threads, watch.tick))
    watch.canvas = canvas
    canvas.first_pass(FIRST_PASS if most is None else most)
    clock.lap("render")
    deadline = None
    if time_limit is not None and not canvas.crew.stopped:
        with canvas.crew.heeding():
            deadline = clock.began + time_limit - sheet.seconds_to_finish(rehearse)
        clock.lap("develop")

    # Render the rest.
    outcome = Outcome(reached=False, pilot_samples=0, pilot_rays=0)
    if is_adaptive:
        adaptive = Adaptive(canvas, sheet.pilots(), Aim(noise, most, deadline))
        with canvas.crew.heeding():
            adaptive.run(watch.expect)
        outcome = adaptive.outcome
    else:
        canvas.by_turns(spec.render.spp, deadline)
        outcome = outcome._replace(reached=bool(canvas.counts.min() >= spec.render.spp))
    with canvas.crew.heeding():
        stats.error = _error(canvas.estimate(), noise)
    clock.lap("render")

    _account(stats, canvas, outcome)
    with canvas.crew.heeding():
        sheet.diagnose(stats)
    clock.lap("render")
    image, setting = sheet.finished(_header(packed.spec, crop, stats, is_adaptive=is_adaptive), clock.lap)
    stats.exposure = {} if setting is None else setting.numbers()
    stats.seconds["total"] = sum(stats.seconds.values())
    stats.peak_rss_bytes = peak_rss_bytes()
    is_complete = outcome.reached and not canvas.crew.interrupted
    return Rendered(image, stats, is_complete, canvas.crew.interrupted, int(canvas.counts.min()), setting)


def render_image(
    scene: SceneSpec,
    *,
    spp: int | None = None,
    seed: int | None = None,
    threads: int | None = None,
    crop: tuple[int, int, int, int] | None = None,
    noise: float | None = None,
    time_limit: float | None = None,
    aovs: Sequence[str] = (),
    denoise: bool = False,
    strict: bool = False,
) -> Image:
    """The image of a scene: `image.radiance` is float64 (height, width, 3), row 0 at the top.  See `render`.

    What the scene makes one doubt is a SceneWarning, or an error if `strict`.
    """
    return render(
        scene,
        spp=spp,
        seed=seed,
        threads=threads,
        crop=crop,
        noise=noise,
        time_limit=time_limit,
        aovs=aovs,
        denoise=denoise,
        warn=_warn,
        strict=strict,
    ).image


def _warn(sentence: str) -> None:
    """Warn at the line that called `render_image`."""
    warnings.warn(sentence, SceneWarning, stacklevel=5)


class _Sheet:
    """A scene that is built, and the film that a part of its picture gathers on.

    scene, with the address of the ray caster's structure; film; target, the film as kernels see it.
    """

    def __init__(
        self, packed: Packed, accel: Accel, window: Window, aovs: Sequence[str], denoise_threads: int | None
    ) -> None:
        self._packed, self._window, self._aovs, self._denoise_threads = packed, window, aovs, denoise_threads
        # Held, since its address is all that the scene knows of it.
        self._accel = accel
        self._windows = tiles(window)
        self.scene = packed.scene._replace(accel=accel.address)
        height, width = window.bottom - window.top, window.right - window.left
        self._recording = self._record(height, width)
        self.film = film_for(self.scene, width, height)
        aov_view = None if self._recording is None else self._recording.view
        self.target = view(self.film, window.left, window.top, aov_view)

    def _record(self, height: int, width: int) -> "Recording | None":
        denoise = self._denoise_threads is not None
        return recording_of(self._packed.spec, self._packed, height, width, self._aovs, denoise=denoise)

    def _tally(self) -> Tally:
        return Tally(self._windows, steepest_of(self._packed.spec.render.sampler))

    def canvas(self, crew: Crew) -> Canvas:
        """The film for a crew to work on."""
        return Canvas(self.scene, self.target, self._windows, crew, self._tally())

    def pilots(self) -> Pilots:
        """How to take samples that do not get onto the film."""
        settings = self._packed.spec.render

        def sampled(seed: int, spp: int) -> Scene:
            return self.scene._replace(sampler=SAMPLERS[settings.sampler](seed, spp))

        # Its shares want but one difference, for which it takes half the memory.
        return Pilots(sampled, self._scratch, lambda: Tally(self._windows, SHALLOWEST), settings.seed)

    def _scratch(self) -> FilmView:
        """A film of one tile, of the same type as the picture's."""
        recording = self._record(TILE, TILE)
        return view(film_for(self.scene, TILE, TILE), aovs=None if recording is None else recording.view)

    def diagnose(self, stats: Stats) -> None:
        """Note what is wrong with the samples on the film."""
        film, limit = self.film, self._packed.spec.render.clamp
        stats.nan_samples = int(film.nan_count.sum())
        if film.removed is not None and limit is not None:
            stats.clamp = {"limit": limit, **_taken_by_clamp(film.mean, film.count, film.removed)}
        if stats.nan_samples:
            row, column = (int(place) for place in np.argwhere(film.nan_count)[0])
            x, y = self.target.left + column, self.target.top + row
            sample = first_dropped(self.scene, self._scratch(), x, y, self._taken(row, column))
            stats.first_nan = {"pixel": [x, y], "sample": sample}
        found = find_fireflies(film.mean, film.m2, film.count)
        if found is not None:
            stats.fireflies = self._of_fireflies(found)

    def _taken(self, row: int, column: int) -> int:
        """Samples that a pixel of the film was given."""
        return int(self.film.count[row, column] + self.film.nan_count[row, column])

    def _of_fireflies(self, found: Fireflies) -> dict[str, Any]:
        """What `Stats` tells of fireflies."""
        row, column = found.brightest
        x, y = self.target.left + column, self.target.top + row
        packets = list(samples(self.scene, self._scratch(), x, y, self._taken(row, column)))
        limit = found.limit
        if limit is not None:
            # From the film's unit to that of radiance, by what the camera's rays count for there.
            weights = np.concatenate([packet.weights for packet in packets])
            weights = weights[weights > 0.0]
            limit = float(f"{limit / weights.mean():.2g}") if len(weights) else None
        return {
            "pixels": found.pixels,
            "light": found.light,
            "brightest": [x, y],
            "sample": brightest_of(packets),
            "clamp": limit,
        }

    def finished(
        self, settings: Mapping[str, str | float | int], lap: Callable[[str], object]
    ) -> tuple[Image, Setting | None]:
        """The image on the film, and how it was exposed."""
        return finish(
            self.film,
            self._packed.spec,
            self._window,
            settings,
            self._recording,
            self._aovs,
            self._denoise_threads,
            lap,
        )

    def seconds_to_finish(self, rehearse: Callable[[Image], object] | None) -> float:
        """How long it takes to look at the film, make an image of it, and for the caller to do with it what it does."""
        begin = now()
        self.diagnose(Stats())
        image, _ = self.finished({}, lambda phase: None)
        if rehearse is not None:
            rehearse(image)
        return now() - begin


class _Watch:
    """Tells the caller how far a render is."""

    def __init__(self, progress: Callable[[Progress], None] | None, wanted: int) -> None:
        self._progress, self._wanted = progress, wanted
        self._error: float | None = None
        self._start = now()
        self.canvas: Canvas | None = None

    def tick(self) -> None:
        """Report to the caller."""
        if self._progress is not None and self.canvas is not None:
            done = self.canvas.done
            self._progress(Progress(done, max(self._wanted, done), now() - self._start, self._error))

    def expect(self, samples: float, estimate: Estimate | None) -> None:
        """Note where an adaptive render is likely to end, and its error as it is."""
        self._wanted, self._error = round(samples), None if estimate is None else estimate.error


class _Clock:
    """Seconds by phase.

    began : when the command did, by `scheduling.now`.
    """

    def __init__(self, seconds: dict[str, float], load_seconds: float) -> None:
        self._seconds = seconds
        seconds["load"] = load_seconds
        self._start = now()
        self.began = self._start - load_seconds

    def lap(self, phase: str) -> None:
        """Count what has passed since the last lap as this phase's."""
        end = now()
        self._seconds[phase] = self._seconds.get(phase, 0.0) + end - self._start
        self._start = end


def _with_settings(spec: SceneSpec, spp: int | None, seed: int | None) -> SceneSpec:
    given = {name: value for name, value in (("spp", spp), ("seed", seed)) if value is not None}
    return spec.model_copy(update={"render": spec.render.model_copy(update=given)})


def _check_ends(noise: float | None, time_limit: float | None) -> None:
    if noise is not None and not 0.0 < noise < 1.0:
        raise InputError(f"noise must lie between 0 and 1, and is 0.01 for 1 %, got {noise:g}")
    if time_limit is not None and not 0.0 < time_limit < math.inf:
        raise InputError(f"a time limit must be greater than 0 and finite, got {time_limit:g}")


def _error(estimate: Estimate | None, noise: float | None) -> dict[str, float]:
    """What is known of the picture's error, for `Stats`."""
    if estimate is None:
        return {}
    error = {"relative": estimate.error, "low": estimate.low, "high": estimate.high, "exponent": estimate.exponent}
    return error if noise is None else {**error, "target": noise}


def _taken_by_clamp(
    mean: NDArray[np.float64], count: NDArray[np.int64], removed: NDArray[np.float64]
) -> dict[str, float]:
    """The parts of the light that a clamp took, and of the samples that it did so from."""
    lost = removed[..., :3] / np.maximum(count, 1)[..., None]
    whole, samples = float(mean.sum() + lost.sum()), int(count.sum())
    return {
        "light": float(lost.sum()) / whole if whole else 0.0,
        "samples": float(removed[..., 3].sum()) / samples if samples else 0.0,
    }


def _account(stats: Stats, canvas: Canvas, outcome: Outcome) -> None:
    """Note what was sampled."""
    stats.rays = int(canvas.rays.sum()) + outcome.pilot_rays
    stats.samples, stats.pilot_samples = canvas.done, outcome.pilot_samples
    stats.spp = {"fewest": int(canvas.counts.min()), "mean": canvas.samples, "most": int(canvas.counts.max())}


def _window(spec: SceneSpec, crop: tuple[int, int, int, int] | None) -> Window:
    width, height = spec.film.width, spec.film.height
    if crop is None:
        return Window(0, 0, width, height)
    window = Window(*crop)
    if not (0 <= window.left < window.right <= width and 0 <= window.top < window.bottom <= height):
        corners = ",".join(map(str, crop))
        raise InputError(f"crop {corners} must lie within the film, 0,0,{width},{height}, and hold at least a pixel")
    return window


def _header(
    spec: SceneSpec, crop: tuple[int, int, int, int] | None, stats: Stats, *, is_adaptive: bool
) -> Mapping[str, str | float | int]:
    """Settings for the headers of image files."""
    settings = spec.render
    header: dict[str, str | float | int] = {
        "renderer": f"rt {__version__}",
        "spp": stats.spp["mean"] if is_adaptive else settings.spp,
        "max_depth": settings.max_depth,
        "sampler": settings.sampler,
        "accuracy": settings.accuracy,
        "seed": settings.seed,
        "filter": spec.film.filter.type,
        "camera": spec.camera.type,
    }
    if is_adaptive:
        header |= {"spp_fewest": stats.spp["fewest"], "spp_most": stats.spp["most"]}
    if stats.error:
        names = {"relative": "relative_error", "low": "relative_error_low", "high": "relative_error_high"}
        header |= {name: stats.error[key] for key, name in names.items()}
    if "target" in stats.error:
        header["noise"] = stats.error["target"]
    if stats.clamp:
        header |= {"clamp": stats.clamp["limit"], "clamp_took": stats.clamp["light"]}
    if crop is not None:
        header["crop"] = ",".join(map(str, crop))
    return header
