"""Sweeps: one picture for each combination of values of a scene's keys.

While a point is rendered, the one before is saved in a thread, and the next one is made ready in another if that takes
long.  What points share, files, meshes and the ray caster's structures, is made once (`Stock`).
"""

import math
import os
import threading
import warnings
from collections import deque
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple, cast

from raytracer.checkpoints import Keeper, RefusedError, checkpoint_of
from raytracer.errors import InputError, OutputError, SceneWarning, one_line
from raytracer.explanation.numbers import View, depth_of_field, exposure
from raytracer.film.image import Image
from raytracer.interrupts import WATCH, wait
from raytracer.reach import AllowFiles
from raytracer.rendering import Progress, Ready, Rendered, ready
from raytracer.scene.edit import overridden
from raytracer.scene.inputs import digest
from raytracer.scene.pack import Packed
from raytracer.scene.preview import SPP, smaller
from raytracer.scene.spec import SceneSpec
from raytracer.scheduling import Workforce, now
from raytracer.snapshots import previous_of
from raytracer.stock import Stock
from raytracer.sweeping.animation import FPS, Kind
from raytracer.sweeping.animation import check as check_animation
from raytracer.sweeping.bar import SweepBar
from raytracer.sweeping.home import Home, formats_of
from raytracer.sweeping.manifest import RECORDS, find_record, write_manifest, write_record
from raytracer.sweeping.plan import Plan, planned
from raytracer.sweeping.points import MOST_POINTS, Point, Sweep, Taken, points_of
from raytracer.wholefiles import persist

# Settings that stand in place of a key of the scene.
_IN_PLACE = {"spp": "render.spp", "seed": "render.seed"}

# Digits of a point's digest in the name of its checkpoint.
_DIGITS_KEPT = 16

# Keys of a scene that say how many samples a picture takes.
_SIZES = ("film.width", "film.height", "render.spp")


class Done(NamedTuple):
    """How far a sweep is.

    share : of the work that there was to do, from 0 to 1; points that were there already are none.
    points : how many are settled; of : how many there are.
    name : the point that is being rendered.
    """

    share: float
    points: int
    of: int
    name: str


@dataclass(frozen=True)
class Settings:
    """How each point is rendered; see `rendering.render`.

    preview : a quick look, as `rt render --preview` has it.
    """

    spp: int | None = None
    seed: int | None = None
    crop: tuple[int, int, int, int] | None = None
    noise: float | None = None
    time_limit: float | None = None
    aovs: tuple[str, ...] = ()
    denoise: bool = False
    strict: bool = False
    preview: bool = False
    max_memory: int | None = None


