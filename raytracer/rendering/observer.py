"""Observers of a running render, in threads of their own: they look at its film, which is rendered as without them."""

from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from raytracer.film.image import Image
from raytracer.film.window import Window

if TYPE_CHECKING:
    from raytracer.rendering.session import RenderSession


class RenderObserver(Protocol):
    """An observer of one render after another."""

    def observe(self, session: "RenderSession") -> AbstractContextManager[object]:
        """Observe a render in a `with` block."""

    def finish(self, image: Image) -> None:
        """Take the finished picture."""


class PictureSoFar:
    """The picture of a running render, and what has changed of it.

    A tile that a thread adds samples to just then may hold some of them; it has changed when they are all there, and is
    seen again.

    width, height (px) : of the picture.
    """

    def __init__(self, session: "RenderSession") -> None:
        self._session, self._queue = session, session.queue
        window = session.region.window
        self._left, self._top = window.left, window.top
        self.width, self.height = window.right - window.left, window.bottom - window.top
        self.forget()

    def forget(self) -> None:
        """Take all that has samples for changed."""
        self._counts = np.zeros_like(self._queue.counts)

    def look(self) -> tuple[NDArray[np.float64], list[Window]]:
        """Return the picture, float64 (height, width, 3), and the windows that have changed since the last look."""
        counts = self._queue.counts.copy()
        changed = np.flatnonzero(counts != self._counts)
        self._counts = counts
        if not changed.size:
            return self._queue.mean, []
        if self._session.is_radiance:
            return self._queue.mean, self._join(changed)
        # Whatever changes, the exposure may change with it.
        return self._session.develop().radiance, [Window(0, 0, self.width, self.height)]

    def _join(self, tiles: NDArray[np.intp]) -> list[Window]:
        """Join tiles that lie side by side."""
        joined: list[Window] = []
        for tile in tiles:
            left, top, right, bottom = self._queue.windows[tile]
            window = Window(left - self._left, top - self._top, right - self._left, bottom - self._top)
            last = joined[-1] if joined else None
            if last is not None and (last.right, last.top) == (window.left, window.top):
                joined[-1] = last._replace(right=window.right)
            else:
                joined.append(window)
        return joined
