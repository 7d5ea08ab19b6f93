"""Compiled kernels on disk: one file for each, which many processes may look for, make and read at once.

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
from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import Any

from raytracer.signing_key import NoKeyError, key_folder, signing_key

_LONGEST_WAIT = 300.0
"""Seconds after which a kernel is compiled all the same: ten times what the largest takes.  Windows says of a folder
that may not be written what it says of a lock that is held."""

_STALE = 12 * _LONGEST_WAIT
"""Seconds after which a lock, or a file that is being written, is left over from a process that was killed."""

_LEFT_OVER = ("*.lock", "*.tmp")

# What a file begins with: what it is, and the HMAC-SHA-256 (RFC 2104) of its name and of all that follows.
_MAGIC = b"rt kernel 2\n"
_HEAD = len(_MAGIC) + hashlib.sha256().digest_size

# To other users, who have other keys, the files are of no use.
_FOLDER_MODE, _FILE_MODE = 0o700, 0o600

_BINARY: int = getattr(os, "O_BINARY", 0)

_told: set[str] = set()


class CacheWarning(RuntimeWarning):
    """Compiled kernels are neither taken nor kept, since what is there may be anybody's."""


def source_hash(package: Path, *versions: str, without: Collection[str] = ()) -> str:
    """Hash (64 hex digits) of a package's Python sources, and of the interpreter's and further versions.

    without : names of modules and subpackages whose sources do not count.
    """
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        name = path.relative_to(package)
        if name.parts[0].removesuffix(".py") not in without:
            digest.update(str(name).encode())
            digest.update(path.read_bytes())
    digest.update(" ".join((*versions, sys.version)).encode())
    return digest.hexdigest()


class KernelFiles:
    """What Numba keeps of one function's compiled versions, in place of its own numbered files with an index.

    Numba's index is read, added to and written back by each process.  Of two that do so at the same time one's entry is
    lost; or both take the same number for what they compiled, and a third process loads the one for the other (numba
    0.68, `IndexDataCacheFile.save`).  Here a file's name follows from what is in it, which says so once more.

    Parameters
    ----------
    folder : where they lie; made when the first is saved.
    name : what their names begin with.
    dumps : from a key or what was compiled to bytes that `pickle.loads` takes.
    """

    def __init__(self, folder: Path, name: str, dumps: Callable[[Any], bytes]) -> None:
        self._folder, self._name, self._dumps = folder, name, dumps

    def path(self, key: Any) -> Path:
        """Name the file for a key: types of arguments, processor, and hashes of the function."""
        return self._folder / f"{self._name}.{hashlib.sha256(repr(key).encode()).hexdigest()[:24]}.nbc"

    def load(self, key: Any) -> Any:
        """Read what was compiled for a key; None if that is not there, damaged, or not signed by the user's key."""
        content = self._content(key)
        if content is not None:
            # What another version has written may raise nearly anything.
            with contextlib.suppress(Exception):
                held, data = pickle.loads(content)
                if pickle.loads(held) == key:
                    return pickle.loads(data)
        return None

    def _content(self, key: Any) -> bytes | None:
        return kept(self.path(key))

    def save(self, key: Any, data: Any) -> None:
        """Keep what was compiled for a key, so that any process sees all of it or nothing.

        Where there is no room, or no right to write, it is compiled anew each time.
        """
        keep(self.path(key), pickle.dumps((self._dumps(key), self._dumps(data)), protocol=-1))

    def flush(self) -> None:
        """Forget all versions."""
        for path in self._folder.glob(f"{self._name}.*.nbc"):
            path.unlink(missing_ok=True)

    @contextlib.contextmanager
    def alone(self, key: Any) -> Iterator[None]:
        """Wait for another process that compiles for this key: what it then has saved need not be compiled again."""
        with contextlib.ExitStack() as stack:
            if self._content(key) is None:
                # Without a lock, as where a folder cannot be written, both compile.
                with contextlib.suppress(OSError, NotImplementedError):
                    stack.enter_context(self._lock(key))
                # All who waited may load at once.
                if self._content(key) is not None:
                    stack.close()
            yield

    def _lock(self, key: Any) -> contextlib.AbstractContextManager[Any]:
        from filelock import FileLock

        make_folder(self._folder)
        found = _signed_by_user(self.path(key))
        return contextlib.nullcontext() if found is None else FileLock(found[0].with_suffix(".lock"), _LONGEST_WAIT)


