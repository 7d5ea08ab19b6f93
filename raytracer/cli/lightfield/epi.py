"""`rt lightfield epi`: epipolar slices."""

from pathlib import Path
from typing import Annotated, Literal

from typer import Option

from raytracer.cli.base import options
from raytracer.cli.base.options import takes
from raytracer.cli.base.outputs import report_written
from raytracer.cli.lightfield import base
from raytracer.cli.lightfield.base import File, Quiet, parse_distance

EXAMPLE = """\b
Examples:
  rt lightfield epi array.lf -o slice.png                     the middle line of all views of the middle row
  rt lightfield epi array.lf --line 120 --views 3 -o slice.png
  rt lightfield epi array.lf --vertical -o slice.exr          a column of pixels from all views of a column
  rt lightfield epi array.lf --distance 2.5 -o slice.png      what is 2.5 m away stands upright
"""


def epi(
    file: File,
    output: Annotated[Path, options.output("OUT", ".png or .jpg with axes; .exr .hdr .npy, a line each view.")],
    line: Annotated[int | None, takes("N", "Row of pixels (or column), from 0.  Default: the middle.")] = None,
    views: Annotated[int | None, takes("N", "Row of views (or column), from 0.  Default: the middle.")] = None,
    vertical: Annotated[bool, Option("--vertical", help="A column of pixels from a column of views.")] = False,
    distance: Annotated[
        str | None, takes("LENGTH", "What is there stands upright.  Default: where views meet.")
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Cut a light field: one line of pixels from all views of a row, over one another.

    Each point is a straight line there; the farther it is from the plane where all views see the same, the more it
    leans, to one side if it is nearer and to the other if it is farther.
    """
    base.check_outputs([output], base.picture_suffixes(), "a slice")
    plane = parse_distance("--distance", distance)
    inverse = None if plane is None else 1.0 / plane

    from raytracer.film.formats.registry import image_formats
    from raytracer.lightfield.epipolar import draw_slice, epipolar_slice

    with base.open_light_field(file) as field:
        with options.name_in_errors(file):
            direction: Literal["vertical", "horizontal"] = "vertical" if vertical else "horizontal"
            epi_slice = epipolar_slice(field, direction=direction, line=line, views=views, inverse_distance=inverse)
        if encode_pixels := image_formats()[output.suffix.lower()].encode_pixels:
            from raytracer.util.atomic_write import write_bytes

            drawn = draw_slice(epi_slice) if field.is_metric else draw_slice(epi_slice, unit="views", scale=1.0)
            write_bytes(output, encode_pixels(drawn))
        else:
            base.save_picture(epi_slice.radiance, output, field)
    report_written(output, quiet=quiet)
