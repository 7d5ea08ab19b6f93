"""The progress of a render, as it is reported and shown."""

import json
import sys
from collections.abc import Callable
from typing import Any, NamedTuple, Self

from raytracer.core.compiler.compile_progress import CompileProgress
from raytracer.core.error_estimate.halves import ErrorEstimate
from raytracer.rendering.tile_scheduler import TileQueue, now
from raytracer.report.wording import format_percent
from raytracer.util.progress import Bar, BatchBar, BatchProgress

FIRST_COMPILATION = (
    "rt: this combination of effects is compiled for the first time; later renders have it from the cache"
)

# Between two lines of JSON.
_LINE_SECONDS = 0.5


class Progress(NamedTuple):
    """The progress of a render.

    done : samples over all pixels so far.
    wanted : samples at the end; a guess where they are not given.
    seconds (s) : time since the start.
    error : relative error as last estimated, or None.
    resumed : samples of `done` that were there before the start.
    """

    done: int
    wanted: int
    seconds: float
    error: float | None = None
    resumed: int = 0


def show_in_batch(bar: BatchBar, number: int, count: int, name: str) -> Callable[[Progress], None]:
    """Make the function that shows the progress of one of several renders, of this number from 0."""
    return lambda render: bar(BatchProgress((number + render.done / render.wanted) / count, number, count, name))


class SampleBar(Bar):
    """A progress bar in samples, with the error where one is asked for.

    The end is estimated by the mean speed so far: that of the last moments is the speed of some tiles, sky or glass.
    """

    def __init__(self, *, always: bool = False, quiet: bool = False) -> None:
        super().__init__(" samples", always=always, quiet=quiet, unit_scale=True, smoothing=0.0)

    def show(self, progress: Progress) -> None:
        """Show the progress of a render."""
        note = "" if progress.error is None else f"error {format_percent(progress.error)}"
        self.update(progress.done, progress.wanted, note, progress.resumed)


class CompileBar(Bar):
    """A progress bar of the compiler, below a line that says why there is something to compile.

    announcement : the line; None for no line.
    """

    def __init__(
        self, *, always: bool = False, quiet: bool = False, announcement: str | None = FIRST_COMPILATION
    ) -> None:
        form = "compiling {percentage:3.0f}% |{bar}| {elapsed}{postfix}"
        super().__init__("%", always=always, quiet=quiet, bar_format=form)
        self._announcement = None if quiet else announcement

    def show(self, progress: CompileProgress) -> None:
        """Show the progress of a compilation."""
        if self._announcement is not None:
            self.say(self._announcement)
            self._announcement = None
        self.update(100.0 * progress.fraction, 100.0, f"{progress.parts} of about {progress.known_parts} parts")


class ProgressLines:
    """The progress of one phase as lines of JSON on stderr, for programs, in place of a bar."""

    def __init__(self, phase: str, scene: str) -> None:
        self._names = {"scene": scene, "phase": phase}
        self._began = self._said = now()
        self._line: dict[str, Any] | None = None

    def show(self, progress: Progress | CompileProgress) -> None:
        """Print the progress, but that of moments ago only if it stays the last."""
        if isinstance(progress, CompileProgress):
            progress = Progress(progress.parts, max(progress.parts, progress.known_parts), now() - self._began)
        is_first = self._line is None
        done, total, seconds, worked = (
            progress.done,
            progress.wanted,
            progress.seconds,
            progress.done - progress.resumed,
        )
        eta = round(seconds * (total - done) / worked, 3) if worked > 0 else None
        self._line = {**self._names, "done": done, "total": total, "seconds": round(seconds, 3), "eta": eta}
        if is_first or now() - self._said > _LINE_SECONDS:
            self._print()

    def _print(self) -> None:
        print(json.dumps(self._line), file=sys.stderr, flush=True)
        self._said, self._line = now(), {}

    def say(self, line: str) -> None:
        """Print a line that is no progress, on stderr."""
        print(line, file=sys.stderr)

    def close(self) -> None:
        """Print the last progress, if it was not."""
        if self._line:
            self._print()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


class ProgressReporter:
    """The reports of a render's progress to its caller."""

    def __init__(self, progress: Callable[[Progress], None] | None, wanted: int) -> None:
        self._progress, self._wanted = progress, wanted
        self._error: float | None = None
        self._start = now()
        self._queue: TileQueue | None = None
        self._resumed = 0

    def begin(self, queue: TileQueue) -> None:
        """Watch a queue, and take the samples that it has for those before the start."""
        self._queue, self._resumed, self._start = queue, queue.done, now()

    def tick(self) -> None:
        """Report to the caller."""
        if self._progress is not None and self._queue is not None:
            done = self._queue.done
            passed = now() - self._start
            self._progress(Progress(done, max(self._wanted, done), passed, self._error, self._resumed))

    def set_estimate(self, samples: float, estimate: ErrorEstimate | None) -> None:
        """Note the samples with which an adaptive render is likely to end, and its error so far."""
        self._wanted, self._error = round(samples), None if estimate is None else estimate.error