def sweep(
    scene: SceneSpec | str | os.PathLike[str],
    values: Mapping[str, Any] | None = None,
    *,
    folder: str | os.PathLike[str] | None = None,
    allow_files: AllowFiles = (),
    zipped: bool = False,
    spp: int | None = None,
    seed: int | None = None,
    threads: int | None = None,
    crop: tuple[int, int, int, int] | None = None,
    noise: float | None = None,
    time_limit: float | None = None,
    aovs: Sequence[str] = (),
    denoise: bool = False,
    strict: bool = False,
    preview: bool = False,
    formats: Sequence[str] = ("png",),
    animate: Sequence[str] = (),
    fps: float = FPS,
    max_points: int = MOST_POINTS,
    max_memory: int | None = None,
    cluster: Workforce | None = None,
    stock: Stock | None = None,
    progress: Callable[[Done], object] | bool | None = None,
    report: Callable[[Taken], object] | None = None,
    warn: Callable[[str], object] | None = None,
) -> Sweep:
    """Render a scene with every combination of values of some of its keys.

    `rt.sweep(scene, {"camera.f_number": [1.4, 2], "camera.focus_distance": "2:10:5"}, spp=64).images[1, 4].radiance`

    Parameters
    ----------
    scene : a scene, its file, or a file of a sweep (docs/sweeps.md).
    values : by dotted path, a list of values, or a text as on the command line: `1.4,2`, `2:10:5`, `1:100:3:log`,
        `1.4..22`; a single value is the same for all points.
    folder : where images, manifest, contact sheet and page go; what is there already of the same sweep is kept.  With
        None the images stay in memory.
    allow_files : folders in which a scene file, or a file of a sweep, may name files, besides its own.
    zipped : whether values are taken in pairs, in place of all combinations.
    spp, seed, threads, crop, noise, time_limit, aovs, denoise, strict, max_memory, cluster : for each point; see
        `rendering.render`.
    preview : a quick look: a smaller film, and at most 16 samples a pixel.
    formats : suffixes of the images in the folder; where none of png and jpg is among them, png is.
    animate : formats, of "gif", "webp" and "png", of an animation of all points in the folder.
    fps : its frames a second.
    max_points : more are an error.
    stock : what points share; one of its own if None.
    progress : called about ten times a second, or True for a bar.
    report : called with each point that was rendered or has failed, once it is settled.
    warn : told what the scenes make one doubt, each sentence once; by default they are SceneWarnings.

    A KeyboardInterrupt ends the sweep early: what is done is kept, and `interrupted` is set.  A point that fails does
    not end the others.

    Raises
    ------
    InputError : nothing to sweep, wrong values, formats or settings, or every point is wrong; then nothing is written.
    StrictError : the same, by warnings, and `strict`.
    OutputError : the folder cannot be written, or a cluster was lost.
    """
    plan = planned(scene, values or {}, zipped=zipped, allow_files=allow_files)
    points = points_of(plan.axes, zipped=plan.zipped, most=max_points)
    settings = Settings(spp, seed, crop, noise, time_limit, tuple(aovs), denoise, strict, preview, max_memory)
    for name, key in _IN_PLACE.items():
        if getattr(settings, name) is not None and any(axis.key == key for axis in plan.axes):
            raise InputError(f"--{name} stands in place of {key}, which has several values here: leave one of them out")
    for kind in animate:
        check_animation(kind, fps)
    home = (
        None if folder is None else Home(Path(folder), formats_of(formats), cast(tuple[Kind, ...], tuple(animate)), fps)
    )
    if home is None and animate:
        raise InputError("an animation needs a folder to be written to")
    with ExitStack() as stack:
        if progress is True:
            progress = stack.enter_context(SweepBar(always=True))
        work = _Work(plan, points, settings, home, threads, cluster, stock or Stock(), warn or _warn)
        return work.run(progress or None, report)


class _Prepared(NamedTuple):
    """A point before it is rendered: what it takes to do so, or why that cannot be done, and what is known of it.

    packed_anew, whether more of it had to be packed than its camera, film and settings.
    """

    point: Point
    made: Ready | Exception
    camera: Mapping[str, float]
    warnings: tuple[str, ...]
    packed_anew: bool = False


