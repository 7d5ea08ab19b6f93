"""Rendering, as five calls on explicit state: load, pack, build, render, develop."""

import contextlib
import math
import os
import sys
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer import __version__, memory
from raytracer.accumulation import FilmView
from raytracer.adaptive import Adaptive, Aim, Outcome, Pilots, Standing
from raytracer.checkpoints import Keeper, identity_of
from raytracer.development import check_development, finish, negative_causes, recording_of
from raytracer.embree import PACKET, Accel
from raytracer.errors import InputError, OutputError, SceneWarning
from raytracer.film.exposure import Setting
from raytracer.film.film import Film
from raytracer.film.image import Image
from raytracer.film.negative import find_negatives
from raytracer.integrator import Scene
from raytracer.interior import ranks_of
from raytracer.jit import alone
from raytracer.noise import Estimate, Tally, steepest_of
from raytracer.noise.fireflies import Fireflies, find_fireflies
from raytracer.noise.rates import SHALLOWEST
from raytracer.noise.wording import percent
from raytracer.preparation import compile_for, film_for, view
from raytracer.progress import Bar
from raytracer.replay import brightest_of, first_dropped, samples
from raytracer.sampling import SAMPLERS
from raytracer.scene.concerns import heed
from raytracer.scene.effects import effects_of
from raytracer.scene.inputs import Stamp, stamps
from raytracer.scene.load import load
from raytracer.scene.pack import Packed, pack
from raytracer.scene.spec import MAX_PIXELS, SceneSpec
from raytracer.scheduling import (
    FIRST_PASS,
    TILE,
    Canvas,
    Crew,
    Elsewhere,
    Window,
    Workforce,
    available_threads,
    now,
    tiles,
)
from raytracer.stock import Stock

if TYPE_CHECKING:
    from raytracer.aovs.recording import Recording

# What counters of the kernels hold, and what a machine may have.
_MOST_SPP, _MOST_SEED, _MOST_THREADS = 2**31 - 1, 2**32 - 1, 1024


class Progress(NamedTuple):
    """How far a render is: samples done and wanted over all pixels, and seconds since its start.

    Where the samples are not given, `wanted` is a guess, and `error` the relative error as last estimated, or None.
    Of those done, `resumed` were there before the start.
    """

    done: int
    wanted: int
    seconds: float
    error: float | None = None
    resumed: int = 0


