"""One bar for a whole sweep, with the time left."""

from typing import TYPE_CHECKING

from raytracer.progress import Bar

if TYPE_CHECKING:
    from raytracer.sweeping.run import Done

_LAYOUT = "{percentage:3.0f}%|{bar}| {postfix}[{elapsed}<{remaining}]"


class SweepBar(Bar):
    """A bar of the share that is done, to be called with each progress."""

    def __init__(self, *, always: bool = False) -> None:
        super().__init__(always=always, bar_format=_LAYOUT)

    def __call__(self, done: "Done") -> None:
        """Show how far the sweep is."""
        self.update(max(done.share, self._share), 1.0, f"{done.points + 1} of {done.of}: {done.name} ")

    @property
    def _share(self) -> float:
        return 0.0 if self._bar is None else float(self._bar.n)
