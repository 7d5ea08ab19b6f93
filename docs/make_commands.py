"""Write docs/commands.md, all commands with their options, from the application itself.

    python docs/make_commands.py

`make docs` runs it, and a test compares the two, so that no command or option is lost unseen.
"""

import re
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer

from raytracer.cli.base.app import application

OUTPUT = Path(__file__).with_name("commands.md")

_HEAD = """\
# Commands

Made by `make docs` from the commands' own help; change that in the code instead. `rt COMMAND --help` says the same.

"""


def commands(command: Any, name: str = "rt") -> Iterator[tuple[str, Any]]:
    """List the name of each command, such as `rt lightfield view`, with what Typer makes of it, groups first."""
    yield name, command
    for word, below in getattr(command, "commands", {}).items():
        yield from commands(below, f"{name} {word}")


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")


def _spelling(parameter: Any) -> str:
    """Write how a parameter is given: `--spp, -s VALUE`, `--test / --no-test`, SCENE."""
    if parameter.param_type_name == "argument":
        return f"`{parameter.metavar or parameter.name.upper()}`"
    names = ", ".join(parameter.opts)
    if parameter.is_flag:
        return f"`{names}`" + (f" / `{', '.join(parameter.secondary_opts)}`" if parameter.secondary_opts else "")
    return f"`{names} {parameter.metavar or 'VALUE'}`"


def _meaning(parameter: Any) -> str:
    """Write the help of a parameter, with its default where that is a value and not told there."""
    text = _cell(parameter.help or "")
    is_told = parameter.default in (None, False, True, ()) or "efault" in text
    return text if is_told else f"{text} Default: {parameter.default}."


def section(name: str, command: Any) -> str:
    """Write the section of a command: what it does, its parameters as a table, and its examples."""
    rows = [
        f"| {_spelling(parameter)} | {_meaning(parameter)} |\n"
        for parameter in command.params
        if not getattr(parameter, "hidden", False)
    ]
    table = "| | |\n|---|---|\n" + "".join(rows) + "\n" if rows else ""
    # Without the word Example, with which they begin.
    examples = textwrap.dedent("\n".join((command.epilog or "").replace("\b", "").strip().splitlines()[1:]))
    shown = f"```\n{examples}\n```\n\n" if examples else ""
    text = re.sub(r"[ \t]+\n", "\n", (command.help or "").replace("\b", "").split("\f")[0]).strip()
    return f"## {name}\n\n{text}\n\n{table}{shown}"


def reference() -> str:
    """Write the whole document."""
    root = typer.main.get_command(application())
    return _HEAD + "".join(section(*item) for item in commands(root)).rstrip() + "\n"


if __name__ == "__main__":
    OUTPUT.write_text(reference(), encoding="utf-8")
