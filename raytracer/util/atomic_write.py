"""Files that are written whole or not at all."""

import contextlib
import os
import re
import secrets
import shutil
import stat
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor
from io import FileIO
from pathlib import Path
from typing import TypeVar

from raytracer.errors import OutputError
from raytracer.interrupts import unfinished

Key = TypeVar("Key")

# The open files of this process, which are written to and not renamed over, even if they are regular files.
_OPEN_FILES = (Path("/dev"), Path("/dev/fd"), Path("/proc/self/fd"))

ASIDE = re.compile(r"\.(\d{1,18})-[0-9a-f]{16}\.tmp")
"""Names of files that are being written, or were when their process was killed; the number is that process's."""

# Seconds to wait before what could not be written is tried again.
_PAUSES = (0.5, 1.0, 2.0, 4.0)

_WAKE_UP_SECONDS = 0.1

# Folders in which none of those is left.
_swept: set[Path] = set()

# Links are not followed, pipes not waited for: both flags are missing where there is neither.
_TO_LOCK: int = os.O_RDWR | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)

# As `open` makes files; and what nobody else is to read on its way through a folder that all share.
_MODE, _MODE_IN_TRANSIT = 0o666, 0o600


def is_special(path: Path) -> bool:
    """Whether `path` is a device, a pipe, or an open file of this process, which cannot be renamed over."""
    if path.is_dir() or not path.exists():
        return False
    return path.parent in _OPEN_FILES or not stat.S_ISREG(path.stat().st_mode)


@contextlib.contextmanager
def told(path: str | Path) -> Iterator[None]:
    """Say in one sentence why `path` cannot be written.

    Raises
    ------
    OutputError : for what the system raises.
    """
    try:
        yield
    except (OSError, RuntimeError) as error:
        raise OutputError(f"{path}: cannot be written: {getattr(error, 'strerror', None) or error}") from error


@contextlib.contextmanager
def whole(path: str | Path) -> Iterator[Path]:
    """A new file to write, which takes the place of `path` once all has gone well; folders are made as needed.

    Whatever goes wrong, `path` is what it was before, and nothing else is left.  A link keeps pointing where it does;
    devices and pipes get the file's bytes.

    Raises
    ------
    OutputError : the file cannot be put where it belongs (permission, quota, a full disk).
    """
    path = Path(path)
    with contextlib.ExitStack() as stack:
        with told(path):
            direct = is_special(path)
            target = path if direct else path.resolve()
            folder = Path(tempfile.gettempdir()).resolve() if direct else target.parent
            folder.mkdir(parents=True, exist_ok=True)
            _sweep(folder)
            aside, held = stack.enter_context(_held(folder, _MODE_IN_TRANSIT if direct else _MODE))
        yield aside
        with told(path):
            if direct:
                with aside.open("rb") as written, path.open("wb") as file:
                    shutil.copyfileobj(written, file)
                return
            # What is renamed before it is on the disk may be empty after a loss of power.
            with aside.open("rb+") as file:
                os.fsync(file.fileno())
            if target.exists():
                shutil.copymode(target, aside)
            if sys.platform == "win32":
                # What is open cannot be renamed there.
                held.close()
            os.replace(aside, target)


def persist(
    tasks: Mapping[Key, Callable[[], object]],
    say: Callable[[str], object],
    is_over: Callable[[], bool],
    pool: Executor | None = None,
) -> dict[Key, OutputError]:
    """Do what writes files; what the system does not allow again, for some seconds, once all the rest is done.

    A disk may be full for a moment, and a folder of the network away.

    Parameters
    ----------
    say : told, once, what cannot be written, and that it is tried again.
    is_over : whether to try no more.
    pool : who does all side by side; the caller, one after the other, if None.

    Returns
    -------
    Why tasks could not be done; empty if all are.
    """
    failures = _failures(tasks, pool)
    for turn, pause in enumerate(_PAUSES):
        if is_over() or not any(isinstance(error.__cause__, OSError) for error in failures.values()):
            break
        if turn == 0:
            say(f"{next(iter(failures.values()))}; it is tried again for {sum(_PAUSES):g} s")
        end = time.monotonic() + pause
        while time.monotonic() < end and not is_over():
            time.sleep(_WAKE_UP_SECONDS)
        failures = _failures({key: tasks[key] for key in failures}, pool)
    return failures


def _failures(tasks: Mapping[Key, Callable[[], object]], pool: Executor | None) -> dict[Key, OutputError]:
    """Why tasks could not be done, of those that could not."""
    found: dict[Key, OutputError] = {}
    begun = [task if pool is None else pool.submit(task).result for task in tasks.values()]
    for key, settle in zip(tasks, begun, strict=True):
        try:
            settle()
        except OutputError as error:
            found[key] = error
    return found


@contextlib.contextmanager
def _held(folder: Path, mode: int) -> Iterator[tuple[Path, FileIO]]:
    """Make a new file in a folder, and hold it until the end of the `with` block, when it is removed if still there.

    The system lets go of what a process holds when that ends, however it does: so what nobody holds is left over.

    Raises
    ------
    OSError : the folder cannot be written to.
    """
    with contextlib.ExitStack() as stack:
        while True:
            aside = folder / f".{os.getpid()}-{secrets.token_hex(8)}.tmp"
            stack.enter_context(unfinished(aside))
            held = stack.enter_context(FileIO(os.open(aside, _TO_LOCK | os.O_CREAT | os.O_EXCL, mode), "r+"))
            # A sweep may have come between, and have taken it for a leftover.
            if _lock(held) is not False and os.path.lexists(aside):
                break
        yield aside, held


def _lock(file: FileIO) -> bool | None:
    """Hold a file for as long as it is open: False if another process does, None where the file system has no locks.

    On Windows a file that is open anywhere cannot be removed: opening it holds it.
    """
    if sys.platform == "win32":
        return True
    import fcntl

    try:
        fcntl.flock(file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return None
    return True


def _sweep(folder: Path) -> None:
    """Remove what processes that were killed have left aside in a folder, once.

    Only what no process holds (`_held`), this machine's or another's; on a file system without locks nothing is.
    """
    if folder in _swept:
        return
    _swept.add(folder)
    with contextlib.suppress(OSError):
        for left in folder.glob(".*.tmp"):
            found = ASIDE.fullmatch(left.name)
            if found is not None:
                _remove_if_left(left, int(found[1]))


def _remove_if_left(path: Path, process: int) -> None:
    """Remove a file aside unless a process holds it.

    process : that made it, by its number there; another may have that by now, so that it says little.
    """
    if sys.platform == "win32":
        import psutil

        # Between closing and renaming its file a process does not hold it.
        if psutil.pid_exists(process):
            return
    with contextlib.suppress(OSError):
        with FileIO(os.open(path, _TO_LOCK), "r+") as file:
            if _lock(file) is not True:
                return
            # While it is held, lest its process holds it only now.
            if sys.platform != "win32":
                path.unlink(missing_ok=True)
        path.unlink(missing_ok=True)
