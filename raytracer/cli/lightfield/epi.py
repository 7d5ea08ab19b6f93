"""`rt lightfield epi`: epipolar slices."""

from pathlib import Path
from typing import Annotated

import typer

from raytracer.cli.lightfield import _pictures
from raytracer.cli.lightfield._common import File, Quiet, check_outputs, opened, wrote
from raytracer.errors import InputError

EXAMPLE = """\b
Examples:
  rt lightfield epi array.lf -o slice.png                     the middle line of all views of the middle row
  rt lightfield epi array.lf --line 120 --views 3 -o slice.png
  rt lightfield epi array.lf --vertical -o slice.exr          a column of pixels from all views of a column
  rt lightfield epi array.lf --distance 2.5 -o slice.png      what is 2.5 m away stands upright
"""


def register(group: typer.Typer) -> None:
    """Add the command to the group."""
    group.command("epi", epilog=EXAMPLE)(epi)


def epi(
    file: File,
    output: Annotated[
        Path,
        typer.Option("--output", "-o", metavar="OUT", help=".png or .jpg with axes; .exr .hdr .npy, a line each view."),
    ],
    line: Annotated[
        int | None, typer.Option(metavar="N", help="Row of pixels (or column), from 0.  Default: the middle.")
    ] = None,
    views: Annotated[
        int | None, typer.Option(metavar="N", help="Row of views (or column), from 0.  Default: the middle.")
    ] = None,
    vertical: Annotated[bool, typer.Option("--vertical", help="A column of pixels from a column of views.")] = False,
    distance: Annotated[
        str | None, typer.Option(metavar="LENGTH", help="What is there stands upright.  Default: where views meet.")
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Cut a light field: one line of pixels from all views of a row, over one another.

    Each point is a straight line there; the farther it is from the plane where all views see the same, the more it
    leans, to one side if it is nearer and to the other if it is farther.
    """
    check_outputs([output], _pictures.suffixes(), "a slice")
    plane = _pictures.distance("--distance", distance)

    from raytracer.film.output import DISPLAY_SUFFIXES
    from raytracer.lightfield.slices import epipolar_slice, picture

    with opened(file) as field:
        try:
            found = epipolar_slice(
                field,
                direction="vertical" if vertical else "horizontal",
                line=line,
                views=views,
                inverse_distance=None if plane is None else 1.0 / plane,
            )
        except InputError as error:
            raise InputError(f"{file}: {error}") from None
        if output.suffix.lower() in DISPLAY_SUFFIXES:
            import PIL.Image

            from raytracer.wholefiles import whole

            drawn = picture(found) if field.is_metric else picture(found, unit="views", scale=1.0)
            with whole(output) as aside:
                PIL.Image.fromarray(drawn).save(aside, "PNG" if output.suffix.lower() == ".png" else "JPEG", quality=95)
        else:
            _pictures.save(found.radiance, output, field)
    wrote(output, quiet)