@dataclass
class Stats:
    """What a render took.

    seconds, by phase; rays, camera, bounce and shadow rays; samples, over all pixels; spp, the fewest, mean and most of
    them a pixel; pilot_samples, those besides that were thrown away; resumed, the `samples` and `rays` of these that a
    checkpoint had, and the `seconds` that they took; empty without one; nan_samples, samples dropped because they were
    not finite; first_nan, `pixel` (x, y) and `sample` of the first of them, row by row, or None; fireflies, `pixels`
    that one sample has made far brighter than those around, `light`, by which part of the picture's light, `brightest`
    (x, y), the `sample` that made it so, and `clamp`, a limit for radiance that would take them away, or None; empty
    without any; negative_pixels, those of the finished picture with a channel below zero; negative, the `lowest` value
    of any, its `pixel` (x, y), and the `causes` that the scene has for them (film/negative.py); empty without any;
    clamp, its `limit`, and the parts of the `light` that it took and of the `samples` that it did so from; empty
    without one; error, `relative` (RMS, of the light that reached the film, before it was denoised), `low` and `high`,
    the ends of its 95 % interval, the local `exponent` of its square over samples, and `target`, if one was given;
    empty below 16 samples a pixel; threads, those of a cluster's workers included, whose names are `workers`, none
    without a cluster; effects, the names of those simulated; exposure, its numbers by name, none for a picture of plain
    radiance; peak_rss_bytes, of the process.
    """

    seconds: dict[str, float] = field(default_factory=dict)
    rays: int = 0
    samples: int = 0
    spp: dict[str, float] = field(default_factory=dict)
    pilot_samples: int = 0
    resumed: dict[str, float] = field(default_factory=dict)
    nan_samples: int = 0
    first_nan: dict[str, Any] | None = None
    fireflies: dict[str, Any] = field(default_factory=dict)
    negative_pixels: int = 0
    negative: dict[str, Any] = field(default_factory=dict)
    clamp: dict[str, float] = field(default_factory=dict)
    error: dict[str, float] = field(default_factory=dict)
    threads: int = 0
    workers: list[str] = field(default_factory=list)
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
    fewest_samples, of any pixel (image.samples is the most); setting, how it was exposed, None for plain radiance;
    failure, why a cluster ended it early, None if none did.
    """

    image: Image
    stats: Stats
    complete: bool
    interrupted: bool
    fewest_samples: int
    setting: Setting | None
    failure: str | None = None


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
    stock: Stock | None = None,
    cluster: Workforce | None = None,
    keeper: Keeper | None = None,
    max_memory: int | None = None,
) -> Rendered:
    """Render a scene.  The same scene, seed and spp, or noise, give the same bits for any number of threads.

    It may be called by several threads at once.

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
    stock : what renders of like scenes share; nothing is kept if None.
    cluster : who takes the samples; this machine if None.
    keeper : keeps what is gathered in a file, and takes up what is there; nothing is kept if None.
    max_memory : bytes that this process may take; what the machine has, as far as it is known, if None.

    Raises
    ------
    StrictError : there is such a doubt, and `strict`.
    InputError : a crop outside the film, a noise or limit out of range, a scene that cannot be packed, an unknown AOV,
        no denoiser, what `check_process` refuses, a cluster that cannot render this, more memory needed than there is
        (`memory.check`), or a checkpoint of another picture.
    """
    prepared = ready(
        spec,
        spp=spp,
        seed=seed,
        threads=threads,
        crop=crop,
        noise=noise,
        time_limit=time_limit,
        aovs=aovs,
        denoise=denoise,
        load_seconds=load_seconds,
        warn=warn,
        strict=strict,
        stock=stock,
        cluster=cluster,
        max_memory=max_memory,
        keeps=keeper is not None,
    )
    return prepared.render(progress=progress, rehearse=rehearse, keeper=keeper)


class SampleBar(Bar):
    """A bar in samples, with the error where one is aimed at.

    The end is told by the mean speed so far: that of the last moments is the speed of some tiles, sky or glass.
    """

    def __init__(self, *, always: bool = False, quiet: bool = False) -> None:
        super().__init__(" samples", always=always, quiet=quiet, unit_scale=True, smoothing=0.0)

    def show(self, progress: Progress) -> None:
        """Show how far a render is."""
        note = "" if progress.error is None else f"error {percent(progress.error)}"
        self.update(progress.done, progress.wanted, note, progress.resumed)


def render_image(
    scene: SceneSpec | str | os.PathLike[str],
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
    progress: bool | Callable[[Progress], None] = False,
    stock: Stock | None = None,
    cluster: Workforce | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
    resume: bool = False,
) -> Image:
    """The image of a scene, or of a scene file: `image.radiance` is float64 (height, width, 3), row 0 at the top.

    The arguments are those of `render`; `aovs` may also be one name.  What is gathered is kept in the file
    `checkpoint`, once a minute and at the end; with `resume` the render goes on from there.

    What the scene makes one doubt is a SceneWarning, or an error if `strict`.  `progress` shows a bar, also in a
    notebook; or it is a function that is called with a `Progress`.

    Raises
    ------
    OutputError : a cluster was lost before the picture was there.
    """
    with SampleBar(always=True) as bar:
        rendered = render(
            load(scene) if isinstance(scene, str | os.PathLike) else scene,
            spp=spp,
            seed=seed,
            threads=threads,
            crop=crop,
            noise=noise,
            time_limit=time_limit,
            aovs=[aovs] if isinstance(aovs, str) else aovs,
            denoise=denoise,
            progress=bar.show if progress is True else progress or None,
            warn=_warn,
            strict=strict,
            stock=stock,
            cluster=cluster,
            keeper=_keeper(checkpoint, resume=resume),
        )
    if rendered.failure is not None:
        raise OutputError(rendered.failure)
    return rendered.image


def _keeper(checkpoint: str | os.PathLike[str] | None, *, resume: bool) -> Keeper | None:
    """Who keeps what `render_image` gathers.

    Raises
    ------
    InputError : there is nothing to resume from.
    """
    if checkpoint is None:
        if resume:
            raise InputError("resume needs checkpoint, the file to go on from")
        return None
    return Keeper(checkpoint, resume=resume, always=True, say=_warn_of_files)


def _warn_of_files(sentence: str) -> None:
    """Warn of what happens to a checkpoint."""
    with alone:
        warnings.warn(sentence, RuntimeWarning, stacklevel=2)


def _warn(sentence: str) -> None:
    """Warn at the line that called `render_image`."""
    with alone:
        warnings.warn(sentence, SceneWarning, stacklevel=6)


def ready(
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
    load_seconds: float = 0.0,
    warn: Callable[[str], object] | None = None,
    strict: bool = False,
    stock: Stock | None = None,
    cluster: Workforce | None = None,
    max_memory: int | None = None,
    most_pixels: int | None = None,
    keeps: bool = False,
) -> "Ready":
    """Do all of a render but to take samples, so that the next scene is made ready while one is rendered.

    Parameters and errors are those of `render`, and besides:

    Parameters
    ----------
    most_pixels : how many are rendered at once, where the picture is made in parts.
    keeps : whether there will be checkpoints, which copy what was gathered.
    """
    if denoise:
        from raytracer.film.denoise import require_denoiser

        require_denoiser()
    _check_ends(noise, time_limit)
    threads = _whole("threads", threads, 1, _MOST_THREADS)
    seconds = {"load": load_seconds}
    clock = _Clock(seconds)
    spec = _with_settings(spec, spp, seed)
    window = _window(spec, crop)
    elsewhere = None
    if cluster is not None:
        elsewhere = cluster.engage(spec, aovs=aovs, denoise=denoise, warn=warn, strict=strict)

    before = stamps(spec) if keeps else {}
    packed = pack(spec, supplies=stock)
    heed(packed, warn, strict=strict)
    check_development(packed.spec, window)
    effects = effects_of(packed.spec, packed.scene)
    clock.lap("pack")
    is_adaptive = noise is not None or (time_limit is not None and spp is None)
    if is_adaptive and aovs:
        from raytracer.aovs.recording import by_sample

        for name in by_sample(aovs):
            raise InputError(f"the AOV {name} needs as many samples in every pixel: give spp and no noise")
    asked = _Asked(
        window=window,
        crop=crop,
        aovs=tuple(aovs),
        denoises=denoise,
        noise=noise,
        time_limit=time_limit,
        most=None if is_adaptive and spp is None else spec.render.spp,
        is_adaptive=is_adaptive,
        threads=threads or available_threads(),
    )
    pixels = window.pixels if most_pixels is None else min(window.pixels, most_pixels)
    picture = memory.picture_of(packed, pixels, asked.most, asked.aovs, denoises=denoise, keeps=keeps)
    memory.check(memory.estimate(memory.structure_of(packed, stock), picture, asked.threads), max_memory)
    clock.lap("pack")
    accel = packed.build(stock)
    clock.lap("build")
    names = tuple(name for name, effect in effects.items() if effect.active)
    scene = packed.scene._replace(accel=accel.address)
    found = Ready(packed, accel, scene, names, asked, elsewhere, seconds, before)
    if elsewhere is None:
        kernels = compile_for(found.scene, found.film(TILE, TILE).view())
        if stock is not None:
            stock.note_kernels(kernels)
    clock.lap("compile")
    return found


class _Asked(NamedTuple):
    """What was asked for: `render`'s settings, checked.

    most, samples a pixel, None without a limit; is_adaptive, whether samples go where they are needed.
    """

    window: Window
    crop: tuple[int, int, int, int] | None
    aovs: tuple[str, ...]
    denoises: bool
    noise: float | None
    time_limit: float | None
    most: int | None
    is_adaptive: bool
    threads: int


@dataclass(frozen=True)
class Ready:
    """A scene that is packed, built and compiled, and can be rendered, several times if need be.

    Attributes
    ----------
    packed : the scene, its camera focused at a distance.
    accel : the ray caster's structure, which lives as long as this does.
    scene : as kernels take it, with the structure's address.
    effects : the names of those that are simulated.
    asked : what the picture is to be.
    elsewhere : who takes the samples; the threads of this process if None.
    seconds : what was done so far took, by phase: load, pack, build and compile.
    stamps : of the files of the scene, before they were read (`inputs.stamps`); none where no checkpoints are kept.
    """

    packed: Packed
    accel: Accel
    scene: Scene
    effects: tuple[str, ...]
    asked: _Asked
    elsewhere: Elsewhere | None
    seconds: dict[str, float]
    stamps: Mapping[Path, Stamp]

    def part(self, window: Window) -> "Ready":
        """The same for a part of the picture; its pixels are those of the whole."""
        return replace(self, asked=self.asked._replace(window=window))

    def film(self, height: int, width: int, left: int = 0, top: int = 0) -> "_Sheet":
        """An empty film for a part of the picture."""
        asked = self.asked
        recording = recording_of(self.packed.spec, self.packed, height, width, asked.aovs, denoise=asked.denoises)
        return _Sheet(film_for(self.scene, width, height), recording, left, top)

    def render(
        self,
        *,
        progress: Callable[[Progress], None] | None = None,
        rehearse: Callable[[Image], object] | None = None,
        keeper: Keeper | None = None,
    ) -> Rendered:
        """Take the samples, and develop the picture; parameters are those of `rendering.render`.

        Raises
        ------
        InputError : the picture has too many pixels to be held at once, or a checkpoint is of another one.
        """
        asked = self.asked
        _check_size(asked.window)
        stats = Stats(threads=asked.threads, seconds=dict(self.seconds), effects=list(self.effects))
        spec = self.packed.spec
        clock = _Clock(stats.seconds)
        render = _Render(self)

        # Go on from what is there.
        watch = _Watch(progress, asked.window.pixels * spec.render.spp)
        canvas = render.canvas(Crew(asked.threads, watch.tick, solids=ranks_of(self.scene.interior)))
        gathering = _Gathering(self, render, canvas, clock)
        if keeper is not None:
            keeper.resume(gathering)
            if gathering.resumed:
                clock.lap("resume")
        stats.resumed = gathering.resumed
        watch.begin(canvas)

        deadline = None
        with canvas.crew.heeding(), contextlib.nullcontext() if keeper is None else keeper.watching(gathering):
            # Render a first picture, by which to see how long the end will take.
            canvas.first_pass(FIRST_PASS if asked.most is None else asked.most)
            clock.lap("render")
            if asked.time_limit is not None and not canvas.crew.stopped:
                deadline = clock.began + asked.time_limit - render.seconds_to_finish(rehearse)
                clock.lap("develop")

            # Render the rest.
            if asked.is_adaptive:
                adaptive = Adaptive(canvas, render.pilots(), Aim(asked.noise, asked.most, deadline), gathering.standing)
                gathering.adaptive = adaptive
                adaptive.run(watch.expect)
            else:
                canvas.by_turns(gathering.goal if keeper is not None else spec.render.spp, deadline)
        clock.lap("render")
        if keeper is not None:
            with canvas.crew.heeding():
                keeper.finish(gathering)
            if keeper.held is not None:
                clock.lap("keep")
        if not asked.is_adaptive:
            canvas.by_turns(spec.render.spp, deadline)
        outcome = gathering.outcome
        with canvas.crew.heeding():
            stats.error = _error(canvas.estimate(), asked.noise)
        clock.lap("render")

        _account(stats, canvas, outcome)
        with canvas.crew.heeding():
            render.diagnose(stats)
        clock.lap("render")
        header = _header(spec, asked.crop, stats, is_adaptive=asked.is_adaptive)
        image, setting = render.finished(header, clock.lap, is_final=True)
        stats.exposure = {} if setting is None else setting.numbers()
        render.diagnose_picture(image, stats)
        stats.seconds["total"] = sum(stats.seconds.values())
        stats.peak_rss_bytes = peak_rss_bytes()
        interrupted = canvas.crew.interrupted
        complete = outcome.reached and not interrupted
        return Rendered(image, stats, complete, interrupted, int(canvas.counts.min()), setting, canvas.crew.failure)


class _Sheet(NamedTuple):
    """A film, with what is recorded on it besides radiance, for a part of the picture from (left, top) on."""

    film: Film
    recording: "Recording | None"
    left: int
    top: int

    def view(self) -> FilmView:
        """As kernels see it."""
        return view(self.film, self.left, self.top, None if self.recording is None else self.recording.view)


class _Render:
    """What a scene that is ready gathers on a film."""

    def __init__(self, ready: Ready) -> None:
        window = ready.asked.window
        self._ready, self._spec, self._scene = ready, ready.packed.spec, ready.scene
        self._windows = tiles(window)
        self._sheet = ready.film(window.bottom - window.top, window.right - window.left, window.left, window.top)

    def _tally(self) -> Tally:
        return Tally(self._windows, steepest_of(self._spec.render.sampler))

    def canvas(self, crew: Crew) -> Canvas:
        """The film for a crew to work on."""
        return Canvas(self._scene, self._sheet.view(), self._windows, crew, self._tally(), self._ready.elsewhere)

    def pilots(self) -> Pilots:
        """How to take samples that do not get onto the film."""
        settings = self._spec.render

        def sampled(seed: int, spp: int) -> Scene:
            return self._scene._replace(sampler=SAMPLERS[settings.sampler](seed, spp))

        # Its shares want but one difference, for which it takes half the memory.
        return Pilots(sampled, self._scratch, lambda: Tally(self._windows, SHALLOWEST), settings.seed)

    def _scratch(self) -> FilmView:
        """A film of one tile, of the same type as the picture's."""
        return self._ready.film(TILE, TILE).view()

    def diagnose(self, stats: Stats) -> None:
        """Note what is wrong with the samples on the film."""
        film, limit = self._sheet.film, self._spec.render.clamp
        stats.nan_samples = int(film.nan_count.sum())
        if film.removed is not None and limit is not None:
            stats.clamp = {"limit": limit, **_taken_by_clamp(film.mean, film.count, film.removed)}
        if stats.nan_samples:
            row, column = (int(place) for place in np.argwhere(film.nan_count)[0])
            x, y = self._sheet.left + column, self._sheet.top + row
            sample = first_dropped(self._scene, self._scratch(), x, y, self._taken(row, column))
            stats.first_nan = {"pixel": [x, y], "sample": sample}
        found = find_fireflies(film.mean, film.m2, film.count)
        if found is not None:
            stats.fireflies = self._of_fireflies(found)

    def diagnose_picture(self, image: Image, stats: Stats) -> None:
        """Note what is wrong with the finished picture."""
        causes = negative_causes(self._spec, self._scene)
        found = find_negatives(image.radiance, causes, self._sheet.left, self._sheet.top)
        stats.negative_pixels, stats.negative = found

    def _taken(self, row: int, column: int) -> int:
        """Samples that a pixel of the film was given."""
        return int(self._sheet.film.count[row, column] + self._sheet.film.nan_count[row, column])

    def _of_fireflies(self, found: Fireflies) -> dict[str, Any]:
        """What `Stats` tells of fireflies."""
        row, column = found.brightest
        x, y = self._sheet.left + column, self._sheet.top + row
        packets = list(samples(self._scene, self._scratch(), x, y, self._taken(row, column)))
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
        self, settings: Mapping[str, str | float | int], lap: Callable[[str], object], *, is_final: bool = False
    ) -> tuple[Image, Setting | None]:
        """The image on the film, and how it was exposed; `is_final` as for `development.finish`."""
        asked, sheet = self._ready.asked, self._sheet
        threads = asked.threads if asked.denoises else None
        return finish(
            sheet.film,
            self._spec,
            asked.window,
            settings,
            sheet.recording,
            asked.aovs,
            threads,
            lap,
            is_final=is_final,
        )

    def seconds_to_finish(self, rehearse: Callable[[Image], object] | None) -> float:
        """How long it takes to look at the film, make an image of it, and for the caller to do with it what it does."""
        begin = now()
        self.diagnose(Stats())
        image, _ = self.finished({}, lambda phase: None)
        if rehearse is not None:
            rehearse(image)
        return now() - begin


