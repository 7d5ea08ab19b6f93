"""Completion of a command line in a shell: what the words so far may go on with."""

import os
from collections.abc import Callable, Mapping
from pathlib import Path

VARIABLE = "_RT_COMPLETE"
"""The variable with which a shell's script asks rt for words, in place of running a command."""

_SUFFIXES = (".yaml", ".yml")


def command_to_complete(environment: Mapping[str, str]) -> str | None:
    """Return the command on the line that is to be completed, as far as there is one; others need not be imported."""
    words = (environment.get("COMP_WORDS") or environment.get("_TYPER_COMPLETE_ARGS") or "").split()
    return words[1] if VARIABLE in environment and len(words) > 1 else None


def complete_from(*values: str) -> Callable[[str], list[str]]:
    """Make the function that completes one of several values."""

    def complete(incomplete: str) -> list[str]:
        return [value for value in values if value.startswith(incomplete)]

    return complete


def complete_scene(incomplete: str) -> list[str]:
    """List scene files and folders that begin like this; of a folder that is the only one, what is in it.

    A shell puts a blank behind the only word, which would end the name at the folder.
    """
    folder, begin = os.path.split(incomplete)
    found = []
    try:
        with os.scandir(folder or ".") as entries:
            for entry in entries:
                is_hidden = entry.name.startswith(".") and not begin.startswith(".")
                if entry.name.startswith(begin) and not is_hidden:
                    if entry.is_dir():
                        found.append(f"{os.path.join(folder, entry.name)}/")
                    elif Path(entry.name).suffix.lower() in _SUFFIXES:
                        found.append(os.path.join(folder, entry.name))
    except OSError:
        return []
    if len(found) == 1 and found[0].endswith("/"):
        return complete_scene(found[0]) or found
    return sorted(found)
