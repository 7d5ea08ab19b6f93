"""Sweeps: one image for each combination of values of a scene's keys.

While a point is rendered, the one before is saved in a thread, and the next one is prepared in another if that takes
long.  Points share files, meshes and the ray caster's structures (`RenderCache`).
"""

import threading
import warnings
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, closing, suppress
from dataclasses import replace
from pathlib import Path

from raytracer.analysis.sweep.animation import check as check_animation
from raytracer.analysis.sweep.manifest import RECORDS, load_record, write_manifest, write_record
from raytracer.analysis.sweep.output_layout import OutputLayout, normalize_formats
from raytracer.analysis.sweep.plan import Plan, enumerate_points, make_plan
from raytracer.analysis.sweep.prepare_points import PointPreparer, PreparedPoint, SweepOptions, point_weight
from raytracer.analysis.sweep.results import PointResult, Sweep, SweepPoint
from raytracer.film.image import Image
from raytracer.rendering.checkpoint import CheckpointError, CheckpointWriter, checkpoint_path
from raytracer.rendering.compilation import PreparedScene
from raytracer.rendering.options import called_with
from raytracer.rendering.progress import Progress
from raytracer.rendering.render import render_prepared
from raytracer.rendering.session import Rendered
from raytracer.util.array_snapshot import previous_path
from raytracer.util.atomic_write import write_with_retries
from raytracer.util.errors import InputError, OutputError, SceneWarning, one_line
from raytracer.util.progress import BatchBar, BatchProgress
from raytracer.util.signals import WATCH, defer_interrupt

# Settings that replace a key of the scene.
_SETTING_KEYS = {"spp": "render.spp", "seed": "render.seed"}

# Digits of a point's digest in the name of its checkpoint.
_DIGITS_IN_NAME = 16


@called_with(SweepOptions)
def sweep(options: SweepOptions) -> Sweep:
    """Render a scene with every combination of values of some of its keys.

    `rt.sweep(scene, {"camera.f_number": [1.4, 2], "camera.focus_distance": "2:10:5"}, spp=64).images[1, 4].radiance`

    Parameters
    ----------
    scene : a scene, its file, or a file of a sweep (docs/sweeps.md).
    values : by dotted path, a list of values, or a string as on the command line: `1.4,2`, `2:10:5`, `1:100:3:log`,
        `1.4..22`; a single value is the same for all points.
    folder : where images, manifest, contact sheet and page go; what is there already of the same sweep is kept.  With
        None the images stay in memory.
    allow_files : folders in which a scene file, or a file of a sweep, may name files, besides its own.
    zipped : True to take values in pairs, in place of all combinations.
    spp, seed, threads, crop, noise, time_limit, aovs, denoise, strict, max_memory, cluster : for each point; see
        `rendering.render`.
    preview : a quick look: a smaller film, and at most 16 samples a pixel.
    formats : suffixes of the images in the folder; where none of png and jpg is among them, png is.
    animate : formats, of "gif", "webp" and "png", of an animation of all points in the folder.
    fps : its frames a second.
    max_points : more are an error.
    cache : what points share; one of its own if None.
    stock : old name of `cache`, still accepted.
    progress : called about ten times a second, or True for a bar.
    report : called with each point that was rendered or has failed, once it is saved.
    warn : called with each warning of the scenes, each sentence once; by default they are SceneWarnings.

    A KeyboardInterrupt ends the sweep early: what is done is kept, and `interrupted` is set.  A point that fails does
    not end the others.

    Raises
    ------
    InputError : nothing to sweep, wrong values, formats or settings, or every point is wrong; then nothing is written.
    StrictError : the same, by warnings, and `strict`.
    OutputError : the folder cannot be written, or a cluster was lost.
    """
    plan = make_plan(options.scene, options.values or {}, zipped=options.zipped, allow_files=options.allow_files)
    points = enumerate_points(plan.axes, zipped=plan.zipped, most=options.max_points)
    for name, key in _SETTING_KEYS.items():
        if getattr(options, name) is not None and any(axis.key == key for axis in plan.axes):
            raise InputError(f"--{name} stands in place of {key}, which has several values here: leave one of them out")
    for kind in options.animate:
        check_animation(kind, options.fps)
    layout = None
    if options.folder is not None:
        formats = normalize_formats(options.formats)
        layout = OutputLayout(Path(options.folder), formats, tuple(options.animate), options.fps)
    elif options.animate:
        raise InputError("an animation needs a folder to be written to")
    progress = options.progress
    with ExitStack() as stack:
        if progress is True:
            progress = stack.enter_context(BatchBar(always=True))
        return _SweepRun(plan, points, options, layout).run(progress or None, options.report)


