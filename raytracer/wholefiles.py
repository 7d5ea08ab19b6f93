"""Files that are written whole or not at all."""

import contextlib
import os
import re
import secrets
import shutil
import stat
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor
from pathlib import Path
from typing import TypeVar

from raytracer.errors import OutputError
from raytracer.interrupts import unfinished

Key = TypeVar("Key")

# The open files of this process, which are written to and not renamed over, even if they are regular files.
_OPEN_FILES = (Path("/dev"), Path("/dev/fd"), Path("/proc/self/fd"))

ASIDE = re.compile(r"\.(\d{1,18})-[0-9a-f]{16}\.tmp")
"""Names of files that are being written, or were when their process, whose number this holds, was killed."""

# Seconds to wait before what could not be written is tried again.
_PAUSES = (0.5, 1.0, 2.0, 4.0)

_WAKE_UP_SECONDS = 0.1

# Folders in which none of those is left.
_swept: set[Path] = set()


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
            if direct:
                folder = stack.enter_context(unfinished(Path(tempfile.mkdtemp())))
            else:
                folder = target.parent
                folder.mkdir(parents=True, exist_ok=True)
        aside = folder / f".{os.getpid()}-{secrets.token_hex(8)}.tmp"
        stack.enter_context(unfinished(aside))
        _sweep(folder)
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


def _sweep(folder: Path) -> None:
    """Remove what processes that were killed have left aside in a folder, once.

    A process of another machine may be taken for one that is gone: its file then cannot take its place.
    """
    if folder in _swept:
        return
    _swept.add(folder)
    import psutil

    with contextlib.suppress(OSError):
        for left in folder.glob(".*.tmp"):
            found = ASIDE.fullmatch(left.name)
            if found is not None and not psutil.pid_exists(int(found[1])):
                _removed(left)


def _removed(path: Path) -> None:
    with contextlib.suppress(OSError):
        path.unlink(missing_ok=True)
