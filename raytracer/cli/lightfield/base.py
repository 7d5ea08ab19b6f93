"""Shared parts of the commands for light fields: options, and the files that they read and write.

Functions that check or parse raise an InputError for what is wrong.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from raytracer.cli.base import options
from raytracer.cli.base.options import parse_dimension, takes
from raytracer.schema.units import Dimension, parse_bytes
from raytracer.util.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from raytracer.film.light_field.field import LightField
    from raytracer.film.light_field.lf import OpenField

File = Annotated[str, Argument(metavar="FILE", help="Light field: .lf.")]
Near = Annotated[str | None, takes("LENGTH", "Nothing is nearer: 80cm.  Default: searched for.")]
Far = Annotated[str | None, takes("LENGTH", "Nothing is farther: 5, inf.  Default: searched for.")]
Memory = Annotated[
    str,
    takes(
        "SIZE",
        "Memory that this may take, besides the program: 2GB, 500MB.  What takes more is done in parts, or refused.",
    ),
]
Quiet = Annotated[bool, Option("--quiet", "-q", help="Say nothing.")]


def parse_view(option: str, text: str | None) -> tuple[int, int] | None:
    """Parse the row and the column of a view; None if the option is not given."""
    if text is None:
        return None
    try:
        row, column = (int(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"{option} {text}: must be a row and a column of views, counted from 0: 4,4") from None
    return row, column


def parse_position(option: str, text: str) -> tuple[float, float]:
    """Parse a position in the plane of the views (m), to the right and up."""
    parts = text.split(",")
    if len(parts) != 2:
        raise InputError(f"{option} {text}: must be two lengths, to the right and up from the middle: 2mm,-1mm")
    right, up = (parse_dimension(option, part, "length") for part in parts)
    return right, up


def parse_positive(option: str, text: str, dimension: Dimension) -> float:
    """Parse a quantity greater than 0, which may be infinite."""
    value = parse_dimension(option, text, dimension)
    if not value > 0.0:
        raise InputError(f"{option} {text}: must be greater than 0")
    return value


def parse_distance(option: str, text: str | None) -> float | None:
    """Parse a distance (m) greater than 0, inf allowed; None if the option is not given."""
    if text is None:
        return None
    distance = float("inf") if text.strip() == "inf" else parse_dimension(option, text, "length")
    if not distance > 0.0:
        raise InputError(f"{option} {text}: must be a distance greater than 0")
    return distance


def open_light_field(file: str) -> "OpenField":
    """Open the light field in a file, to use in a `with` block; see `lf.open`."""
    from raytracer.film.light_field import lf

    return lf.open(file)


@contextmanager
def open_within(file: str, memory: str) -> "Iterator[OpenField]":
    """Open the light field in a file in a `with` block, in which work takes at most the memory of `--memory`."""
    from raytracer.lightfield.memory import memory_limit

    with memory_limit(int(options.parse_value("--memory", memory, parse_bytes))), open_light_field(file) as field:
        yield field


def check_outputs(paths: Sequence[Path], suffixes: Collection[str], noun: str) -> None:
    """Make sure, before any work, that files can be written, and have one of these suffixes.

    noun : what is written, for the sentence: "a focal stack".
    """
    from raytracer.util.atomic_write import check_file
    from raytracer.util.safe_open import check_suffix

    for path in paths:
        check_suffix(path, suffixes, noun)
        check_file(path)


def check_folder(path: Path) -> None:
    """Make sure, before any work, that files can be written into a folder."""
    from raytracer.util.atomic_write import check_file

    if path.exists() and not path.is_dir():
        raise InputError(f"{path}: is a file, not a folder")
    check_file(path / "view")


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
