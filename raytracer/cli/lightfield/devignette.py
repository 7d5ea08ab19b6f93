"""`rt lightfield devignette`: all views as bright as the middle one, by a white picture."""

from pathlib import Path
from typing import Annotated

from typer import Argument

from raytracer.cli.base import options
from raytracer.cli.base.outputs import report_written
from raytracer.cli.lightfield import base
from raytracer.cli.lightfield.base import File, Quiet

EXAMPLE = """\b
Examples:
  rt render scenes/lightfield/glass_wide.yaml -o shot.lf
  rt lightfield white scenes/lightfield/glass_wide.yaml -o white.lf
  rt lightfield devignette shot.lf white.lf -o even.lf
"""


def devignette(
    file: File,
    white: Annotated[str, Argument(metavar="WHITE", help="Light field of rt lightfield white: .lf.")],
    output: Annotated[Path, options.output("FILE.lf", "Light field to write.")],
    quiet: Quiet = False,
) -> None:
    """Divide a light field by that of a white picture of the same camera.

    Pixels that the lens's mount hides in part become as bright as the others, and count in refocused pictures by the
    light that they got.  Those with less than 3 % of it are left out.
    """
    base.check_outputs([output], (".lf",), "a light field")

    from raytracer.lightfield.devignetting import write_devignetted
    from raytracer.util.progress import Bar

    with (
        base.open_light_field(file) as field,
        base.open_light_field(white) as even,
        Bar(" views", quiet=quiet) as bar,
        options.name_in_errors(white),
    ):
        write_devignetted(output, field, even, bar.update)
    report_written(output, quiet=quiet)
