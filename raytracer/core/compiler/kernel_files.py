"""Files of compiled kernels, one for each, which many processes may search, write and read at once.

What is read is executed: Python's pickles run code, and machine code is code.  A folder that came with an archive or a
repository belongs to whoever unpacked it, so that owners and modes do not tell whose files are in it.  Each file is
therefore signed by a key of the user's own, which lies elsewhere, and the signature checked before all else.
"""

import contextlib
import hashlib
import hmac
import os
import pickle
import stat
import sys
import time
import uuid
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from raytracer.core.compiler.signing_key import NoKeyError, key_folder, signing_key

_MAX_WAIT = 300.0
"""Seconds after which a kernel is compiled all the same: ten times what the largest takes.  Windows says of a folder
that may not be written what it says of a lock that is held."""

_STALE = 12 * _MAX_WAIT
"""Seconds after which a lock, or a file that is being written, is left over from a process that was killed."""

_STALE_PATTERNS = ("*.lock", "*.tmp")

# What a file begins with: what it is, and the HMAC-SHA-256 (RFC 2104) of its name and of all that follows.
_MAGIC = b"rt kernel 2\n"
_HEADER_BYTES = len(_MAGIC) + hashlib.sha256().digest_size

# To other users, who have other keys, the files are of no use.
_FOLDER_MODE, _FILE_MODE = 0o700, 0o600

_BINARY: int = getattr(os, "O_BINARY", 0)

_warned: set[str] = set()


class CacheWarning(RuntimeWarning):
    """Warning that compiled kernels are neither loaded nor saved, since the folder may hold other users' files."""


def source_hash(*packages: Path, versions: Sequence[str] = ()) -> str:
    """Hash (64 hex digits) the Python sources of packages, the interpreter's version, and further versions.

    packages : their folders, which lie side by side.
    """
    digest = hashlib.sha256()
    for package in packages:
        for path in sorted(package.rglob("*.py")):
            digest.update(path.relative_to(package.parent).as_posix().encode())
            digest.update(path.read_bytes())
    digest.update(" ".join((*versions, sys.version)).encode())
    return digest.hexdigest()


class KernelFiles:
    """The files of one function's compiled versions, in place of Numba's own numbered files with an index.

    Numba's index is read, added to and written back by each process.  Of two that do so at the same time one's entry is
    lost; or both take the same number for what they compiled, and a third process loads the one for the other (numba
    0.68, `IndexDataCacheFile.save`).  Here a file's name follows from its key, which it also contains.

    Parameters
    ----------
    folder : of the files; made when the first is saved.
    name : prefix of their names.
    """

    def __init__(self, folder: Path, name: str) -> None:
        self._folder, self._name = folder, name

    def path(self, key: Any) -> Path:
        """Name the file for a key: types of arguments, processor, and hashes of the function."""
        return self._folder / f"{self._name}.{hashlib.sha256(repr(key).encode()).hexdigest()[:24]}.nbc"

    def load(self, key: Any) -> Any:
        """Load the kernel compiled for a key; None if it is missing, damaged, or not signed by the user's key."""
        # A file of another version may raise nearly anything.
        with contextlib.suppress(Exception):
            held, data = pickle.loads(load_signed(self.path(key)) or b"")
            if held == key:
                return data
        return None

    def has(self, key: Any) -> bool:
        """Tell if there is a file for a key that is signed by the user's key, so that it will be tried."""
        return load_signed(self.path(key)) is not None

    def save(self, key: Any, data: Any) -> None:
        """Save the kernel compiled for a key atomically.

        If the disk is full, or may not be written, it is compiled anew each time.
        """
        save_signed(self.path(key), pickle.dumps((key, data), protocol=-1))

    @contextlib.contextmanager
    def compile_lock(self, key: Any) -> Iterator[None]:
        """Wait for another process that compiles for this key: what it then has saved need not be compiled again."""
        with contextlib.ExitStack() as stack:
            if not self.has(key):
                # Without a lock, as in a folder that cannot be written, both compile.
                with contextlib.suppress(OSError, NotImplementedError):
                    stack.enter_context(self._lock(key))
                # All who waited may load at once.
                if self.has(key):
                    stack.close()
            yield

    def _lock(self, key: Any) -> contextlib.AbstractContextManager[Any]:
        from filelock import FileLock

        make_folder(self._folder)
        signed = _signed_path(self.path(key))
        return contextlib.nullcontext() if signed is None else FileLock(signed[0].with_suffix(".lock"), _MAX_WAIT)


