"""Write the tables of docs/warnings.md: what each kind of warnings says, when, and what to do about it.

    python docs/make_warnings.py

Replaces what stands between the markers below each heading.  `make docs` runs it, and a test compares the two.
"""

import re
from pathlib import Path
from typing import Any

import raytracer
from raytracer.schema.warning_kind import Sentence, WarningFamily, WarningKind

_ROOT = Path(raytracer.__file__).parent
OUTPUT = Path(__file__).with_name("warnings.md")
HEADING = re.compile(r"^## (.*)\n", re.MULTILINE)
BEGIN, END = "<!-- kinds -->\n", "<!-- end of kinds -->\n"


def all_warning_kinds() -> list[WarningKind[Any]]:
    """List the kinds of all families of the program, in the order of the packages' names."""
    folders = sorted(path.parent.relative_to(_ROOT.parent) for path in _ROOT.rglob("warnings/__init__.py"))
    return [kind for folder in folders for kind in WarningFamily[Any](".".join(folder.parts)).kinds]


def without_values(template: str) -> str:
    """Write a template with dots in place of values, for the cell of a table."""
    return re.sub(r"({[^}]*})+", "…", template).replace("|", "\\|")


def row(sentence: Sentence) -> str:
    """Write the row of a sentence; its remedy has a column of its own."""
    said = without_values(re.sub(r"[:;] {remedy}$", "", sentence.text))
    advice = f"; {sentence.advice}" if sentence.advice else ""
    return f"| {said} | {sentence.when} | {without_values(sentence.remedy)}{advice} |\n"


def table(section: str) -> str:
    """Write the table of the kinds of a section, those about scenes first."""
    kinds = [kind for kind in all_warning_kinds() if kind.section == section]
    kinds.sort(key=lambda kind: not kind.__module__.startswith("raytracer.scene."))
    rows = "".join(row(sentence) for kind in kinds for sentence in kind.sentences())
    return "| warning | when | what to do |\n|---|---|---|\n" + rows


def with_tables(text: str) -> str:
    """Put the tables between the markers of a text.

    Raises
    ------
    ValueError : a kind is in a section that the text has not.
    """
    first, *parts = HEADING.split(text)
    sections = dict(zip(parts[::2], parts[1::2], strict=True))
    missing = {kind.section for kind in all_warning_kinds()} - sections.keys()
    if missing:
        raise ValueError(f"docs/warnings.md has no section {', '.join(sorted(missing))}")
    for section, content in sections.items():
        before, rest = content.split(BEGIN)
        sections[section] = before + BEGIN + table(section) + END + rest.split(END)[1]
    return first + "".join(f"## {section}\n{content}" for section, content in sections.items())


if __name__ == "__main__":
    OUTPUT.write_text(with_tables(OUTPUT.read_text(encoding="utf-8")), encoding="utf-8")