class _ReportQueue:
    """Queue that reports points as they are saved, in the order in which they were rendered.

    Failures are held back until there is an image: if all points fail, one error says so.

    report : called with each point.
    begun : True if images are there already.
    """

    def __init__(self, report: Callable[[PointResult], object] | None, *, begun: bool) -> None:
        self._report, self._begun = report, begun
        self._saved: deque[Future[PointResult]] = deque()
        self._held: list[PointResult] = []

    def add(self, saved: Future[PointResult]) -> None:
        """Queue a point that is being saved, once at most one other is."""
        self._saved.append(saved)
        self.catch_up(leave=1)

    def catch_up(self, *, leave: int = 0) -> None:
        """Wait until at most `leave` points are being saved."""
        while len(self._saved) > leave:
            result = self._saved.popleft().result()
            self._held.append(result)
            self._begun |= result.status == "done"
            if self._begun:
                self.flush()

    def flush(self) -> None:
        """Report all points that are held back."""
        for result in self._held:
            self.report_now(result)
        self._held.clear()

    def report_now(self, result: PointResult) -> None:
        """Report a point at once."""
        if self._report is not None:
            self._report(result)


class _SweepRun:
    """A sweep that is under way."""

    def __init__(
        self, plan: Plan, points: Sequence[SweepPoint], options: SweepOptions, layout: OutputLayout | None
    ) -> None:
        self._plan, self._layout, self._warn = plan, layout, options.warn or _warn
        self._preparer = PointPreparer(plan.spec, points, options, keeps_files=layout is not None)
        self._results: dict[int, PointResult] = {}
        self._images: dict[int, Image] = {}
        self._errors: list[Exception] = []
        self._warned: set[str] = set()
        self._reused, self._cannot_write = 0, False
        self._lock = threading.Lock()
        self._weights = [point_weight(point, options) for point in points]

    def run(
        self, progress: Callable[[BatchProgress], object] | None, report: Callable[[PointResult], object] | None
    ) -> Sweep:
        """Render the points that are missing, and write all files."""
        missing = self._missing_points()
        self._reused = len(self._results)
        interrupted, failure = False, None
        reports = _ReportQueue(report, begun=bool(self._results))
        with ThreadPoolExecutor(1, "saver") as saver:
            try:
                with closing(self._preparer.prepare_all(missing)) as prepared:
                    for number, point in prepared:
                        for sentence in point.warnings:
                            self._warn_once(sentence)
                        writer = self._checkpoint_writer(number)
                        outcome = self._render(number, point.made, missing, progress, writer)
                        if isinstance(outcome, Exception):
                            reports.add(saver.submit(self._fail, number, point, outcome))
                        elif outcome.interrupted or outcome.failure is not None:
                            interrupted, failure = outcome.interrupted, outcome.failure
                            break
                        else:
                            reports.add(saver.submit(self._save, number, point, outcome, writer))
            except KeyboardInterrupt:
                interrupted = True
            # What is done is not lost by an interrupt now.
            with WATCH.on_first_signal(defer_interrupt):
                reports.catch_up()
                return self._finish(reports, failure, interrupted=interrupted)

    def _finish(self, reports: _ReportQueue, failure: str | None, *, interrupted: bool) -> Sweep:
        """Write the files of the sweep as a whole; `failure` says why a cluster has ended it."""
        if len(self._errors) == len(self._preparer.points):
            raise self._errors[0]
        reports.flush()
        for number, result in self._results.items():
            if result.status == "done" and self._layout is not None and not self._layout.has_files(result):
                self._results[number] = replace(
                    result, status="failed", reason="its files have gone meanwhile", files=()
                )
                reports.report_now(self._results[number])
        sweep = self._sweep(interrupted=interrupted)
        if self._layout is not None and any(result.status != "missing" for result in sweep.results):
            for error in write_with_retries(self._layout.writers(sweep), self._warn, self._is_retry_useless).values():
                raise error
        if failure is not None:
            raise OutputError(failure)
        return sweep

    def _missing_points(self) -> list[int]:
        """List the points that are not done, after taking over the results of those that are."""
        if self._layout is None:
            return list(range(len(self._preparer.points)))
        self._layout.check()
        if (self._layout.folder / RECORDS).is_dir():
            for number, point in enumerate(self._preparer.points):
                with suppress(Exception):
                    # An error of the point is reported when it is its turn.
                    self._preparer.note_digest(number)
                    result = load_record(self._preparer.points[number], self._layout.files(point), self._layout.folder)
                    if result is not None:
                        self._results[number] = result
        return [number for number in range(len(self._preparer.points)) if number not in self._results]

    # ---- Rendering

    def _checkpoint_writer(self, number: int) -> CheckpointWriter | None:
        """Make the writer of checkpoints of a point that takes long; the next sweep resumes from them."""
        point = self._preparer.points[number]
        if self._layout is None or not point.digest:
            return None
        # A point that has changed since is not resumed.
        path = checkpoint_path(self._layout.folder / RECORDS / f"{point.name}.{point.digest[:_DIGITS_IN_NAME]}")
        resume = path.exists() or previous_path(path).exists()
        return CheckpointWriter(path, resume=resume, say=self._warn_once)

    def _render(
        self,
        number: int,
        made: PreparedScene | Exception,
        missing: Sequence[int],
        progress: Callable[[BatchProgress], object] | None,
        writer: CheckpointWriter | None,
    ) -> Rendered | Exception:
        """Render a point; an error is returned."""
        if isinstance(made, Exception):
            return made
        whole = sum(self._weights[i] for i in missing)
        before = sum(self._weights[i] for i in missing if i < number)
        name = self._preparer.points[number].name

        def report_progress(render: Progress) -> None:
            if progress is not None:
                part = render.done / render.wanted if render.wanted else 1.0
                share = (before + part * self._weights[number]) / whole
                progress(BatchProgress(share, len(self._results), len(self._preparer.points), name))

        try:
            try:
                return render_prepared(made, progress=report_progress, checkpoint_writer=writer)
            except CheckpointError as error:
                # As where the folder was brought from another machine.
                self._warn_once(f"{error.sentence}; {name} begins anew")
                fresh = None if writer is None else writer.restart()
                return render_prepared(made, progress=report_progress, checkpoint_writer=fresh)
        except Exception as error:  # noqa: BLE001
            return error

    # ---- Saving

    def _save(
        self, number: int, prepared: PreparedPoint, rendered: Rendered, writer: CheckpointWriter | None
    ) -> PointResult:
        """Write a point's images and its record."""
        result = _point_result(prepared, rendered)
        if self._layout is None:
            self._images[number] = rendered.image
            return self._record_result(number, result)
        folder = self._layout.folder
        result = replace(result, files=self._layout.files(prepared.point))

        def save() -> None:
            for name in result.files:
                rendered.image.save(folder / name)
            write_record(result, folder)

        try:
            failures = write_with_retries({number: save}, self._warn, self._is_retry_useless)
        except Exception as error:  # noqa: BLE001
            return self._fail(number, prepared, error)
        # The next one need not find out once more.
        self._cannot_write = bool(failures)
        if failures:
            return self._fail(number, prepared, failures[number])
        if writer is not None and (writer.resumed or writer.info is not None):
            writer.delete()
        return self._record_result(number, result)

    def _is_retry_useless(self) -> bool:
        """Tell if it is of no use to try again to write."""
        return self._cannot_write or WATCH.signal_number is not None

    def _fail(self, number: int, prepared: PreparedPoint, error: Exception) -> PointResult:
        """Record the failure of a point."""
        self._errors.append(error)
        reason, camera = _error_sentence(error), dict(prepared.camera)
        return self._record_result(
            number, PointResult(prepared.point, "failed", reason, camera=camera, warnings=prepared.warnings)
        )

    def _record_result(self, number: int, result: PointResult) -> PointResult:
        """Record the result of a point, now and then in the manifest too, if any image is there."""
        with self._lock:
            self._results[number] = result
        # The manifest holds all points, so writing it after each one would take a sweep's time squared: it is written
        # after 1, 2, 4, ... of them.
        rendered = len(self._results) - self._reused
        is_due = rendered & (rendered - 1) == 0
        if self._layout is not None and is_due and len(self._errors) < len(self._results):
            with suppress(OutputError):
                # An error is raised when it is written for the last time.
                write_manifest(self._sweep(), self._layout.folder)
        return result

    def _warn_once(self, sentence: str) -> None:
        """Warn, once."""
        if sentence not in self._warned:
            self._warned.add(sentence)
            self._warn(sentence)

    def _sweep(self, *, interrupted: bool = False) -> Sweep:
        with self._lock:
            known = dict(self._results)
        results = tuple(known.get(i) or PointResult(point, "missing") for i, point in enumerate(self._preparer.points))
        pictures = (
            () if self._layout is not None else tuple(self._images.get(i) for i in range(len(self._preparer.points)))
        )
        folder = None if self._layout is None else self._layout.folder
        return Sweep(
            self._plan.name, self._plan.axes, self._plan.zipped, results, folder, interrupted, self._reused, pictures
        )


def _point_result(prepared: PreparedPoint, rendered: Rendered) -> PointResult:
    """Make the result of a point, still without files."""
    stats = rendered.stats
    return PointResult(
        prepared.point,
        "done",
        camera=dict(prepared.camera),
        exposure=dict(stats.exposure),
        seconds=dict(stats.seconds),
        samples=float(stats.spp["mean"]),
        rays=stats.rays,
        error={name: stats.error[name] for name in ("relative", "low", "high") if name in stats.error},
        nan_samples=stats.nan_samples,
        complete=rendered.complete,
        warnings=prepared.warnings,
    )


def _error_sentence(error: Exception) -> str:
    """Return one sentence that says why a point failed."""
    if isinstance(error, (InputError, OutputError)):
        return one_line(str(error))
    if isinstance(error, MemoryError):
        return "out of memory"
    return one_line(f"internal error, {type(error).__name__}: {error}")


def _warn(sentence: str) -> None:
    """Warn at the line that called `sweep`."""
    warnings.warn(sentence, SceneWarning, stacklevel=6)