def make_folder(folder: Path) -> None:
    """Make a folder that its owner alone may write to, if it is not there.

    Raises
    ------
    OSError : it cannot be made.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    folder.mkdir(mode=_FOLDER_MODE, exist_ok=True)


def load_signed(path: Path) -> bytes | None:
    """Load what `save_signed` wrote into a file; None if it is missing, damaged, or not signed by the user's key.

    Parameters
    ----------
    path : in a folder of the cache's folder.
    """
    with contextlib.suppress(OSError):
        if signed := _signed_path(path):
            own, secret = signed
            content = _read(own)
            if content is not None and hmac.compare_digest(
                content[:_HEADER_BYTES], _signed_header(own, content[_HEADER_BYTES:], secret)
            ):
                return content[_HEADER_BYTES:]
    return None


def save_signed(path: Path, content: bytes, *, sweep: bool = True) -> None:
    """Write a file of the cache atomically, signed by the user's key.

    If that cannot be done, nothing is written.

    Parameters
    ----------
    path : in a folder of the cache's folder.
    sweep : also remove temporary files of processes that were killed, for which the folder is searched.
    """
    with contextlib.suppress(OSError):
        make_folder(path.parent)
        signed = _signed_path(path)
        if signed is None:
            return
        own, secret = signed
        temporary = own.with_suffix(f".{uuid.uuid4().hex[:16]}.tmp")
        try:
            with os.fdopen(
                os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | _BINARY, _FILE_MODE), "wb"
            ) as file:
                file.write(_signed_header(own, content, secret))
                file.write(content)
            os.replace(temporary, own)
        finally:
            temporary.unlink(missing_ok=True)
        if sweep:
            _remove_stale(path.parent)


def _signed_path(path: Path) -> tuple[Path, bytes] | None:
    """Name the file that the user's key signs in place of `path`, and return the key.

    Files of different keys lie side by side, so that none overwrites another.  None, with one warning, if there is no
    key, or others may write to the folder.

    Raises
    ------
    OSError : there is no folder.
    """
    if not _is_trusted(path.parent):
        return None
    cache = path.parent.parent
    try:
        folder = key_folder()
        if Path(os.path.realpath(folder)).is_relative_to(os.path.realpath(cache)):
            raise NoKeyError(
                f"the folder of the signing key, {folder}, lies in that of the cache, {cache}, with which the key may "
                "have come from somebody else"
            )
        secret = signing_key(folder)
    except NoKeyError as error:
        _warn(str(error), "RAYTRACER_KEY_DIR names another folder for the key")
        return None
    return path.with_suffix(f".{hmac.digest(secret, b'name', 'sha256').hex()[:8]}{path.suffix}"), secret


def _signed_header(path: Path, content: bytes, secret: bytes) -> bytes:
    """Sign a file's content together with its name and its folder's, so that it cannot replace another."""
    signature = hmac.new(secret, _MAGIC + os.fsencode(f"{path.parent.name}/{path.name}") + b"\0", hashlib.sha256)
    signature.update(content)
    return _MAGIC + signature.digest()


def _remove_stale(folder: Path) -> None:
    for pattern in _STALE_PATTERNS:
        for path in folder.glob(pattern):
            with contextlib.suppress(OSError):
                if time.time() - path.stat().st_mtime > _STALE:
                    path.unlink()


def _is_trusted(folder: Path) -> bool:
    """Return True if only this user, or the system's, may have put files into a folder; warn once if not."""
    status = folder.lstat()
    reason = _distrust_reason(status, folder)
    if reason is not None:
        _warn(reason, "RAYTRACER_CACHE_DIR names another folder")
    return reason is None and stat.S_ISDIR(status.st_mode)


def _warn(reason: str, remedy: str) -> None:
    if reason not in _warned:
        _warned.add(reason)
        warnings.warn(
            f"{reason}, so compiled kernels are neither taken nor kept: each run compiles anew; {remedy}",
            CacheWarning,
            stacklevel=2,
        )


def _read(path: Path) -> bytes | None:
    """Read a regular file that only this user, or the system's, may have written; None for all else.

    Raises
    ------
    OSError : it is not there, or cannot be read.
    """
    # A pipe in its place would have to be waited for.
    with os.fdopen(os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | _BINARY), "rb") as file:
        status = os.fstat(file.fileno())
        return None if not stat.S_ISREG(status.st_mode) or _distrust_reason(status, path) else file.read()


def _distrust_reason(status: os.stat_result, path: Path) -> str | None:
    """Say why a file or folder may be another user's, whose code would be executed; None if it cannot be.

    On Windows folders of users are their own by default, and modes say nothing.
    """
    if sys.platform == "win32":
        return None
    if stat.S_ISLNK(status.st_mode):
        return f"{path} is a link"
    if status.st_uid not in (os.geteuid(), 0):
        return f"{path} belongs to another user"
    if status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        return f"{path} can be written by other users"
    return None
