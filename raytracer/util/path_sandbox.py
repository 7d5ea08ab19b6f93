"""Which files a file may name.

A scene from elsewhere must not read what it was not sent with.  It may name files in its own folder and below; or,
where a folder at or above its own holds a file `.rt-root`, in that folder and below.  Whoever runs the program may
allow more.  What counts is where a name leads once `..` and links are followed.
"""

import os
import stat
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple, TypeAlias

from raytracer.errors import shown

MARKER = ".rt-root"
"""The file, which may be empty, that makes its folder the one within which files may name others."""

VARIABLE = "RT_ALLOW_FILES"
"""The variable of the environment that holds further folders, as PATH does."""

AllowFiles: TypeAlias = Iterable[str | os.PathLike[str]] | os.PathLike[str]


class Reach(NamedTuple):
    """Where the files lie that a file may name.

    folder : what names are relative to, absolute and without links.
    root : the folder of the marker, or `folder` where there is none.
    others : what was allowed besides, absolute and without links.
    """

    folder: Path
    root: Path
    others: tuple[Path, ...]

    def holds(self, name: str | os.PathLike[str]) -> bool:
        """Whether a file of this name may be read, be it there or not."""
        path = self.folder / name
        folders = (self.root, *self.others)
        # To look whether a share of the network is there tells its machine who asks.
        if path.drive.startswith("\\\\") and path.drive.lower() not in (folder.drive.lower() for folder in folders):
            return False
        try:
            real = Path(os.path.realpath(path))
        except ValueError:
            # No system has files of such names: with a null, or half a character.
            return True
        return any(real.is_relative_to(folder) for folder in folders)

    def refusal(self, name: str) -> str:
        """What to say of a name that this does not hold."""
        return (
            f"{shown(name)} leads out of {self.root}, where files may be named; to allow it: --allow-files FOLDER "
            f"(allow_files=[...] in Python), or a file {MARKER} in the folder that holds both"
        )


def reach_of(folder: str | os.PathLike[str], allowed: AllowFiles = ()) -> Reach:
    """Where the files lie that a file in `folder` may name.

    allowed : further folders, or one; those that RT_ALLOW_FILES lists come on top.
    """
    if isinstance(allowed, str | os.PathLike):
        allowed = (allowed,)
    own = Path(os.path.realpath(folder))
    listed = [item for item in os.environ.get(VARIABLE, "").split(os.pathsep) if item]
    others = tuple(Path(os.path.realpath(item)) for item in (*allowed, *listed))
    return Reach(own, next(_marked(own), own), others)


def _marked(folder: Path) -> Iterator[Path]:
    """The folders at or above one that hold a marker, the nearest first.

    A marker counts only if its owner is the folder's: in a folder that many share, such as /tmp, anybody can leave one.
    """
    for above in (folder, *folder.parents):
        try:
            if (above / MARKER).stat().st_uid == folder.stat().st_uid:
                yield above
        except OSError:
            continue


def unreadable(path: str | os.PathLike[str]) -> str:
    """Why a file cannot be read as a file, as the end of a sentence; empty if it can, or if there is none.

    It is not opened.
    """
    try:
        status = os.stat(path)
    except (FileNotFoundError, NotADirectoryError, ValueError):
        return ""
    except OSError as error:
        return f"cannot be read: {(error.strerror or str(error)).lower()}"
    if stat.S_ISDIR(status.st_mode):
        return "is a folder, not a file"
    return "" if stat.S_ISREG(status.st_mode) else "is no regular file, but a pipe, a device or a socket"
