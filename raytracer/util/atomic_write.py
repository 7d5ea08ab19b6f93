"""Write files whole or not at all."""

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

from raytracer.util.errors import InputError, OutputError
from raytracer.util.signals import temporary_path

Key = TypeVar("Key")

# The open files of this process, which are written to and not renamed over, even if they are regular files.
_OPEN_FILE_FOLDERS = (Path("/dev"), Path("/dev/fd"), Path("/proc/self/fd"))

TEMPORARY_NAME = re.compile(r"\.(\d{1,18})-[0-9a-f]{16}\.tmp")
"""Names of temporary files, which a killed process leaves behind; the number is that of the process."""

# Seconds to wait before each new try of a failed write.
_RETRY_SECONDS = (0.5, 1.0, 2.0, 4.0)

_POLL_SECONDS = 0.1

# Folders from which leftovers have been removed.
_swept: set[Path] = set()

# Links are not followed, pipes not waited for: both flags are missing where there is neither.
_LOCK_FLAGS: int = os.O_RDWR | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)

# As `open` makes files; and private, for files in transit through a shared folder.
_MODE, _MODE_IN_TRANSIT = 0o666, 0o600


def is_standard_output(path: Path) -> bool:
    """Return True if `path` stands for standard output: `-`, or with the suffix of a format, `-.exr`."""
    return path.parent == Path() and path.stem == "-"


def is_special(path: Path) -> bool:
    """Return True if `path` is a device, a pipe, or an open file of this process, which cannot be renamed over."""
    if is_standard_output(path):
        return True
    if path.is_dir() or not path.exists():
        return False
    return path.parent in _OPEN_FILE_FOLDERS or not stat.S_ISREG(path.stat().st_mode)


@contextlib.contextmanager
def wrap_os_errors(path: str | Path) -> Iterator[None]:
    """Turn errors of the system into an OutputError that says in one sentence why `path` cannot be written."""
    try:
        yield
    except (OSError, RuntimeError) as error:
        raise OutputError(f"{path}: cannot be written: {getattr(error, 'strerror', None) or error}") from error


@contextlib.contextmanager
def atomic_write(path: str | Path) -> Iterator[Path]:
    """Open a temporary file that replaces `path` once it is written whole; folders are made as needed.

    After any error, `path` is what it was before, and no other file is left.  A link keeps its target;
    devices and pipes get the file's bytes.

    Raises
    ------
    OutputError : the file cannot be put where it belongs (permission, quota, a full disk).
    """
    path = Path(path)
    with contextlib.ExitStack() as stack:
        with wrap_os_errors(path):
            direct = is_special(path)
            target = path if direct else path.resolve()
            folder = Path(tempfile.gettempdir()).resolve() if direct else target.parent
            folder.mkdir(parents=True, exist_ok=True)
            _remove_leftovers(folder)
            aside, held = stack.enter_context(_locked_temporary(folder, _MODE_IN_TRANSIT if direct else _MODE))
        yield aside
        with wrap_os_errors(path):
            if direct and is_standard_output(path):
                _write_standard_output(aside.read_bytes())
                return
            if direct:
                with aside.open("rb") as written, path.open("wb") as file:
                    shutil.copyfileobj(written, file)
                return
            # A file renamed before it is on the disk may be empty after a loss of power.
            with aside.open("rb+") as file:
                os.fsync(file.fileno())
            if target.exists():
                shutil.copymode(target, aside)
            if sys.platform == "win32":
                # An open file cannot be renamed there.
                held.close()
            os.replace(aside, target)


def _write_standard_output(data: bytes) -> None:
    """Write bytes to standard output, after the text that it has; a failure is not tried again."""
    try:
        sys.stdout.flush()
        sys.stdout.buffer.write(data)
        sys.stdout.buffer.flush()
    except OSError as error:
        raise OutputError(f"standard output: cannot be written: {error.strerror or error}") from None


def write_bytes(path: str | Path, data: bytes) -> None:
    """Write a file so that it is either the old one or the new one, each whole; folders are made as needed.

    Devices and pipes are written to as they are; a link keeps pointing where it does.

    Raises
    ------
    OutputError : the file cannot be written (full disk, quota, permission); nothing is left behind.
    """
    path = Path(path)
    if is_standard_output(path):
        _write_standard_output(data)
        return
    with wrap_os_errors(path):
        if is_special(path):
            path.write_bytes(data)
            return
    with atomic_write(path) as aside, wrap_os_errors(path):
        aside.write_bytes(data)