def make_folder(folder: Path) -> None:
    """Make a folder that its owner alone may write to, if it is not there.

    Raises
    ------
    OSError : it cannot be made.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    folder.mkdir(mode=_FOLDER_MODE, exist_ok=True)


def kept(path: Path) -> bytes | None:
    """Read what `keep` has put into a file; None if that is not there, damaged, or not signed by the user's key.

    Parameters
    ----------
    path : in a folder of the cache's folder.
    """
    with contextlib.suppress(OSError):
        if found := _signed_by_user(path):
            own, secret = found
            content = _read(own)
            if content is not None and hmac.compare_digest(content[:_HEAD], _head(own, content[_HEAD:], secret)):
                return content[_HEAD:]
    return None


def keep(path: Path, content: bytes) -> None:
    """Put something into a file of the cache, signed by the user's key, so that any process sees all of it or nothing.

    Where that cannot be done, nothing is.  What processes have left in the folder that were killed is removed.

    Parameters
    ----------
    path : in a folder of the cache's folder.
    """
    with contextlib.suppress(OSError):
        make_folder(path.parent)
        found = _signed_by_user(path)
        if found is None:
            return
        own, secret = found
        aside = own.with_suffix(f".{uuid.uuid4().hex[:16]}.tmp")
        try:
            with os.fdopen(os.open(aside, os.O_WRONLY | os.O_CREAT | os.O_EXCL | _BINARY, _FILE_MODE), "wb") as file:
                file.write(_head(own, content, secret))
                file.write(content)
            os.replace(aside, own)
        finally:
            aside.unlink(missing_ok=True)
        _clean(path.parent)


def _signed_by_user(path: Path) -> tuple[Path, bytes] | None:
    """Name the file that the user's key signs in place of `path`, and give the key.

    Files of different keys lie side by side, so that none is written over in turn.  None, which is said once, where
    there is no key, or others may write to the folder.

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


def _head(path: Path, content: bytes, secret: bytes) -> bytes:
    """Sign a file's content, and its name and its folder's: it is not taken for another one."""
    signature = hmac.new(secret, _MAGIC + os.fsencode(f"{path.parent.name}/{path.name}") + b"\0", hashlib.sha256)
    signature.update(content)
    return _MAGIC + signature.digest()


def _clean(folder: Path) -> None:
    for pattern in _LEFT_OVER:
        for path in folder.glob(pattern):
            with contextlib.suppress(OSError):
                if time.time() - path.stat().st_mtime > _STALE:
                    path.unlink()


def _is_trusted(folder: Path) -> bool:
    """Whether nobody but this user, or the system's, may have put something in a folder; said once if not."""
    status = folder.lstat()
    reason = _doubt(status, folder)
    if reason is not None:
        _warn(reason, "RAYTRACER_CACHE_DIR names another folder")
    return reason is None and stat.S_ISDIR(status.st_mode)


def _warn(reason: str, remedy: str) -> None:
    if reason not in _told:
        _told.add(reason)
        warnings.warn(
            f"{reason}, so compiled kernels are neither taken nor kept: each run compiles anew; {remedy}",
            CacheWarning,
            stacklevel=2,
        )


def _read(path: Path) -> bytes | None:
    """What is in a regular file that only this user, or the system's, may have written; None for all else.

    Raises
    ------
    OSError : it is not there, or cannot be read.
    """
    # A pipe in its place would have to be waited for.
    with os.fdopen(os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | _BINARY), "rb") as file:
        status = os.fstat(file.fileno())
        return None if not stat.S_ISREG(status.st_mode) or _doubt(status, path) else file.read()


def _doubt(status: os.stat_result, path: Path) -> str | None:
    """Why what is in a file or folder may be another user's, who would have it executed here; None if it cannot.

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
