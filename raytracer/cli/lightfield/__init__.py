"""Hold the commands of `rt lightfield`, one module each, and what they share in `base`.

A command is a module with `register(group)`, which adds it to the group.
"""

import importlib
import pkgutil

import typer

lightfield = typer.Typer(
    rich_markup_mode=None,
    add_completion=False,
    help="Look around in light fields, and focus them after the shot.",
)


def register(app: typer.Typer) -> None:
    """Add the group to `app`."""
    for module in pkgutil.iter_modules(__path__):
        if module.name != "base":
            importlib.import_module(f"{__name__}.{module.name}").register(lightfield)
    app.add_typer(lightfield, name="lightfield")