def check_file(path: str | Path) -> None:
    """Check, before something is computed, that it can be written to a file; leave nothing behind.

    Raises
    ------
    InputError : `path` is a folder or protected, or its folder cannot be made or written; or a terminal is to show
        the bytes of a file.
    """
    path = Path(path)
    if is_standard_output(path):
        if sys.stdout.isatty():
            raise InputError("-: standard output is a terminal, which shows no files: pipe it, or name a file")
        return
    try:
        if path.is_dir():
            raise InputError(f"{path}: is a folder, not a file")
        if path.exists() and not os.access(path, os.W_OK):
            raise InputError(f"{path}: may not be overwritten: it is protected against writing")
        if is_special(path):
            return

        # Folders that are missing are made when the image is written, in the nearest that is there.
        folder = path.resolve().parent
        while not folder.exists():
            folder = folder.parent
        if not folder.is_dir():
            raise InputError(f"{path}: cannot be written: {folder} is not a folder")
        if not os.access(folder, os.W_OK | os.X_OK):
            raise InputError(f"{path}: cannot be written: no permission to write in the folder {folder}")
    except (OSError, ValueError, RuntimeError) as error:
        # A name that is too long, holds a zero byte, or is a loop of links.
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path!s:.200}: cannot be written: {reason}") from error


def write_with_retries(
    tasks: Mapping[Key, Callable[[], object]],
    say: Callable[[str], object],
    is_over: Callable[[], bool],
    pool: Executor | None = None,
) -> dict[Key, OutputError]:
    """Run tasks that write files; failed ones are tried again, for some seconds, after all others.

    A disk may be full for a moment, and a folder of the network away.

    Parameters
    ----------
    say : called once with a message that a file cannot be written, and is tried again.
    is_over : returns True to stop trying.
    pool : runs the tasks in parallel; if None, the caller runs them one after the other.

    Returns
    -------
    The errors of failed tasks by key; empty if none failed.
    """
    failures = _run_tasks(tasks, pool)
    for turn, pause in enumerate(_RETRY_SECONDS):
        if is_over() or not any(isinstance(error.__cause__, OSError) for error in failures.values()):
            break
        if turn == 0:
            say(f"{next(iter(failures.values()))}; it is tried again for {sum(_RETRY_SECONDS):g} s")
        end = time.monotonic() + pause
        while time.monotonic() < end and not is_over():
            time.sleep(_POLL_SECONDS)
        failures = _run_tasks({key: tasks[key] for key in failures}, pool)
    return failures


def _run_tasks(tasks: Mapping[Key, Callable[[], object]], pool: Executor | None) -> dict[Key, OutputError]:
    """Run tasks, and return the errors of those that fail."""
    errors: dict[Key, OutputError] = {}
    begun = [task if pool is None else pool.submit(task).result for task in tasks.values()]
    for key, settle in zip(tasks, begun, strict=True):
        try:
            settle()
        except OutputError as error:
            errors[key] = error
    return errors


@contextlib.contextmanager
def _locked_temporary(folder: Path, mode: int) -> Iterator[tuple[Path, FileIO]]:
    """Make a new locked file in a folder, which is removed at the end of the `with` block if it is still there.

    The system releases the locks of a process when that ends in any way: an unlocked temporary file is left over.

    Raises
    ------
    OSError : the folder cannot be written to.
    """
    with contextlib.ExitStack() as stack:
        while True:
            aside = folder / f".{os.getpid()}-{secrets.token_hex(8)}.tmp"
            stack.enter_context(temporary_path(aside))
            held = stack.enter_context(FileIO(os.open(aside, _LOCK_FLAGS | os.O_CREAT | os.O_EXCL, mode), "r+"))
            # Another process may have taken it for a leftover before it was locked.
            if _lock(held) is not False and os.path.lexists(aside):
                break
        yield aside, held


def _lock(file: FileIO) -> bool | None:
    """Lock a file while it is open: False if another process holds it, None if the file system has no locks.

    On Windows an open file cannot be removed, so that it needs no lock.
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


def _remove_leftovers(folder: Path) -> None:
    """Remove the temporary files of killed processes from a folder, once.

    Only files that no process has locked (`_locked_temporary`), on this machine or another; on a file system without
    locks nothing is removed.
    """
    if folder in _swept:
        return
    _swept.add(folder)
    with contextlib.suppress(OSError):
        for left in folder.glob(".*.tmp"):
            match = TEMPORARY_NAME.fullmatch(left.name)
            if match is not None:
                _remove_unlocked(left, int(match[1]))


def _remove_unlocked(path: Path, process: int) -> None:
    """Remove a temporary file unless a process holds it.

    process : number of the process that made it; another process may have that number by now.
    """
    if sys.platform == "win32":
        import psutil

        # Between closing and renaming its file a process does not hold it.
        if psutil.pid_exists(process):
            return
    with contextlib.suppress(OSError):
        with FileIO(os.open(path, _LOCK_FLAGS), "r+") as file:
            if _lock(file) is not True:
                return
            # Removed while locked, so that its process cannot lock it in between.
            if sys.platform != "win32":
                path.unlink(missing_ok=True)
        path.unlink(missing_ok=True)
