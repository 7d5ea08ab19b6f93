"""A running render: its passes, its progress, its checkpoints, and the picture at its end."""

import contextlib
from collections.abc import Callable
from typing import NamedTuple

from raytracer.core.error_estimate.halves import ErrorEstimator
from raytracer.core.error_estimate.rates import sampler_exponent
from raytracer.film.exposure import ExposureResult
from raytracer.film.image import Image
from raytracer.film.negative_pixels import find_negative_pixels
from raytracer.rendering.adaptive_sampling import AdaptiveRender, Outcome
from raytracer.rendering.checkpoint import CheckpointWriter
from raytracer.rendering.compilation import PreparedScene
from raytracer.rendering.develop import develop_image, film_process, is_radiance, negative_causes
from raytracer.rendering.diagnostics import diagnose_samples
from raytracer.rendering.film_region import FilmRegion
from raytracer.rendering.progress import Progress, ProgressReporter
from raytracer.rendering.resumable_state import ResumableState
from raytracer.rendering.statistics import PhaseTimer, Stats, image_header, peak_rss_bytes
from raytracer.rendering.tile_scheduler import FIRST_PASS, TileQueue, now, split_into_tiles
from raytracer.rendering.worker_pool import WorkerPool
from raytracer.scene.render_settings import MAX_PIXELS
from raytracer.util.errors import InputError


class Rendered(NamedTuple):
    """A rendered image with its statistics.

    image : the picture.
    stats : of the render.
    complete : True if all samples were taken, or the error asked for was reached.
    interrupted : True if a KeyboardInterrupt ended the render early.
    fewest_samples : of any pixel; `image.samples` is the most.
    setting : the exposure; None for plain radiance.
    failure : the reason why a cluster ended the render early; None if it did not.
    """

    image: Image
    stats: Stats
    complete: bool
    interrupted: bool
    fewest_samples: int
    setting: ExposureResult | None
    failure: str | None = None


class Cancelled(Exception):  # noqa: N818
    """The render was cancelled, and has no picture."""