class _Gathering:
    """A render under way, as its checkpoints see it.

    adaptive, what takes the samples where they are needed, once there is such a thing, and `standing`, from where it is
    to go on; resumed, what `Stats` tells of what was taken up.
    """

    def __init__(self, ready: Ready, render: _Render, canvas: Canvas, clock: "_Clock") -> None:
        self._ready, self._render, self._canvas, self._clock = ready, render, canvas, clock
        self.adaptive: Adaptive | None = None
        self.standing: Standing | None = None
        self.resumed: dict[str, float] = {}

    @property
    def crew(self) -> Crew:
        return self._canvas.crew

    @property
    def goal(self) -> int:
        """Samples a pixel that a checkpoint can hold of those that are wanted: packets that are whole."""
        spp = self._ready.packed.spec.render.spp
        return spp - spp % PACKET

    @property
    def samples(self) -> int:
        return int(self._canvas.counts.min())

    @property
    def is_empty(self) -> bool:
        # A packet that is not whole is only ever added after the last checkpoint, but for those of fewer samples.
        return (not self._ready.asked.is_adaptive and self.goal == 0) or self._canvas.done == 0

    @property
    def is_complete(self) -> bool:
        # Out of time, it has all that was asked for.
        return not self.crew.stopped or (not self._ready.asked.is_adaptive and self.samples >= self.goal)

    @property
    def seconds(self) -> float:
        return self._clock.seconds("render") + self.resumed.get("seconds", 0.0)

    @property
    def outcome(self) -> Outcome:
        """What came of the samples so far."""
        if self.adaptive is not None:
            return self.adaptive.outcome
        reached = bool(self._canvas.counts.min() >= self._ready.packed.spec.render.spp)
        return Outcome(reached=reached, pilot_samples=0, pilot_rays=0)

    def identity(self) -> Mapping[str, Any]:
        asked, spec = self._ready.asked, self._ready.packed.spec
        # Samplers that spread all samples of a pixel evenly depend on how many they are.
        sampler = self._ready.scene.sampler._asdict()
        rounds = {"noise": asked.noise, "spp": asked.most} if asked.is_adaptive else {}
        found = identity_of(
            spec,
            {
                "pixels": list(asked.window),
                "aovs": dict.fromkeys(sorted(asked.aovs), True),
                "denoise": asked.denoises,
                "adaptive": asked.is_adaptive,
                f"{spec.render.sampler} sampler": sampler,
                **rounds,
            },
        )
        changed = [path for path, stamp in stamps(spec).items() if self._ready.stamps.get(path) != stamp]
        if changed:
            raise InputError(f"{changed[0]}: has changed since it was read")
        return found

    def gathered(self) -> Mapping[str, NDArray[Any]]:
        if not self._ready.asked.is_adaptive:
            return self._canvas.gathered()
        standing = self.standing if self.adaptive is None else self.adaptive.standing
        rounds = (standing or Standing.initial(len(self._canvas.windows))).gathered()
        return {**self._canvas.gathered(), **{f"rounds/{name}": array for name, array in rounds.items()}}

    def told(self) -> Mapping[str, Any]:
        return {"seconds": self.seconds}

    def take_up(self, gathered: Mapping[str, NDArray[Any]], told: Mapping[str, Any]) -> None:
        canvas, asked = self._canvas, self._ready.asked
        most = int(canvas.counts.max())
        if not asked.is_adaptive and most > self._ready.packed.spec.render.spp:
            raise InputError(
                f"has up to {most} samples per pixel already, more than the {self._ready.packed.spec.render.spp} wanted"
            )
        if asked.is_adaptive:
            rounds = {name: gathered[f"rounds/{name}"] for name in Standing.initial(0).gathered()}
            self.standing = Standing.of(rounds)
        self.resumed = {
            "samples": canvas.done,
            "rays": int(canvas.rays.sum()),
            "seconds": float(told["seconds"]),
        }

    def picture(self) -> Image:
        stats = Stats()
        _account(stats, self._canvas, self.outcome)
        asked = self._ready.asked
        header = _header(self._ready.packed.spec, asked.crop, stats, is_adaptive=True)
        image, _ = self._render.finished(header, lambda phase: None)
        return image


