"""Write docs/reference/commands, a page for each command with its options, from the application itself.

    python docs/make_commands.py

`make docs` runs it, and a test compares the pages, so that no command or option is lost unseen.
"""

import re
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from docs.documents import link, with_links  # noqa: E402
from raytracer.cli.base.app import application  # noqa: E402

OUTPUT = Path(__file__).parent / "reference" / "commands"

CHAPTERS = {
    "rt check": ("regression.md",),
    "rt completion": ("command-line.md",),
    "rt config": ("command-line.md",),
    "rt convert": ("command-line.md",),
    "rt compare": ("comparing.md",),
    "rt cost": ("costs.md",),
    "rt doctor": ("install.md",),
    "rt lens": ("lenses.md",),
    "rt lightfield": ("lightfields.md", "lightfield-format.md"),
    "rt new": ("command-line.md",),
    "rt reference": ("regression.md",),
    "rt render": ("command-line.md", "aovs.md", "debugging.md", "reliability.md", "tev.md"),
    "rt sweep": ("sweeps.md", "cluster.md"),
    "rt validate": ("warnings.md",),
    "rt view": ("live.md",),
}
"""Documents that say more of a command and of those below it."""

_INDEX = """\
# Commands

`rt COMMAND --help` prints what the pages of this reference say: they are made from it. Results go to the standard
output, messages and progress to standard error. The exit status is 0 for success, 1 if what was checked for failed, and
2 for wrong usage or input.

"""

_CONTENTS = """
```{{toctree}}
:hidden:
{names}
```
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
    return f"`{names} {_cell(parameter.metavar or 'VALUE')}`"


def _prose(text: str) -> str:
    """Write options in a text as code, and what stands for a word, `<scene>`, as it is."""

    def write(found: re.Match[str]) -> str:
        if found[0].startswith("`"):
            return found[0]
        return f"`{found[0]}`" if found[0].startswith("-") else f"\\{found[0]}"

    return re.sub(r"`[^`]*`|(?<![\w-])--?[a-zA-Z][\w-]*|<\w", write, text)


def _meaning(parameter: Any) -> str:
    """Write the help of a parameter, with its default where that is a value and not told there."""
    text = _prose(_cell(parameter.help or ""))
    is_told = parameter.default in (None, False, True, ()) or "efault" in text
    return text if is_told else f"{text} Default: {parameter.default}."


def file_name(name: str) -> str:
    """Return the file of a command's page: `lightfield-view.md` for `rt lightfield view`."""
    return "-".join(name.split()[1:]) + ".md"


def first_sentence(command: Any) -> str:
    """Return the first sentence of a command's help."""
    first = _cell((command.help or "").split("\n\n")[0])
    return re.split(r"\. ", first + " ")[0]


def table_of(names: Iterator[tuple[str, Any]]) -> str:
    """Write a table of commands and what they do, with links to their pages."""
    rows = (f"| [`{name}`]({file_name(name)}) | {first_sentence(command)} |\n" for name, command in names)
    return "| command | does |\n|---|---|\n" + "".join(rows)


def below(name: str, command: Any) -> Iterator[tuple[str, Any]]:
    """List the commands right below a group."""
    return ((f"{name} {word}", found) for word, found in getattr(command, "commands", {}).items())


def _block(lines: list[str]) -> str:
    return "```\n" + textwrap.dedent("\n".join(lines)) + "\n```"


def epilog(text: str) -> Iterator[str]:
    """Go through the examples at the end of a command's help, and what is said of them, as Markdown."""
    first, *others = text.replace("\b\n", "").strip().split("\n\n")
    # Without the word Example, with which they begin.
    yield _block(first.splitlines()[1:])
    for paragraph in others:
        lines = paragraph.strip("\n").splitlines()
        is_table = "   " in lines[0].strip()
        said = [] if is_table else [line for line in lines if not line.startswith(" ")]
        shown = lines if is_table else [line for line in lines if line.startswith(" ")]
        if said:
            yield _prose(re.sub(r" +", " ", "\n".join(said)))
        if shown:
            yield _block(shown)


def see_also(name: str) -> list[str]:
    """List links to the documents that say more of a command."""
    documents = next((pages for begin, pages in CHAPTERS.items() if f"{name} ".startswith(f"{begin} ")), ())
    return [f"- {link(document)}" for document in documents]


def body(name: str, command: Any) -> str:
    """Write what a command does, its examples, its options, and the commands below it."""
    parts = [_prose(re.sub(r"[ \t]+\n", "\n", (command.help or "").replace("\b", "").split("\f")[0]).strip())]
    if command.epilog:
        parts += ["## Examples", *epilog(command.epilog)]
    rows = [
        f"| {_spelling(parameter)} | {_meaning(parameter)} |"
        for parameter in command.params
        if not getattr(parameter, "hidden", False)
    ]
    if rows:
        parts += ["## Options", "\n".join(["| option | meaning |", "|---|---|", *rows])]
    if listed := list(below(name, command)):
        parts += ["## Commands", table_of(iter(listed)).rstrip()]
    if more := see_also(name):
        parts += ["## See also", "\n".join(more)]
    return "\n\n".join(map(with_links, parts)) + "\n"


def reference() -> dict[str, str]:
    """Make the texts of all pages, by their names."""
    root = typer.main.get_command(application())
    pages = {}
    for name, command in commands(root):
        contents = [file_name(found).removesuffix(".md") for found, _ in below(name, command)]
        toctree = _CONTENTS.format(names="\n".join(contents)) if contents else ""
        if command is root:
            pages["index.md"] = _INDEX + body(name, command).replace("## Options", "## Options of rt itself") + toctree
        else:
            pages[file_name(name)] = f"# {name}\n\n{body(name, command)}{toctree}"
    return pages


def main() -> None:
    """Write all pages, and remove those of commands that are no more."""
    OUTPUT.mkdir(parents=True, exist_ok=True)
    made = reference()
    for path in OUTPUT.glob("*.md"):
        if path.name not in made:
            path.unlink()
    for name, text in made.items():
        (OUTPUT / name).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
