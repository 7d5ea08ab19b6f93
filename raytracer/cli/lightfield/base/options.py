"""What commands that make pictures of a light field's views share."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from raytracer.errors import InputError
from raytracer.units import parse_quantity

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from raytracer.plenoptic.field import LightField

Near = Annotated[
    str | None,
    typer.Option(metavar="LENGTH", help="Nothing is nearer: 80cm.  Default: searched for.", show_default=False),
]
Far = Annotated[
    str | None,
    typer.Option(metavar="LENGTH", help="Nothing is farther: 5, inf.  Default: searched for.", show_default=False),
]


def pair(option: str, text: str | None) -> tuple[int, int] | None:
    """The row and the column that an option names.

    Raises
    ------
    InputError : they are not two whole numbers.
    """
    if text is None:
        return None
    try:
        row, column = (int(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"{option} {text}: must be a row and a column of views, counted from 0: 4,4") from None
    return row, column


def place(option: str, text: str) -> tuple[float, float]:
    """The place in the plane of the views (m) that an option names.

    Raises
    ------
    InputError : they are not two lengths.
    """
    parts = text.split(",")
    if len(parts) != 2:
        raise InputError(f"{option} {text}: must be two lengths, to the right and up from the middle: 2mm,-1mm")
    right, up = (length(option, part) for part in parts)
    return right, up


def length(option: str, text: str) -> float:
    """A length (m) that an option gives.

    Raises
    ------
    InputError : it is none, and why.
    """
    try:
        return parse_quantity(text, "length")
    except ValueError as error:
        raise InputError(f"{option} {text}: {error}") from None


def distance(option: str, text: str | None) -> float | None:
    """A distance (m) that an option gives, inf allowed; None if it is not given.

    Raises
    ------
    InputError : it is none, or not greater than 0.
    """
    if text is None:
        return None
    found = float("inf") if text.strip() == "inf" else length(option, text)
    if not found > 0.0:
        raise InputError(f"{option} {text}: must be a distance greater than 0")
    return found


def save(radiance: "NDArray[np.float64]", path: Path, field: "LightField", layers: Any = None) -> None:
    """Write a picture in the format that its suffix names."""
    from raytracer.film.image import Image

    Image(radiance=radiance, settings=dict(field.settings), layers=layers or {}).save(path)


def suffixes() -> tuple[str, ...]:
    """Of files that hold a picture."""
    from raytracer.film.output import SUFFIXES

    return SUFFIXES