class _Watch:
    """Tells the caller how far a render is."""

    def __init__(self, progress: Callable[[Progress], None] | None, wanted: int) -> None:
        self._progress, self._wanted = progress, wanted
        self._error: float | None = None
        self._start = now()
        self._canvas: Canvas | None = None
        self._resumed = 0

    def begin(self, canvas: Canvas) -> None:
        """Watch a canvas, and take what it has for the start."""
        self._canvas, self._resumed, self._start = canvas, canvas.done, now()

    def tick(self) -> None:
        """Report to the caller."""
        if self._progress is not None and self._canvas is not None:
            done = self._canvas.done
            passed = now() - self._start
            self._progress(Progress(done, max(self._wanted, done), passed, self._error, self._resumed))

    def expect(self, samples: float, estimate: Estimate | None) -> None:
        """Note where an adaptive render is likely to end, and its error as it is."""
        self._wanted, self._error = round(samples), None if estimate is None else estimate.error


class _Clock:
    """Seconds by phase.

    began : when the command would have, by `scheduling.now`, had it not paused between phases.
    """

    def __init__(self, seconds: dict[str, float]) -> None:
        """A clock that adds to the seconds of the phases so far."""
        self._seconds = seconds
        self._start = now()
        self.began = self._start - sum(seconds.values())

    def seconds(self, phase: str) -> float:
        """What a phase has taken so far, if it is the one under way or has been."""
        return self._seconds.get(phase, 0.0) + now() - self._start

    def lap(self, phase: str) -> None:
        """Count what has passed since the last lap as this phase's."""
        end = now()
        self._seconds[phase] = self._seconds.get(phase, 0.0) + end - self._start
        self._start = end


