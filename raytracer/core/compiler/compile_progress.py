"""The progress of a compilation, for who waits: parts done, of as many as the last kernel of this entry had."""

import contextlib
import json
import time
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from pathlib import Path
from typing import NamedTuple

from raytracer.core.compiler import cache
from raytracer.core.compiler.kernel_files import load_signed, save_signed


class CompileProgress(NamedTuple):
    """The progress of a compilation.

    Attributes
    ----------
    parts : parts that have been lowered or loaded.
    known_parts : parts of the last kernel of the same entry; a guess if there is none.
    fraction : of the whole, by what each step took for that kernel.
    """

    parts: int
    known_parts: int
    fraction: float


class _Record(NamedTuple):
    """A compilation that was finished: its parts, and the seconds until they were done and until the end."""

    parts: int
    part_seconds: float
    seconds: float


# The cover scene's, with nothing on disk.
_GUESS = _Record(130, 2.0, 3.5)

# Of smaller entries nobody has to wait for.
_MIN_PARTS = 30

_watcher: ContextVar[Callable[[CompileProgress], object] | None] = ContextVar("watcher", default=None)


@contextlib.contextmanager
def watch_compilation(report: Callable[[CompileProgress], object]) -> Iterator[None]:
    """Call `report` about ten times a second while this thread waits for the compiler, in a `with` block."""
    token = _watcher.set(report)
    try:
        yield
    finally:
        _watcher.reset(token)


class Compilation:
    """The compilation that is under way, of which there is one at a time in a process.

    Attributes
    ----------
    count : compilations that this process has finished.
    """

    def __init__(self) -> None:
        self.count = 0
        self._known = _GUESS
        self._parts = 0
        self._began: float | None = None
        self._linking: float | None = None

    @contextlib.contextmanager
    def of(self, name: str) -> Iterator[None]:
        """Note that an entry is compiled in a `with` block; what it took is kept for the next kernel of this entry."""
        self._known, self._parts, self._linking, self._began = _load(name) or _GUESS, 0, None, time.perf_counter()
        try:
            yield
            self.count += 1
            self._save(name)
        finally:
            self._began = None

    def _save(self, name: str) -> None:
        if self._began is not None and self._linking is not None and self._parts >= _MIN_PARTS:
            record = _Record(self._parts, self._linking - self._began, time.perf_counter() - self._began)
            save_signed(_path(name), json.dumps(record).encode(), sweep=False)

    def add_part(self) -> None:
        """Note that a part is done."""
        self._parts += 1

    def link(self) -> None:
        """Note that all parts are done: what is left is LLVM's work on the whole."""
        self._linking = time.perf_counter()

    def progress(self) -> CompileProgress | None:
        """Return the progress; None if nothing is being compiled."""
        if self._began is None:
            return None
        known = self._known
        split = known.part_seconds / known.seconds
        if self._linking is None:
            fraction = split * min(1.0, self._parts / known.parts)
        else:
            passed = time.perf_counter() - self._linking
            fraction = split + (1.0 - split) * min(0.99, passed / (known.seconds - known.part_seconds))
        return CompileProgress(self._parts, known.parts, fraction)

    def report(self) -> None:
        """Report the progress to who watches in this thread."""
        watcher, progress = _watcher.get(), self.progress()
        if watcher is not None and progress is not None:
            watcher(progress)


COMPILATION = Compilation()
"""That of this process."""


def _path(name: str) -> Path:
    return cache.CACHE_FOLDER / f"{name}.took"


def _load(name: str) -> _Record | None:
    content = load_signed(_path(name))
    # A file of another version holds something else.
    with contextlib.suppress(TypeError, ValueError):
        record = None if content is None else _Record(*json.loads(content))
        return record if record is not None and 0 < record.part_seconds < record.seconds and record.parts > 0 else None
    return None
