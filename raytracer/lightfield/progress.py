"""Progress of work on a light field, for those who call."""

from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

Update = Callable[[float, float], object]
"""Callback of progress: called with the work that is done, and with all of it."""

_Item = TypeVar("_Item")


def report_progress(items: Sequence[_Item], update: Update | None) -> Iterator[_Item]:
    """Yield items, and report each once it is done."""
    for number, item in enumerate(items, 1):
        yield item
        if update is not None:
            update(number, len(items))


class ProgressCounter:
    """Counter of the work of several stages, for one callback."""

    def __init__(self, update: Update | None) -> None:
        self._update = update
        self._done = self._total = 0

    def add_total(self, steps: int) -> None:
        """Add the steps of a further stage to the total."""
        self._total += steps

    def step(self) -> None:
        """Report one more step as done."""
        self._done += 1
        if self._update is not None:
            self._update(self._done, self._total)
