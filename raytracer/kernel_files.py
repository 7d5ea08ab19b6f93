"""Compiled kernels on disk: one file for each, which many processes may look for, make and read at once."""

import contextlib
import hashlib
import os
import pickle
import sys
import uuid
from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import Any

_LONGEST_WAIT = 300.0
"""Seconds after which a kernel is compiled all the same: ten times what the largest takes.  Windows says of a folder
that may not be written what it says of a lock that is held."""


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
        """The file for a key: types of arguments, processor, and hashes of the function."""
        return self._folder / f"{self._name}.{hashlib.sha256(repr(key).encode()).hexdigest()[:24]}.nbc"

    def load(self, key: Any) -> Any:
        """What was compiled for a key; None if that is not there, or damaged."""
        # A file cut short or overwritten can raise nearly anything.
        with contextlib.suppress(Exception):
            held, data = pickle.loads(self.path(key).read_bytes())
            if pickle.loads(held) == key:
                return pickle.loads(data)
        return None

    def save(self, key: Any, data: Any) -> None:
        """Keep what was compiled for a key, so that any process sees all of it or nothing.

        Where there is no room, or no right to write, it is compiled anew each time.
        """
        path = self.path(key)
        aside = path.with_suffix(f".{uuid.uuid4().hex[:16]}.tmp")
        content = pickle.dumps((self._dumps(key), self._dumps(data)), protocol=-1)
        with contextlib.suppress(OSError):
            self._folder.mkdir(parents=True, exist_ok=True)
            try:
                aside.write_bytes(content)
                os.replace(aside, path)
            finally:
                aside.unlink(missing_ok=True)

    def flush(self) -> None:
        """Forget all versions."""
        for path in self._folder.glob(f"{self._name}.*.nbc"):
            path.unlink(missing_ok=True)

    @contextlib.contextmanager
    def alone(self, key: Any) -> Iterator[None]:
        """Wait for another process that compiles for this key: what it then has saved need not be compiled again."""
        with contextlib.ExitStack() as stack:
            if not self.path(key).exists():
                # Without a lock, as where a folder cannot be written, both compile.
                with contextlib.suppress(OSError, NotImplementedError):
                    stack.enter_context(self._lock(key))
            # All who waited may load at once.
            if self.path(key).exists():
                stack.close()
            yield

    def _lock(self, key: Any) -> contextlib.AbstractContextManager[Any]:
        from filelock import FileLock

        self._folder.mkdir(parents=True, exist_ok=True)
        return FileLock(self.path(key).with_suffix(".lock"), timeout=_LONGEST_WAIT)