class _Work:
    """A sweep under way."""

    def __init__(
        self,
        plan: Plan,
        points: Sequence[Point],
        settings: Settings,
        home: Home | None,
        threads: int | None,
        cluster: Workforce | None,
        stock: Stock,
        warn: Callable[[str], object],
    ) -> None:
        self._plan, self._settings, self._home = plan, settings, home
        self._threads, self._cluster, self._stock, self._warn = threads, cluster, stock, warn
        self._points = list(points)
        self._taken: dict[int, Taken] = {}
        self._images: dict[int, Image] = {}
        self._errors: list[Exception] = []
        self._kept = 0
        self._specs: dict[int, SceneSpec] = {}
        self._told: set[str] = set()
        self._is_stuck = False
        self._lock = threading.Lock()
        self._weights = [self._weight(point) for point in points]

    def run(self, progress: Callable[[Done], object] | None, report: Callable[[Taken], object] | None) -> Sweep:
        """Render what is missing, and write all there is to say."""
        todo = self._todo()
        self._kept = len(self._taken)
        interrupted, failure = False, None
        reports = _Reports(report, begun=bool(self._taken))
        with ThreadPoolExecutor(1, "saver") as saver:
            try:
                with closing(self._prepared(todo)) as prepared:
                    for number, found in prepared:
                        for sentence in found.warnings:
                            self._doubt(sentence)
                        keeper = self._keeper(number)
                        outcome = self._render(number, found.made, todo, progress, keeper)
                        if isinstance(outcome, Exception):
                            reports.expect(saver.submit(self._fail, number, found, outcome))
                        elif outcome.interrupted or outcome.failure is not None:
                            interrupted, failure = outcome.interrupted, outcome.failure
                            break
                        else:
                            reports.expect(saver.submit(self._save, number, found, outcome, keeper))
            except KeyboardInterrupt:
                interrupted = True
            # What is done is not lost by an interrupt now.
            with WATCH.on_first(wait):
                reports.catch_up()
                return self._concluded(reports, failure, interrupted=interrupted)

    def _concluded(self, reports: "_Reports", failure: str | None, *, interrupted: bool) -> Sweep:
        """Write all there is to say; `failure`, why others have ended the sweep."""
        if len(self._errors) == len(self._points):
            raise self._errors[0]
        reports.flush()
        for number, taken in self._taken.items():
            if taken.status == "done" and self._home is not None and not self._home.holds(taken):
                self._taken[number] = replace(taken, status="failed", reason="its files have gone meanwhile", files=())
                reports.tell(self._taken[number])
        result = self._result(interrupted=interrupted)
        if self._home is not None and any(taken.status != "missing" for taken in result.taken):
            for error in persist(self._home.publishing(result), self._warn, self._is_over).values():
                raise error
        if failure is not None:
            raise OutputError(failure)
        return result

    # ---- What there is to do

    def _todo(self) -> list[int]:
        """The points that are not done, after those that are were taken over."""
        if self._home is None:
            return list(range(len(self._points)))
        self._home.check()
        if (self._home.folder / RECORDS).is_dir():
            for number, point in enumerate(self._points):
                with suppress(Exception):
                    # What is wrong with it is told when it is its turn.
                    self._note_digest(number)
                    found = find_record(self._points[number], self._home.files(point), self._home.folder)
                    if found is not None:
                        self._taken[number] = found
        return [number for number in range(len(self._points)) if number not in self._taken]

    def _spec(self, number: int) -> SceneSpec:
        """The scene of a point."""
        if number not in self._specs:
            spec = overridden(self._plan.spec, self._points[number].values)
            self._specs[number] = smaller(spec) if self._settings.preview else spec
        return self._specs[number]

    def _note_digest(self, number: int) -> None:
        """Note what a point's picture depends on, files as they are now."""
        self._points[number] = replace(self._points[number], digest=self._digest(self._spec(number)))

    def _digest(self, spec: SceneSpec) -> str:
        settings = self._settings
        given = {
            "spp": self._spp(spec),
            "seed": settings.seed,
            "crop": settings.crop,
            "noise": settings.noise,
            "time_limit": settings.time_limit,
            "aovs": sorted(settings.aovs) or None,
            "denoise": settings.denoise or None,
        }
        return digest(spec, **given)

    def _spp(self, spec: SceneSpec) -> int | None:
        spp = self._settings.spp
        if self._settings.preview and self._settings.noise is None:
            return min(spp or spec.render.spp, SPP)
        return spp

    def _weight(self, point: Point) -> float:
        """How much work a point is against others, as far as its values tell."""
        weight = 1.0
        for key in _SIZES:
            value = point.values.get(key, 1)
            counts = isinstance(value, (int, float)) and 0 < value < math.inf
            if counts and not (key == "render.spp" and self._settings.spp is not None):
                weight *= value
        return weight

    # ---- Making ready

    def _prepared(self, todo: Sequence[int]) -> Generator[tuple[int, _Prepared], None, None]:
        """Points made ready in their order: between renders, or, where that takes long, while another is rendered.

        Python beside threads that render keeps the interpreter's lock from them.  A point of the cover, 25 ms of Python
        once the scene is packed, took 40 to 100 ms of its neighbour's render, at any switch interval.
        """
        takes_long = self._cluster is not None
        with _unawaited(ThreadPoolExecutor(1, "preparer")) as preparer:
            following: Future[_Prepared] | None = None
            for place, number in enumerate(todo):
                # Here, where an interrupt ends what may take long.
                found = self._prepare(number) if following is None else following.result()
                following = None
                takes_long |= place > 0 and found.packed_anew
                if takes_long and place + 1 < len(todo):
                    following = preparer.submit(self._prepare, todo[place + 1])
                yield number, found

    def _prepare(self, number: int) -> _Prepared:
        """Make a point ready, or say why that cannot be."""
        sentences: list[str] = []
        settings = self._settings
        began, packed = now(), self._stock.counts.worlds_packed
        try:
            spec = self._spec(number)
            self._note_digest(number)
            made = ready(
                spec,
                load_seconds=now() - began,
                spp=self._spp(spec),
                seed=settings.seed,
                threads=self._threads,
                crop=settings.crop,
                noise=settings.noise,
                time_limit=settings.time_limit,
                aovs=settings.aovs,
                denoise=settings.denoise,
                warn=sentences.append,
                strict=settings.strict,
                stock=self._stock,
                cluster=self._cluster,
                max_memory=settings.max_memory,
                keeps=self._home is not None,
            )
            camera = camera_numbers(made.packed)
            if self._digest(spec) != self._points[number].digest:
                # Nobody knows whether the picture is of the file before or after; no record is of "".
                self._points[number] = replace(self._points[number], digest="")
                name = self._points[number].name
                sentences.append(f"{name}: a file changed while it was read, so that it is rendered again next time")
        except Exception as error:  # noqa: BLE001
            return _Prepared(self._points[number], error, {}, tuple(sentences))
        finally:
            self._specs.pop(number, None)
        packed_anew = self._stock.counts.worlds_packed > packed
        return _Prepared(self._points[number], made, camera, tuple(sentences), packed_anew)

    # ---- Rendering

    def _keeper(self, number: int) -> Keeper | None:
        """Who keeps what is gathered of a point that takes long; the next sweep goes on from there."""
        point = self._points[number]
        if self._home is None or not point.digest:
            return None
        # Of a point that has changed since nothing is taken up.
        path = checkpoint_of(self._home.folder / RECORDS / f"{point.name}.{point.digest[:_DIGITS_KEPT]}")
        resume = path.exists() or previous_of(path).exists()
        return Keeper(path, resume=resume, say=self._doubt)

    def _render(
        self,
        number: int,
        made: Ready | Exception,
        todo: Sequence[int],
        progress: Callable[[Done], object] | None,
        keeper: Keeper | None,
    ) -> Rendered | Exception:
        """The picture of a point, or what went wrong."""
        if isinstance(made, Exception):
            return made
        whole = sum(self._weights[i] for i in todo)
        before = sum(self._weights[i] for i in todo if i < number)
        name = self._points[number].name

        def tell(render: Progress) -> None:
            if progress is not None:
                part = render.done / render.wanted if render.wanted else 1.0
                share = (before + part * self._weights[number]) / whole
                progress(Done(share, len(self._taken), len(self._points), name))

        try:
            try:
                return made.render(progress=tell, keeper=keeper)
            except RefusedError as error:
                # As where the folder was brought from another machine.
                self._doubt(f"{error.sentence}; {name} begins anew")
                return made.render(progress=tell, keeper=None if keeper is None else keeper.anew())
        except Exception as error:  # noqa: BLE001
            return error

    # ---- Keeping

    def _save(self, number: int, found: _Prepared, rendered: Rendered, keeper: Keeper | None) -> Taken:
        """Write a point's images, and what is known of it."""
        stats = rendered.stats
        taken = Taken(
            found.point,
            "done",
            camera=dict(found.camera),
            exposure=dict(stats.exposure),
            seconds=dict(stats.seconds),
            samples=float(stats.spp["mean"]),
            rays=stats.rays,
            error={name: stats.error[name] for name in ("relative", "low", "high") if name in stats.error},
            nan_samples=stats.nan_samples,
            complete=rendered.complete,
            warnings=found.warnings,
        )
        if self._home is None:
            self._images[number] = rendered.image
            return self._settle(number, taken)
        folder = self._home.folder
        taken = replace(taken, files=self._home.files(found.point))

        def save() -> None:
            for name in taken.files:
                rendered.image.save(folder / name)
            write_record(taken, folder)

        try:
            failures = persist({number: save}, self._warn, self._is_over)
        except Exception as error:  # noqa: BLE001
            return self._fail(number, found, error)
        # The next one need not find out once more.
        self._is_stuck = bool(failures)
        if failures:
            return self._fail(number, found, failures[number])
        if keeper is not None and (keeper.resumed or keeper.held is not None):
            keeper.forget()
        return self._settle(number, taken)

    def _is_over(self) -> bool:
        """Whether it is of no use to try again what cannot be written."""
        return self._is_stuck or WATCH.asked is not None

    def _fail(self, number: int, found: _Prepared, error: Exception) -> Taken:
        """Note why there is no picture of a point."""
        self._errors.append(error)
        return self._settle(
            number, Taken(found.point, "failed", _sentence(error), camera=dict(found.camera), warnings=found.warnings)
        )

    def _settle(self, number: int, taken: Taken) -> Taken:
        """Note what became of a point, now and then in the manifest too, if any picture is there."""
        with self._lock:
            self._taken[number] = taken
        # It tells of all points, so after each one it would take a sweep's time squared: after 1, 2, 4, ... of them.
        settled = len(self._taken) - self._kept
        is_time = settled & (settled - 1) == 0
        if self._home is not None and is_time and len(self._errors) < len(self._taken):
            with suppress(OutputError):
                # What cannot be written now is told of when it is written for the last time.
                write_manifest(self._result(), self._home.folder)
        return taken

    def _doubt(self, sentence: str) -> None:
        """Warn, once."""
        if sentence not in self._told:
            self._told.add(sentence)
            self._warn(sentence)

    def _result(self, *, interrupted: bool = False) -> Sweep:
        with self._lock:
            settled = dict(self._taken)
        taken = tuple(settled.get(i) or Taken(point, "missing") for i, point in enumerate(self._points))
        pictures = () if self._home is not None else tuple(self._images.get(i) for i in range(len(self._points)))
        folder = None if self._home is None else self._home.folder
        return Sweep(
            self._plan.name, self._plan.axes, self._plan.zipped, taken, folder, interrupted, self._kept, pictures
        )


