"""The user's secret key, which signs files of the cache, so that nobody else's files are loaded."""

import os
import secrets
import stat
import sys
from pathlib import Path

FILE_NAME = "signing-key"

KEY_BYTES = 32

_FOLDER_MODE, _FILE_MODE = 0o700, 0o600

_BINARY: int = getattr(os, "O_BINARY", 0)

# A link is not followed, and a pipe not waited for.
_READ_FLAGS: int = os.O_RDONLY | _BINARY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)


class NoKeyError(Exception):
    """Error that the user has no key; the message says why."""


def key_folder() -> Path:
    """Find the folder of the key, by each system's custom for what programs keep; `RAYTRACER_KEY_DIR` names another.

    Raises
    ------
    NoKeyError : the user has no home, or the folder is not named by an absolute path, so that the key might be one
        that came with whatever files the program is run among.
    """
    if given := os.environ.get("RAYTRACER_KEY_DIR"):
        folder = Path(given)
    else:
        try:
            folder = _state_folder() / "raytracer"
        except RuntimeError as error:
            raise NoKeyError("the user has no home folder to keep a signing key in") from error
    if not folder.is_absolute():
        raise NoKeyError(f"the folder of the signing key, {str(folder)!r}, is not an absolute path")
    return folder


def _state_folder() -> Path:
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Application Support"
    # The XDG Base Directory Specification has relative paths ignored.
    given = os.environ.get("XDG_STATE_HOME", "")
    return Path(given) if os.path.isabs(given) else Path.home() / ".local" / "state"


def signing_key(folder: Path) -> bytes:
    """Read the key in a folder, and make it, at random, if there is none.

    Of many processes that make it at once, one does, and all have the same.

    Returns
    -------
    `KEY_BYTES` bytes.

    Raises
    ------
    NoKeyError : it cannot be read or made, or others may know it or have put it there.
    """
    path = folder / FILE_NAME
    try:
        if not os.path.lexists(path):
            _make(path)
        return _read(path)
    except OSError as error:
        raise NoKeyError(f"no signing key can be kept in {folder}: {error.strerror or error}") from error


def _make(path: Path) -> None:
    path.parent.mkdir(mode=_FOLDER_MODE, parents=True, exist_ok=True)
    temporary = path.with_suffix(f".{secrets.token_hex(8)}.tmp")
    try:
        with os.fdopen(os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | _BINARY, _FILE_MODE), "wb") as file:
            file.write(secrets.token_bytes(KEY_BYTES))
            file.flush()
            os.fsync(file.fileno())
        # Unlike a renaming, a link never takes the place of the key that another process has made meanwhile.
        try:
            os.link(temporary, path)
        except FileExistsError:
            return
        except OSError:
            # The file system has no links.  Of processes that are here at once all but the last compile once more.
            os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def _read(path: Path) -> bytes:
    if path.is_symlink():
        raise NoKeyError(f"{path} is a link")
    descriptor = os.open(path, _READ_FLAGS)
    try:
        if fault := _reject_reason(os.fstat(descriptor)):
            raise NoKeyError(f"{path} {fault}")
        return os.read(descriptor, KEY_BYTES)
    finally:
        os.close(descriptor)


def _reject_reason(status: os.stat_result) -> str | None:
    """Say why a file is not taken for the key; None if it is.  On Windows owners and modes say nothing."""
    if not stat.S_ISREG(status.st_mode):
        return "is not a regular file"
    if sys.platform != "win32":
        if status.st_uid != os.geteuid():
            return "belongs to another user"
        if status.st_mode & (stat.S_IRWXG | stat.S_IRWXO):
            return "is open to other users (remove it, and a new key is made)"
    if status.st_size != KEY_BYTES:
        return f"does not hold {KEY_BYTES} bytes (remove it, and a new key is made)"
    return None
