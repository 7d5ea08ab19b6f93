"""Progress bar for several renders, with the time left."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from raytracer.util import progress

if TYPE_CHECKING:
    from raytracer.rendering.progress import Progress

_LAYOUT = "{percentage:3.0f}%|{bar}| {postfix}[{elapsed}<{remaining}]"


class RendersBar(progress.Bar):
    """A bar of the renders that are done, out of a number of them; not shown if `quiet`."""

    def __init__(self, renders: int, *, quiet: bool = False) -> None:
        super().__init__(quiet=quiet, bar_format=_LAYOUT)
        self._renders = renders

    def of(self, number: int, name: str) -> Callable[["Progress"], None]:
        """Make the function that shows the progress of the render of this number, from 0."""
        note = f"{number + 1} of {self._renders}: {name} "
        return lambda done: self.update(number + done.done / done.wanted, self._renders, note)
