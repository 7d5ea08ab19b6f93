"""Reports of a sweep's points, in the order in which they were rendered."""

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future

from raytracer.analysis.sweep.results import PointResult


class ReportQueue:
    """Queue that reports points as they are saved.

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