def _with_settings(spec: SceneSpec, spp: int | None, seed: int | None) -> SceneSpec:
    asked = (("spp", _whole("spp", spp, 1, _MOST_SPP)), ("seed", _whole("seed", seed, 0, _MOST_SEED)))
    given = {name: value for name, value in asked if value is not None}
    return spec.model_copy(update={"render": spec.render.model_copy(update=given)})


def _whole(name: str, value: int | None, least: int, most: int) -> int | None:
    """A number that must be whole, as Python's own; or None."""
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or not least <= value <= most:
        raise InputError(f"{name} must be a whole number from {least} to {most}, got {value!r}")
    return int(value)


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
    stats.threads = canvas.threads
    stats.workers = [] if canvas.elsewhere is None else list(canvas.elsewhere.workers)
    stats.spp = {"fewest": int(canvas.counts.min()), "mean": canvas.samples, "most": int(canvas.counts.max())}


def _window(spec: SceneSpec, crop: tuple[int, int, int, int] | None) -> Window:
    width, height = spec.picture()
    if crop is None:
        return Window(0, 0, width, height)
    window = Window(*crop)
    if not (0 <= window.left < window.right <= width and 0 <= window.top < window.bottom <= height):
        corners = ",".join(map(str, crop))
        raise InputError(f"crop {corners} must lie within the film, 0,0,{width},{height}, and hold at least a pixel")
    return window


def _check_size(window: Window) -> None:
    if window.pixels > MAX_PIXELS:
        size = f"{window.right - window.left} x {window.bottom - window.top} is {window.pixels:,} pixels"
        raise InputError(
            f"the picture is too large: {size}, at most {MAX_PIXELS:,} are possible at once; rt lightfield render "
            "takes the views of an array in parts"
        )


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
