"""`rt validate`: checks scene files."""

from typing import Annotated

import typer
from typer import Option

from raytracer.cli.base import options
from raytracer.cli.base.outputs import warn
from raytracer.util.errors import InputError
from raytracer.util.terminal import print_error

EXAMPLE = """\b
Example:
  rt validate scenes/*.yaml
  rt validate --strict scenes/cover.yaml
"""


def validate(
    scenes: Annotated[list[str], options.scene_argument("Scene files.")],
    allow_files: options.AllowFiles = None,
    strict: Annotated[bool, Option("--strict", help="Take warnings for errors.")] = False,
    quiet: Annotated[bool, Option("--quiet", "-q", help="Do not name the files that are right.")] = False,
) -> None:
    """Check scene files, and the files that they name.

    What is wrong is named by file, line and key, in at most ten lines a file; the exit status is then 2.  What one may
    doubt is a warning (docs/warnings.md).
    """
    from raytracer.scene.load import load
    from raytracer.scene.pack.scene import pack
    from raytracer.scene.warnings import find_warnings, warning_messages

    wrong = False
    for scene in scenes:
        try:
            sentences = warning_messages(find_warnings(pack(load(scene, allow_files=allow_files or []))))
        except InputError as error:
            wrong = True
            for one in (error, *getattr(error, "others", ())):
                print_error(str(one))
            continue
        for sentence in sentences:
            (print_error if strict else warn)(sentence)
        if sentences and strict:
            wrong = True
        elif not quiet:
            print(f"{scene}: valid")
    if wrong:
        raise typer.Exit(2)
