"""One bar for several renders, with the time left."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from raytracer import progress

if TYPE_CHECKING:
    from raytracer.rendering import Progress

_LAYOUT = "{percentage:3.0f}%|{bar}| {postfix}[{elapsed}<{remaining}]"


class Bar(progress.Bar):
    """A bar of the renders that are done, of so many; none if it is to be quiet."""

    def __init__(self, renders: int, *, quiet: bool = False) -> None:
        super().__init__(quiet=quiet, bar_format=_LAYOUT)
        self._renders = renders

    def of(self, number: int, name: str) -> Callable[["Progress"], None]:
        """What shows how far the render of this number, from 0, is."""
        note = f"{number + 1} of {self._renders}: {name} "
        return lambda done: self.update(number + done.done / done.wanted, self._renders, note)