@contextmanager
def _unawaited(pool: ThreadPoolExecutor) -> Iterator[ThreadPoolExecutor]:
    """A pool whose work nobody waits for after an interrupt: it may be that of the compiler."""
    try:
        yield pool
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


class _Reports:
    """Tells of points as they are settled; of failures only once there is a picture: if all fail, one error says so."""

    def __init__(self, report: Callable[[Taken], object] | None, *, begun: bool) -> None:
        self._report, self._begun = report, begun
        self._saved: deque[Future[Taken]] = deque()
        self._held: list[Taken] = []

    def expect(self, saved: Future[Taken]) -> None:
        """Take a point that is being saved, once at most one other is."""
        self._saved.append(saved)
        self.catch_up(leave=1)

    def catch_up(self, *, leave: int = 0) -> None:
        """Wait until at most `leave` points are being saved."""
        while len(self._saved) > leave:
            taken = self._saved.popleft().result()
            self._held.append(taken)
            self._begun |= taken.status == "done"
            if self._begun:
                self.flush()

    def flush(self) -> None:
        """Tell of all that is known."""
        for taken in self._held:
            self.tell(taken)
        self._held.clear()

    def tell(self, taken: Taken) -> None:
        """Tell of a point at once."""
        if self._report is not None:
            self._report(taken)


def camera_numbers(packed: Packed) -> dict[str, float]:
    """A packed scene's camera in numbers, as `rt explain` has them."""
    view = View(packed.spec, packed.scene.camera, packed.shift)
    return view.numbers | depth_of_field(view, None) | exposure(packed.spec)


def _sentence(error: Exception) -> str:
    """Why a point failed."""
    if isinstance(error, (InputError, OutputError)):
        return one_line(str(error))
    if isinstance(error, MemoryError):
        return "out of memory"
    return one_line(f"internal error, {type(error).__name__}: {error}")


def _warn(sentence: str) -> None:
    """Warn at the line that called `sweep`."""
    warnings.warn(sentence, SceneWarning, stacklevel=5)
