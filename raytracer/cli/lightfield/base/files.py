"""What several commands on light fields share: their file, what they write, what they say."""

import sys
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from raytracer.errors import InputError

if TYPE_CHECKING:
    from raytracer.plenoptic.lf import OpenField

File = Annotated[str, typer.Argument(metavar="FILE", help="Light field: .lf.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Say nothing.")]


def opened(file: str) -> "OpenField":
    """The light field in a file, to use in a `with` block.

    Raises
    ------
    InputError : there is none, as `lf.open` says it.
    """
    from raytracer.plenoptic import lf

    return lf.open(file)


def check_outputs(paths: Sequence[Path], suffixes: Collection[str], noun: str) -> None:
    """Make sure, before any work, that files can be written, and are of a known kind.

    Parameters
    ----------
    suffixes : of the kinds that can be written.
    noun : what is written, for the sentence: "a focal stack".

    Raises
    ------
    InputError : a suffix is not known, or a file cannot be written.
    """
    from raytracer.film.output import check_file

    for path in paths:
        if path.suffix.lower() not in suffixes:
            found = f"unknown suffix {path.suffix!r}" if path.suffix else "no suffix"
            raise InputError(f"{path}: {found} for {noun}; known: {', '.join(suffixes)}")
        check_file(path)


def check_folder(path: Path) -> None:
    """Make sure, before any work, that files can be written into a folder.

    Raises
    ------
    InputError : it is a file, or cannot be made or written.
    """
    from raytracer.film.output import check_file

    if path.exists() and not path.is_dir():
        raise InputError(f"{path}: is a file, not a folder")
    check_file(path / "view")


def wrote(path: Path, quiet: bool) -> None:
    """Say that a file was written."""
    if not quiet:
        print(f"wrote {path}", file=sys.stderr)
