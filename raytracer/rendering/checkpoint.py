"""Checkpoints: the state of a render in a file beside its picture; a resumed render is bit-identical to a whole one.

A render's state is its film, sample by sample in order; its error estimator; and, for adaptive sampling, the state of
its rounds.  It is copied now and then, while no thread renders, and written while all go on.  Samples come in packets,
and adding a packet is not associative, so that a checkpoint holds whole packets alone: a picture of 100 samples a pixel
is resumed from 96.
"""

import math
import os
import queue
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from numpy.typing import NDArray

from raytracer.film.image import Image
from raytracer.rendering.resumable_state import ResumableState, identity_difference
from raytracer.rendering.tile_scheduler import now
from raytracer.util import array_snapshot
from raytracer.util.array_snapshot import DamagedError
from raytracer.util.errors import InputError, OutputError

SUFFIX = ".checkpoint"

DEFAULT_INTERVAL = 60.0
"""Seconds between two checkpoints, by default."""

_FORMAT = 1

_NO_MEMORY = "out of memory"


def checkpoint_path(output: Path) -> Path:
    """Return the path of a picture's checkpoint, which lies beside its file."""
    return output.with_name(output.name + SUFFIX)


class CheckpointError(InputError):
    """A checkpoint from which a render cannot go on.

    sentence : its path, and the reason.
    """

    def __init__(self, sentence: str) -> None:
        self.sentence = sentence
        super().__init__(f"{sentence}; without --resume the render begins anew")


class CheckpointInfo(NamedTuple):
    """A checkpoint that was written.

    path : its file.
    samples : the fewest that a pixel has there.
    bytes : size of the file.
    """

    path: Path
    samples: int
    bytes: int


