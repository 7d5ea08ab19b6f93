"""Options that several commands for light fields have, and functions that parse their values."""

from typing import Annotated

import typer

from raytracer.cli.base.options import parse_value
from raytracer.schema.units import parse_quantity
from raytracer.util.errors import InputError

File = Annotated[str, typer.Argument(metavar="FILE", help="Light field: .lf.")]
Near = Annotated[
    str | None,
    typer.Option(metavar="LENGTH", help="Nothing is nearer: 80cm.  Default: searched for.", show_default=False),
]
Far = Annotated[
    str | None,
    typer.Option(metavar="LENGTH", help="Nothing is farther: 5, inf.  Default: searched for.", show_default=False),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Say nothing.")]


def parse_view(option: str, text: str | None) -> tuple[int, int] | None:
    """Parse the row and the column of a view; None if the option is not given.

    Raises
    ------
    InputError : they are not two integers.
    """
    if text is None:
        return None
    try:
        row, column = (int(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"{option} {text}: must be a row and a column of views, counted from 0: 4,4") from None
    return row, column


def parse_position(option: str, text: str) -> tuple[float, float]:
    """Parse a position in the plane of the views (m), to the right and up.

    Raises
    ------
    InputError : it is not two lengths.
    """
    parts = text.split(",")
    if len(parts) != 2:
        raise InputError(f"{option} {text}: must be two lengths, to the right and up from the middle: 2mm,-1mm")
    right, up = (parse_length(option, part) for part in parts)
    return right, up


def parse_length(option: str, text: str) -> float:
    """Parse a length (m).

    Raises
    ------
    InputError : it is none, and why.
    """
    return parse_value(option, text, lambda part: parse_quantity(part, "length"))


def parse_distance(option: str, text: str | None) -> float | None:
    """Parse a distance (m), inf allowed; None if the option is not given.

    Raises
    ------
    InputError : it is none, or not greater than 0.
    """
    if text is None:
        return None
    distance = float("inf") if text.strip() == "inf" else parse_length(option, text)
    if not distance > 0.0:
        raise InputError(f"{option} {text}: must be a distance greater than 0")
    return distance
