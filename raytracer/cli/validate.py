"""`rt validate`: is a scene file right?"""

import sys
from typing import Annotated

import typer

from raytracer.errors import InputError

EXAMPLE = """\b
Example:
  rt validate scenes/*.yaml
"""


def validate(
    scenes: Annotated[list[str], typer.Argument(metavar="SCENE", help="Scene files.")],
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Do not name the files that are right.")] = False,
) -> None:
    """Check scene files, and the files that they name.

    What is wrong is named by file, line and key, one line a file; the exit status is then 2.
    """
    from raytracer.scene.load import load
    from raytracer.scene.pack import pack

    wrong = False
    for scene in scenes:
        try:
            pack(load(scene))
        except InputError as error:
            wrong = True
            print(f"rt: {error}", file=sys.stderr)
        else:
            if not quiet:
                print(f"{scene}: valid")
    if wrong:
        raise typer.Exit(2)


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command(epilog=EXAMPLE)(validate)
