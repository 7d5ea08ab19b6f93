"""Timing and progress of the phases of a study."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NamedTuple

from raytracer.rendering.statistics import PhaseTimer


class Progress(NamedTuple):
    """Phase of a study that is under way, and the fraction of it that is done."""

    phase: str
    fraction: float


class StudyTimer(PhaseTimer):
    """Seconds by phase, and reports of progress."""

    def __init__(self, seconds: dict[str, float], progress: Callable[[Progress], None] | None) -> None:
        super().__init__(seconds)
        self._progress = progress or (lambda _: None)

    @contextmanager
    def phase(self, name: str, label: str = "") -> Iterator[Callable[[float], None]]:
        """Time the phase within; yields a function that reports the fraction of it that is done.

        label : what users read, if that is not the name.
        """
        shown = label or name
        self.resume()
        self._progress(Progress(shown, 0.0))
        try:
            yield lambda fraction: self._progress(Progress(shown, fraction))
        finally:
            self.lap(name)