class RenderSession:
    """One render of a prepared scene; see `render.render_prepared`.

    While `run` is under way in one thread, others may look at its film, and cancel it.
    """

    def __init__(
        self,
        prepared: PreparedScene,
        progress: Callable[[Progress], None] | None,
        dry_run_save: Callable[[Image], object] | None,
        checkpoint_writer: CheckpointWriter | None,
    ) -> None:
        window = prepared.options.window
        if window.pixels > MAX_PIXELS:
            size = f"{window.right - window.left} x {window.bottom - window.top} is {window.pixels:,} pixels"
            raise InputError(
                f"the picture is too large: {size}, at most {MAX_PIXELS:,} are possible at once; rt lightfield render "
                "takes the views of an array in parts"
            )
        self._prepared, self._options = prepared, prepared.options
        self._spec, self._scene = prepared.packed.spec, prepared.scene
        self._dry_run_save, self._writer = dry_run_save, checkpoint_writer
        self._stats = Stats(
            threads=self._options.threads, seconds=dict(prepared.seconds), effects=list(prepared.effects)
        )
        self._timer = PhaseTimer(self._stats.seconds)
        self._windows = split_into_tiles(self._options.window)
        self._region = prepared.empty_region(self._options.window)
        self._reporter = ProgressReporter(progress, self._options.window.pixels * self._spec.render.spp)
        self._pool = WorkerPool(self._options.threads, self._reporter.tick, scene=self._scene)
        estimator = ErrorEstimator(self._windows, sampler_exponent(self._spec.render.sampler))
        view = self._region.view()
        self._queue = TileQueue(self._scene, view, self._windows, self._pool, estimator, prepared.remote)
        self._is_cancelled = False

    @property
    def region(self) -> FilmRegion:
        """Return the film, to which threads may be adding: what a pixel holds just then may be of two passes."""
        return self._region

    @property
    def queue(self) -> TileQueue:
        """Return the tiles, with the samples that they have."""
        return self._queue

    def cancel(self) -> None:
        """End the render as soon as it can, without a picture: `run` raises Cancelled."""
        self._is_cancelled = True
        self._pool.stop()

    @property
    def is_radiance(self) -> bool:
        """Tell if pixels of the picture are those of the film, without an exposure."""
        return is_radiance(film_process(self._spec))

    def develop(self) -> Image:
        """Make the picture of the film as it is, without its layers and with its noise."""
        return develop_image(self._region, self._spec)[0]

    def run(self) -> Rendered:
        """Render the samples, and develop the picture.

        Raises
        ------
        InputError : the checkpoint to go on from is of another picture.
        Cancelled : `cancel` was called.
        """
        # A field would make a cycle of references, by which scenes and films would outlive their render.
        state = ResumableState(self._prepared, self._queue, self._timer, self.picture)
        self._resume(state)
        deadline = self._render_with_checkpoints(state)
        if self._writer is not None:
            with self._pool.stop_on_interrupt():
                self._writer.finish(state)
            if self._writer.info is not None:
                self._timer.lap("keep")
        if not self._options.is_adaptive:
            # Those of a packet that is not whole, which no checkpoint can hold.
            self._queue.render_passes(self._spec.render.spp, deadline)
        if self._is_cancelled:
            raise Cancelled
        return self._finish(state.outcome)

    def _resume(self, state: ResumableState) -> None:
        """Go on from the checkpoint, if that was asked for."""
        if self._writer is not None:
            self._writer.resume(state)
            if state.resumed:
                self._timer.lap("resume")
        self._stats.resumed = state.resumed
        self._reporter.begin(self._queue)

    def _render_with_checkpoints(self, state: ResumableState) -> float | None:
        """Render all that checkpoints can hold, and write them now and then; return the deadline, if there is one."""
        options, queue, writer = self._options, self._queue, self._writer
        deadline = None
        with (
            self._pool.stop_on_interrupt(),
            contextlib.nullcontext() if writer is None else writer.write_periodically(state),
        ):
            # Render a first picture, by which to measure how long the end will take.
            queue.first_pass(FIRST_PASS if options.max_spp is None else options.max_spp)
            self._timer.lap("render")
            if options.time_limit is not None and not self._pool.is_stopped:
                deadline = self._timer.start_time + options.time_limit - self._seconds_to_finish()
                self._timer.lap("develop")

            # Render the rest.
            if options.is_adaptive:
                adaptive = AdaptiveRender(queue, self._prepared, deadline, state.adaptive_state)
                state.adaptive = adaptive
                adaptive.run(self._reporter.set_estimate)
            else:
                queue.render_passes(state.goal if writer is not None else self._spec.render.spp, deadline)
        self._timer.lap("render")
        return deadline

    def _finish(self, outcome: Outcome) -> Rendered:
        """Develop the picture, and complete the statistics."""
        stats, queue, timer, options = self._stats, self._queue, self._timer, self._options
        with self._pool.stop_on_interrupt():
            stats.record_error(queue.estimate(), options.noise)
        timer.lap("render")

        stats.record_samples(queue, outcome)
        with self._pool.stop_on_interrupt():
            diagnose_samples(stats, self._prepared, self._region)
        timer.lap("render")
        header = image_header(self._spec, options.crop, stats, is_adaptive=options.is_adaptive)
        image, exposure = develop_image(self._region, self._spec, options, header, timer.lap, is_final=True)
        stats.exposure = {} if exposure is None else exposure.as_dict()
        causes, region = negative_causes(self._spec, self._scene), self._region
        stats.negative_pixels, stats.negative = find_negative_pixels(image.radiance, causes, region.left, region.top)
        stats.seconds["total"] = sum(stats.seconds.values())
        stats.peak_rss_bytes = peak_rss_bytes()
        interrupted = self._pool.interrupted
        complete = outcome.reached and not interrupted
        return Rendered(image, stats, complete, interrupted, int(queue.counts.min()), exposure, self._pool.failure)

    def picture(self, outcome: Outcome) -> Image:
        """Make the picture of the samples so far."""
        stats = Stats()
        stats.record_samples(self._queue, outcome)
        header = image_header(self._spec, self._options.crop, stats, is_adaptive=True)
        image, _ = develop_image(self._region, self._spec, self._options, header)
        return image

    def _seconds_to_finish(self) -> float:
        """Measure how long it takes to check the film, to make an image of it, and to save that."""
        begin = now()
        diagnose_samples(Stats(), self._prepared, self._region)
        image, _ = develop_image(self._region, self._spec, self._options)
        if self._dry_run_save is not None:
            self._dry_run_save(image)
        return now() - begin
