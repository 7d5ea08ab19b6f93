"""Progress of a whole sweep, and a bar with the time left."""

from typing import NamedTuple

from raytracer.util.progress import Bar

_LAYOUT = "{percentage:3.0f}%|{bar}| {postfix}[{elapsed}<{remaining}]"


class SweepProgress(NamedTuple):
    """Progress of a sweep.

    share : of the work that there was to do, from 0 to 1; points that were there already are none.
    points : number of points that are done or have failed.
    of : number of all points.
    name : the point that is being rendered.
    """

    share: float
    points: int
    of: int
    name: str


class SweepBar(Bar):
    """A bar of the share that is done, to be called with each progress."""

    def __init__(self, *, always: bool = False) -> None:
        super().__init__(always=always, bar_format=_LAYOUT)

    def __call__(self, done: SweepProgress) -> None:
        """Show the progress of the sweep."""
        self.update(max(done.share, self._share), 1.0, f"{done.points + 1} of {done.of}: {done.name} ")

    @property
    def _share(self) -> float:
        return 0.0 if self._bar is None else float(self._bar.n)
