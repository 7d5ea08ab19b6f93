"""What ends the work of a process before its time, Ctrl-C or SIGTERM, and what is not left behind then.

Python calls a signal's handler between two steps of its main thread, which may be within a library for minutes: it
builds a tree for the ray caster, or cleans a picture.  So the number of the signal also goes to a thread that does
nothing but wait for it (`signal.set_wakeup_fd`), and which can end the process meanwhile.
"""

import contextlib
import io
import os
import shutil
import signal
import socket
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType
from typing import NoReturn, TypeVar

T = TypeVar("T")

# SIGBREAK is what Windows has in place of SIGTERM.
_ENDING = tuple(
    signal.Signals(number)
    for number in (getattr(signal, name, None) for name in ("SIGINT", "SIGTERM", "SIGBREAK"))
    if number is not None
)

# What shells add to the number of the signal that has ended a process.
_STATUS = 128

_WAKE_UP_SECONDS = 0.1

_unfinished: set[Path] = set()


@contextlib.contextmanager
def unfinished(path: Path) -> Iterator[Path]:
    """Have a file or a folder removed at the end of the `with` block, also where the process is left within it."""
    _unfinished.add(path)
    try:
        yield path
    finally:
        _remove(path)
        _unfinished.discard(path)


def _remove(path: Path) -> None:
    with contextlib.suppress(OSError):
        if path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)


def unhindered(work: Callable[[], T]) -> T:
    """Do `work` in a thread while the main thread waits for it, so that an interrupt ends the waiting, and no more.

    For the compiler, which takes a KeyboardInterrupt for a mistake of its own, and may take 20 s.  It goes on after an
    interrupt, unless the process is left: who needs what it makes will find it.

    Raises
    ------
    BaseException : what `work` has raised.
    KeyboardInterrupt : of the main thread, at once.
    """
    if threading.current_thread() is not threading.main_thread():
        return work()
    results: list[T] = []
    failures: list[BaseException] = []

    def labour() -> None:
        try:
            results.append(work())
        except BaseException as error:  # noqa: BLE001
            # Raised where the thread is waited for.
            failures.append(error)

    # No daemon: an interpreter does not end well beside a compiler at work.
    worker = threading.Thread(target=labour, name="unhindered")
    worker.start()
    while worker.is_alive():
        # Without an end, an interrupt would not wake Windows.
        worker.join(_WAKE_UP_SECONDS)
    if failures:
        raise failures[0]
    return results[0]


def stop() -> NoReturn:
    """Interrupt the main thread, which calls this.

    Raises
    ------
    KeyboardInterrupt : always.
    """
    raise KeyboardInterrupt


def wait() -> None:
    """Leave it to the work under way to ask, by `Watch.heed`, whether it is to end."""


class Watch:
    """Is told of the signals that ask the process to end.  The first does what it is to do then; a second ends all.

    Attributes
    ----------
    asked : the number of the signal; None if none has come.
    """

    def __init__(self) -> None:
        self.asked: int | None = None
        self._first: Callable[[], None] | None = None
        self._is_heeded = False
        # Reentrant, as a signal's handler may come here within another's.
        self._leaving = threading.RLock()

    @property
    def status(self) -> int:
        """Exit status of a process that was asked to end; by Ctrl-C if nobody watched."""
        return _STATUS + (signal.SIGINT if self.asked is None else self.asked)

    def start(self) -> None:
        """Watch, from the main thread, for all signals that the process was not started to ignore."""
        near, far = socket.socketpair()
        far.setblocking(False)
        # The other end is open as long as the process is.
        signal.set_wakeup_fd(far.detach(), warn_on_full_buffer=False)
        threading.Thread(target=self._listen, args=(near,), name="signals", daemon=True).start()
        for number in _ENDING:
            if signal.getsignal(number) != signal.SIG_IGN:
                signal.signal(number, self._heard)

    @contextlib.contextmanager
    def on_first(self, what: Callable[[], None]) -> Iterator[None]:
        """Have the first signal do this in the main thread while the `with` block runs; elsewhere it ends the process.

        what : `stop` or `wait`.
        """
        before, self._first = self._first, what
        try:
            yield
        finally:
            self._first = before

    def is_first(self, what: Callable[[], None]) -> bool:
        """Whether the first signal is to do this."""
        return self._first is what

    def heed(self) -> None:
        """End what runs if a signal has come; once.

        Raises
        ------
        KeyboardInterrupt : one has.
        """
        if self.asked is not None and not self._is_heeded:
            self._is_heeded = True
            raise KeyboardInterrupt

    def leave(self, status: int | None = None, sentence: str | None = None) -> NoReturn:
        """End the process at once, whatever its threads are at; what they are writing is taken away.

        Parameters
        ----------
        status : the exit status; that of an interrupt if None.
        sentence : what to say.
        """
        # Not given back: of all threads that come here, one ends them all.
        self._leaving.acquire()
        # What others say of files that are taken from them now is of no use to anybody.
        sys.stderr = io.StringIO()
        for path in tuple(_unfinished):
            _remove(path)
        with contextlib.suppress(OSError):
            if sentence is not None:
                # A bar has left the cursor within its line.
                os.write(2, f"{chr(10) if os.isatty(2) else ''}rt: {sentence}\n".encode())
        os._exit(self.status if status is None else status)

    def _heard(self, number: int, frame: FrameType | None) -> None:
        is_first = self.asked is None
        if is_first:
            self.asked = number
        if self._first is None:
            self.leave(sentence="interrupted")
        elif is_first:
            self._first()

    def _listen(self, near: socket.socket) -> None:
        count = 0
        while number := near.recv(1):
            if number[0] not in _ENDING:
                continue
            count += 1
            # The main thread leaves by itself, if it hears of it.
            if count > 1 or (self._first is None and self.asked is None):
                self.asked = self.asked or number[0]
                self.leave(sentence="interrupted")


WATCH = Watch()
"""That of this process."""


@contextlib.contextmanager
def on_hangup(what: Callable[[], object]) -> Iterator[None]:
    """Have SIGHUP do this and no more while the `with` block runs, in the main thread; Windows has no such signal."""
    number = getattr(signal, "SIGHUP", None)
    if number is None or threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(number, lambda number, frame: what())
    try:
        yield
    finally:
        signal.signal(number, before)
