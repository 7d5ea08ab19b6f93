"""A file object for HDF5 to write to, which defers errors."""

from collections.abc import Callable
from typing import BinaryIO


class WriteOnlyFile:
    """A file for HDF5 to write, which stores the first error instead of raising it.

    HDF5 cannot close a file that it could not write, and ends the process at its exit.  So writes always seem to
    succeed, and the writer checks `error`.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self.error: BaseException | None = None

    def write(self, data: memoryview) -> int:
        self._attempt(lambda: self._file.write(data))
        return len(data)

    def truncate(self, size: int) -> int:
        self._attempt(lambda: self._file.truncate(size))
        return size

    def flush(self) -> None:
        self._attempt(self._file.flush)

    def seek(self, place: int, whence: int = 0) -> int:
        return self._file.seek(place, whence)

    def tell(self) -> int:
        return self._file.tell()

    def read(self, size: int = -1) -> bytes:
        return self._file.read(size)

    def readinto(self, data: memoryview) -> int:
        return self._file.readinto(data)  # type: ignore[attr-defined, no-any-return]

    def _attempt(self, act: Callable[[], object]) -> None:
        try:
            if self.error is None:
                act()
        except BaseException as error:  # noqa: BLE001
            self.error = error
