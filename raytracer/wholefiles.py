"""Files that are written whole or not at all."""

import contextlib
import os
import secrets
import shutil
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path

from raytracer.errors import OutputError

# The open files of this process, which are written to and not renamed over, even if they are regular files.
_OPEN_FILES = (Path("/dev"), Path("/dev/fd"), Path("/proc/self/fd"))


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
                folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
            else:
                folder = target.parent
                folder.mkdir(parents=True, exist_ok=True)
        aside = folder / f".{secrets.token_hex(8)}.tmp"
        stack.callback(_removed, aside)
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


def _removed(path: Path) -> None:
    with contextlib.suppress(OSError):
        path.unlink(missing_ok=True)
