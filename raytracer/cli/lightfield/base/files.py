"""Files that commands for light fields read and write."""

import contextlib
import sys
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from raytracer.util.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from raytracer.film.light_field.field import LightField
    from raytracer.film.light_field.lf import OpenField


def open_light_field(file: str) -> "OpenField":
    """Open the light field in a file, to use in a `with` block.

    Raises
    ------
    InputError : there is none; see `lf.open`.
    """
    from raytracer.film.light_field import lf

    return lf.open(file)


@contextlib.contextmanager
def name_in_errors(file: str) -> Iterator[None]:
    """Begin what is said of wrong input with the name of the light field that it is wrong for."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{file}: {error}") from None


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
    from raytracer.util.atomic_write import check_file
    from raytracer.util.safe_open import check_suffix

    for path in paths:
        check_suffix(path, suffixes, noun)
        check_file(path)


def check_folder(path: Path) -> None:
    """Make sure, before any work, that files can be written into a folder.

    Raises
    ------
    InputError : it is a file, or cannot be made or written.
    """
    from raytracer.util.atomic_write import check_file

    if path.exists() and not path.is_dir():
        raise InputError(f"{path}: is a file, not a folder")
    check_file(path / "view")


def report_written(path: Path, quiet: bool) -> None:
    """Say that a file was written."""
    if not quiet:
        print(f"wrote {path}", file=sys.stderr)


def save_picture(
    radiance: "NDArray[np.float64]", path: Path, field: "LightField", layers: "Mapping[str, Any] | None" = None
) -> None:
    """Write a picture of a light field in the format that its suffix names."""
    from raytracer.film.image import Image

    Image(radiance=radiance, settings=dict(field.settings), layers=dict(layers or {})).save(path)


def picture_suffixes() -> tuple[str, ...]:
    """Return the suffixes of files that hold a picture."""
    from raytracer.film.formats.registry import image_suffixes

    return image_suffixes()
