"""Handle Ctrl-C and SIGTERM, and remove temporary files when they end the process.

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
from concurrent.futures import Future
from pathlib import Path
from types import FrameType
from typing import NoReturn, TypeVar

T = TypeVar("T")

# SIGBREAK takes the place of SIGTERM on Windows.
_EXIT_SIGNALS = tuple(
    signal.Signals(number)
    for number in (getattr(signal, name, None) for name in ("SIGINT", "SIGTERM", "SIGBREAK"))
    if number is not None
)

# Shells add this to the number of the signal that has ended a process.
_SIGNAL_STATUS_BASE = 128

_POLL_SECONDS = 0.1

_temporary_paths: set[Path] = set()


@contextlib.contextmanager
def temporary_path(path: Path) -> Iterator[Path]:
    """Remove a file or a folder at the end of the `with` block, also if the process ends within it."""
    _temporary_paths.add(path)
    try:
        yield path
    finally:
        _remove(path)
        _temporary_paths.discard(path)


def _remove(path: Path) -> None:
    with contextlib.suppress(OSError):
        if path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)


def run_in_thread(work: Callable[[], T], while_waiting: Callable[[], object] | None = None) -> T:
    """Run `work` in a thread while the main thread waits, so that an interrupt ends only the waiting.

    For the compiler, which takes a KeyboardInterrupt for a mistake of its own, and may take 20 s.  It goes on after an
    interrupt, unless the process ends: its result serves later callers.

    while_waiting : called by the main thread about ten times a second.

    Raises
    ------
    BaseException : `work` has raised it.
    KeyboardInterrupt : of the main thread, at once.
    """
    if threading.current_thread() is not threading.main_thread():
        return work()
    outcome: Future[T] = Future()

    def target() -> None:
        try:
            outcome.set_result(work())
        except BaseException as error:  # noqa: BLE001
            # Raised where the thread is waited for.
            outcome.set_exception(error)

    # No daemon: the interpreter does not shut down well while the compiler runs.
    worker = threading.Thread(target=target, name="run_in_thread")
    worker.start()
    while worker.is_alive():
        # Without a timeout, an interrupt would not wake Windows.
        worker.join(_POLL_SECONDS)
        if while_waiting is not None:
            while_waiting()
    return outcome.result()


def raise_interrupt() -> NoReturn:
    """Raise KeyboardInterrupt in the main thread, which calls this."""
    raise KeyboardInterrupt


def defer_interrupt() -> None:
    """Do nothing: the work under way calls `SignalWatcher.raise_if_interrupted` at a place of its choice."""


class SignalWatcher:
    """Watcher of the signals that ask the process to end: the first runs an action, a second ends the process.

    signal_number : number of the first signal; None if none has come.
    """

    def __init__(self) -> None:
        self.signal_number: int | None = None
        self._first_action: Callable[[], None] | None = None
        self._is_raised = False
        # Reentrant, as a signal's handler may come here within another's.
        self._exit_lock = threading.RLock()

    @property
    def status(self) -> int:
        """Exit status for the signal that came; that of Ctrl-C if none was seen."""
        return _SIGNAL_STATUS_BASE + (signal.SIGINT if self.signal_number is None else self.signal_number)

    def start(self) -> None:
        """Watch, from the main thread, for all signals that the process does not ignore."""
        near, far = socket.socketpair()
        far.setblocking(False)
        # The other end is open as long as the process is.
        signal.set_wakeup_fd(far.detach(), warn_on_full_buffer=False)
        threading.Thread(target=self._listen, args=(near,), name="signals", daemon=True).start()
        for number in _EXIT_SIGNALS:
            if signal.getsignal(number) != signal.SIG_IGN:
                signal.signal(number, self._on_signal)

    @contextlib.contextmanager
    def on_first_signal(self, action: Callable[[], None]) -> Iterator[None]:
        """Set the action of the first signal, in the main thread, for a `with` block; otherwise it ends the process.

        action : `raise_interrupt` or `defer_interrupt`.
        """
        before, self._first_action = self._first_action, action
        try:
            yield
        finally:
            self._first_action = before

    def handles_first(self, action: Callable[[], None]) -> bool:
        """Return True if this is the action of the first signal."""
        return self._first_action is action

    def raise_if_interrupted(self) -> None:
        """Raise KeyboardInterrupt if a signal has come; once."""
        if self.signal_number is not None and not self._is_raised:
            self._is_raised = True
            raise KeyboardInterrupt

    def exit_now(self, status: int | None = None, sentence: str | None = None) -> NoReturn:
        """End the process at once, whatever its threads do, and remove its temporary files.

        status : the exit status; that of an interrupt if None.
        sentence : message on stderr.
        """
        # Never released: the first thread that comes here ends the process.
        self._exit_lock.acquire()
        # Silence other threads' messages about files that are removed under them.
        sys.stderr = io.StringIO()
        for path in tuple(_temporary_paths):
            _remove(path)
        with contextlib.suppress(OSError):
            if sentence is not None:
                # A progress bar has left the cursor within its line.
                os.write(2, f"{chr(10) if os.isatty(2) else ''}rt: {sentence}\n".encode())
        os._exit(self.status if status is None else status)

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        is_first = self.signal_number is None
        if is_first:
            self.signal_number = number
        if self._first_action is None:
            self.exit_now(sentence="interrupted")
        elif is_first:
            self._first_action()

    def _listen(self, near: socket.socket) -> None:
        count = 0
        while number := near.recv(1):
            if number[0] not in _EXIT_SIGNALS:
                continue
            count += 1
            # The main thread ends the process by itself, if it gets to its handler.
            if count > 1 or (self._first_action is None and self.signal_number is None):
                self.signal_number = self.signal_number or number[0]
                self.exit_now(sentence="interrupted")


WATCH = SignalWatcher()
"""The watcher of this process."""


@contextlib.contextmanager
def on_hangup(action: Callable[[], object]) -> Iterator[None]:
    """Set the action of SIGHUP for a `with` block in the main thread; Windows has no such signal."""
    number = getattr(signal, "SIGHUP", None)
    if number is None or threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(number, lambda number, frame: action())
    try:
        yield
    finally:
        signal.signal(number, before)