class CheckpointWriter:
    """Writes the checkpoints of a render, from time to time and at its end, and resumes it from the last one.

    It is for one render at a time.

    Parameters
    ----------
    path : file of the checkpoint; the one before it is kept beside it while the render goes on.  None to write none,
        and only show previews.
    every (s) : time between two.
    resume : True to go on from the checkpoint that is there.
    always : True to write one, too, at the end of a render that has taken less than `every` seconds.
    say : called with a sentence when a checkpoint cannot be written, when it can again, and when one is damaged.
    show : called with the picture so far when a preview is requested.

    Attributes
    ----------
    info : the checkpoint in the file; None if this render has written none.
    resumed : samples that every pixel had already; 0 if the render began anew.
    """

    def __init__(
        self,
        path: str | os.PathLike[str] | None,
        *,
        every: float = DEFAULT_INTERVAL,
        resume: bool = False,
        always: bool = False,
        say: Callable[[str], object] = lambda sentence: None,
        show: Callable[[Image], object] | None = None,
    ) -> None:
        if not 0.0 < every < math.inf:
            raise InputError(f"the time between checkpoints must be greater than 0 and finite, got {every:g}")
        self.path = None if path is None else Path(path)
        self.info: CheckpointInfo | None = None
        self.resumed = 0
        self._every, self._resume, self._always = every, resume, always
        self._say, self._show = say, show
        # Reentrant, as a signal's handler needs it.
        self._requests: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._identity: Mapping[str, Any] | None = None
        self._has_written = self._is_failing = self._is_valid = False

    def request_preview(self) -> None:
        """Request that the picture so far is shown, soon."""
        self._requests.put("show")

    def restart(self) -> "CheckpointWriter":
        """Remove the checkpoint, and return this writer, for a render that begins anew."""
        self.delete()
        self._resume = False
        return self

    def delete(self) -> None:
        """Remove the checkpoint."""
        if self.path is not None:
            array_snapshot.delete(self.path)
        self.info = None

    # ---- At the beginning

    def resume(self, render: ResumableState) -> None:
        """Have a render that has no samples yet go on from the checkpoint, if that was asked for.

        Raises
        ------
        InputError : it is of another picture (`CheckpointError`), is damaged, as is the one before it (the same), or
            cannot be read.
        """
        self._identity = None
        self.info, self.resumed = None, 0
        self._has_written = self._is_failing = self._is_valid = False
        if not self._resume or self.path is None:
            return
        damage: list[str] = []
        for path in (self.path, array_snapshot.previous_path(self.path)):
            try:
                self._restore_from(path, render)
            except FileNotFoundError:
                continue
            except DamagedError as error:
                damage.append(f"{path}: is damaged: {error}")
                continue
            except OSError as error:
                raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error
            for sentence in damage:
                self._say(f"{sentence}; {path.name} is used in its place")
            # Only a checkpoint that a render can go on from may replace the one before.
            self._has_written, self._is_valid = True, path == self.path
            self.resumed = render.samples
            self.info = CheckpointInfo(path, render.samples, path.stat().st_size)
            return
        if damage:
            raise CheckpointError(f"{damage[0]}; there is no other to go on from")
        self._say(f"there is no {self.path} to go on from: the render begins anew")

    def _restore_from(self, path: Path, render: ResumableState) -> None:
        arrays = render.state_arrays()

        def accept(about: Mapping[str, Any]) -> Mapping[str, NDArray[Any]]:
            if about.get("format") != _FORMAT:
                raise CheckpointError(f"{path}: is of another version of rt")
            metadata, identity = about.get("told"), about.get("identity")
            seconds = metadata.get("seconds") if isinstance(metadata, dict) else None
            has_time = isinstance(seconds, int | float) and not isinstance(seconds, bool) and math.isfinite(seconds)
            if not (has_time and isinstance(identity, dict)):
                raise DamagedError("does not say what it is of")
            difference = identity_difference(identity, self._identity_of(render))
            if difference is not None:
                raise CheckpointError(f"{path}: is of {difference}")
            return arrays

        about = array_snapshot.read(path, accept)
        try:
            render.restore(arrays, about["told"])
        except InputError as error:
            raise CheckpointError(f"{path}: {error}") from None

    def _identity_of(self, render: ResumableState) -> Mapping[str, Any]:
        if self._identity is None:
            self._identity = render.identity()
        return self._identity

    # ---- While it is rendered

    @contextmanager
    def write_periodically(self, render: ResumableState) -> Iterator[None]:
        """Write checkpoints while the `with` block renders.

        Raises
        ------
        Exception : what `say` or `show` have raised, at the end: checkpoints are written all the same.
        """
        failures: list[Exception] = []
        watcher = threading.Thread(target=self._watch, args=(render, failures), name="checkpoint writer", daemon=True)
        try:
            watcher.start()
            yield
        finally:
            self._requests.put("end")
            if watcher.ident is not None:
                watcher.join()
        if failures:
            raise failures[0]

    def _watch(self, render: ResumableState, failures: list[Exception]) -> None:
        due = now() + self._every
        while True:
            try:
                request = self._requests.get(timeout=min(max(0.0, due - now()), threading.TIMEOUT_MAX))
            except queue.Empty:
                request = "write"
            if request == "end":
                return
            start = now()
            try:
                if request == "show":
                    self._show_picture(render)
                else:
                    self._write(render, by_copy=True)
            except Exception as error:  # noqa: BLE001
                # Raised where this thread is waited for: the samples of hours do not depend on it.
                failures.append(error)
            if request == "write":
                # However often they are asked for, the render has as much time as its checkpoints.
                due = now() + max(self._every, now() - start)

    def _show_picture(self, render: ResumableState) -> None:
        if self._show is None:
            return
        try:
            with render.pool.film_read_lock():
                image = render.picture()
            self._show(image)
        except (OutputError, MemoryError) as error:
            self._say(f"{str(error) or _NO_MEMORY}; the render goes on")

    # ---- At the end

    def finish(self, render: ResumableState) -> None:
        """Write the checkpoint of a render that has ended, complete or not."""
        if render.is_complete and not (self._always or self._has_written or render.seconds >= self._every):
            return
        if self._write(render, by_copy=False) and render.is_complete and self.path is not None:
            array_snapshot.delete_previous(self.path)

    def _write(self, render: ResumableState, *, by_copy: bool) -> bool:
        """Write a checkpoint, and return True if that went well.

        by_copy : True if the render goes on meanwhile.
        """
        if self.path is None:
            return False
        try:
            with render.pool.film_read_lock():
                if render.is_empty:
                    return False
                samples, metadata = render.samples, dict(render.metadata())
                arrays = render.state_arrays()
                if by_copy:
                    arrays = {name: array.copy() for name, array in arrays.items()}
            about = {"format": _FORMAT, "identity": self._identity_of(render), "told": metadata}
            size = array_snapshot.write(self.path, about, arrays, keep=self._is_valid)
        except (OutputError, InputError, MemoryError) as error:
            if not self._is_failing:
                self._is_failing = True
                reason = str(error) or _NO_MEMORY
                self._say(f"{reason}; the render goes on in memory, and tries to keep its samples again")
            return False
        if not self._has_written:
            array_snapshot.delete_previous(self.path)
        was_failing = self._is_failing
        self._has_written, self._is_valid, self._is_failing = True, True, False
        self.info = CheckpointInfo(self.path, samples, size)
        if was_failing:
            self._say(f"{self.path}: is written again")
        return True
