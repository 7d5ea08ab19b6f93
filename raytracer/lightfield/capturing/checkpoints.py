"""Checkpoints of a capture: one file for each band."""

from collections.abc import Callable
from pathlib import Path

from raytracer.rendering.checkpoint import CheckpointWriter, checkpoint_path
from raytracer.rendering.tile_scheduler import now
from raytracer.util.array_snapshot import previous_path


class BandCheckpoints:
    """Checkpoint writers of the bands, one after the other.

    Parameters
    ----------
    path : of the light field; checkpoints are beside it.
    every : seconds between checkpoints; none are written if None.
    start : of the capture (s).
    resume : True to go on from checkpoints that are there.
    say : called with sentences for the user.
    """

    def __init__(
        self, path: Path, every: float | None, start: float, resume: bool, say: Callable[[str], object]
    ) -> None:
        self._path, self._every, self._start, self._resume, self._say = path, every, start, resume, say
        self._writers: list[CheckpointWriter] = []

    def next(self) -> CheckpointWriter | None:
        """Make the writer of the next band; None without checkpoints."""
        if self._every is None:
            return None
        # A shorter capture, bands before included, is soon rendered again.
        always = now() - self._start >= self._every
        file = checkpoint_path(self._path.with_name(f"{self._path.name}.{len(self._writers) + 1}"))
        # Bands that were not begun have no checkpoint.
        resume = self._resume and (file.exists() or previous_path(file).exists() or not self._writers)
        self._writers.append(CheckpointWriter(file, every=self._every, resume=resume, always=always, say=self._say))
        return self._writers[-1]

    def delete(self) -> None:
        """Remove the files, once the light field is written."""
        for writer in self._writers:
            if writer.info is not None or writer.resumed:
                writer.delete()
