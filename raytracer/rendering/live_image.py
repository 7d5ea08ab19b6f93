"""An image in a notebook's cell that is shown while it is rendered, by IPython's displays and nothing else."""

import contextlib
import importlib
import sys
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

from raytracer.film.image import Image
from raytracer.rendering.progress import Progress

if TYPE_CHECKING:
    from raytracer.rendering.session import RenderSession

# Seconds between two updates, and the part of the time that making them takes at most: the thread that makes them has
# nothing else to do, but threads that render may need its processor.
_INTERVAL, _MOST_OF_TIME = 0.5, 0.1


def is_in_notebook() -> bool:
    """Tell if this runs in a kernel of IPython, which then is imported already."""
    ipython = sys.modules.get("IPython")
    return ipython is not None and getattr(ipython.get_ipython(), "kernel", None) is not None


class LiveImage:
    """An observer of a render that shows its picture in the cell that renders; elsewhere it does nothing.

    progress : called with the progress, besides.
    """

    def __init__(self, progress: Callable[[Progress], None] | None = None) -> None:
        self._progress = progress
        self._session: RenderSession | None = None
        self._handle: Any = None
        self._next_update = 0.0

    @contextlib.contextmanager
    def observe(self, session: "RenderSession") -> Iterator[None]:
        """Show the picture of a render in a `with` block."""
        self._session = session
        try:
            yield
        finally:
            self._session = None

    def tick(self, progress: Progress) -> None:
        """Show the picture so far, unless that was done just now; to be called with the progress."""
        if self._progress is not None:
            self._progress(progress)
        begin = time.perf_counter()
        if self._session is not None and progress.done > 0 and begin >= self._next_update and is_in_notebook():
            self._show(self._session.develop())
            end = time.perf_counter()
            self._next_update = end + max(_INTERVAL, (end - begin) / _MOST_OF_TIME)

    def finish(self, image: Image) -> None:
        """Show the finished picture in its place."""
        self._show(image)

    def _show(self, image: Image) -> None:
        if not is_in_notebook():
            return
        if self._handle is None:
            self._handle = importlib.import_module("IPython.display").display(image, display_id=True)
        else:
            self._handle.update(image)
