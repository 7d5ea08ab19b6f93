"""Timing and progress of the phases of a study."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NamedTuple


class Progress(NamedTuple):
    """Phase of a study that is under way, and the fraction of it that is done."""

    phase: str
    fraction: float


class PhaseTimer:
    """Seconds by phase, and reports of progress.

    seconds : by phase; loading the scene was done before.
    """

    def __init__(self, progress: Callable[[Progress], None] | None, load_seconds: float) -> None:
        self._progress = progress or (lambda _: None)
        self.seconds = {"load": load_seconds}

    @contextmanager
    def phase(self, name: str, label: str = "") -> Iterator[Callable[[float], None]]:
        """Time the phase within; yields a function that reports the fraction of it that is done.

        label : what users read, if that is not the name.
        """
        start, shown = time.perf_counter(), label or name
        self._progress(Progress(shown, 0.0))
        try:
            yield lambda fraction: self._progress(Progress(shown, fraction))
        finally:
            self.seconds[name] = time.perf_counter() - start
