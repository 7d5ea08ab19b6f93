"""Sandbox for file names: the folders that files may name other files in.

A scene from elsewhere must not read files that were not sent with it.  It may name files in its own folder and below;
or, if a folder at or above its own holds a file `.rt-root`, in that folder and below.  The user of the program may
allow more.  The path counts after `..` and links are resolved.
"""

import os
import stat
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple, TypeAlias

from raytracer.util.errors import format_value

ROOT_MARKER = ".rt-root"
"""The file, which may be empty, that makes its folder the one within which files may name others."""

ENVIRONMENT_VARIABLE = "RT_ALLOW_FILES"
"""Environment variable with further folders, in the form of PATH."""

AllowFiles: TypeAlias = Iterable[str | os.PathLike[str]] | os.PathLike[str]


class PathSandbox(NamedTuple):
    """The folders that hold the files which a file may name.

    folder : that names are relative to, absolute and without links.
    root : the folder of the marker, or `folder` where there is none.
    allowed_folders : further folders, absolute and without links.
    """

    folder: Path
    root: Path
    allowed_folders: tuple[Path, ...]

    def allows(self, name: str | os.PathLike[str]) -> bool:
        """Return True if a file of this name may be read, whether it exists or not."""
        path = self.folder / name
        folders = (self.root, *self.allowed_folders)
        # Looking for a network share would reveal the user to its machine.
        if path.drive.startswith("\\\\") and path.drive.lower() not in (folder.drive.lower() for folder in folders):
            return False
        try:
            real = Path(os.path.realpath(path))
        except ValueError:
            # No file can have such a name: with a null, or half a character.
            return True
        return any(real.is_relative_to(folder) for folder in folders)

    def refusal_message(self, name: str) -> str:
        """Say that a name leads out of the sandbox, and how to allow it."""
        return (
            f"{format_value(name)} leads out of {self.root}, where files may be named; to allow it: --allow-files "
            f"FOLDER (allow_files=[...] in Python), or a file {ROOT_MARKER} in the folder that holds both"
        )


def make_sandbox(folder: str | os.PathLike[str], allowed: AllowFiles = ()) -> PathSandbox:
    """Make the sandbox of a file in `folder`.

    allowed : further folders, or one; those that RT_ALLOW_FILES lists come on top.
    """
    if isinstance(allowed, str | os.PathLike):
        allowed = (allowed,)
    own = Path(os.path.realpath(folder))
    listed = [item for item in os.environ.get(ENVIRONMENT_VARIABLE, "").split(os.pathsep) if item]
    others = tuple(Path(os.path.realpath(item)) for item in (*allowed, *listed))
    return PathSandbox(own, next(_marker_folders(own), own), others)


def _marker_folders(folder: Path) -> Iterator[Path]:
    """Walk through the folders at or above one that hold a marker, the nearest first.

    A marker counts only if its owner is the folder's: in a folder that many share, such as /tmp, anybody can leave one.
    """
    for above in (folder, *folder.parents):
        try:
            if (above / ROOT_MARKER).stat().st_uid == folder.stat().st_uid:
                yield above
        except OSError:
            continue


def unreadable_reason(path: str | os.PathLike[str]) -> str:
    """Say why a path is no readable file, as the end of a sentence; empty if it is one, or does not exist.

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
