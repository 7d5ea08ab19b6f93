"""Hold the commands of `rt lightfield`, one module each, and what they share in `base`."""

import sys

import typer

from raytracer.cli.base.app import add_commands

lightfield = typer.Typer(
    rich_markup_mode=None, add_completion=False, help="Look around in light fields, and focus them after the shot."
)
add_commands(lightfield, sys.modules[__name__])
