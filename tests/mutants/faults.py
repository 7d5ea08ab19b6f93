"""The seeded faults of `faults.yaml`, each by a snippet of the package, so that code may move between modules."""

import fnmatch
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import yaml

from tests.repository import ROOT

PACKAGE = ROOT / "raytracer"
LIST = Path(__file__).with_name("faults.yaml")


class Fault(NamedTuple):
    """A fault that can be seeded into the package.

    Results are summed up by area; the name says what is wrong then; `old` occurs once in all of the package; `tests`
    are files or folders of tests that should find it, near ones first; or there is a reason why nothing can.
    """

    area: str
    name: str
    old: str
    new: str
    tests: tuple[str, ...]
    reason: str | None = None

    def matches(self, pattern: str) -> bool:
        """Tell if a pattern, as of file names, is that of the fault's name or area."""
        return fnmatch.fnmatch(self.name, pattern) or fnmatch.fnmatch(self.area, pattern)


def read_faults() -> list[Fault]:
    """Read the list of faults, in its order."""
    areas = yaml.load(LIST.read_text(encoding="utf-8"), yaml.CSafeLoader)
    return [
        Fault(area, **{**entry, "tests": tuple(entry["tests"].split())})
        for area, entries in areas.items()
        for entry in entries
    ]


def read_sources() -> dict[Path, str]:
    """Read all modules of the package, by path."""
    return {path: path.read_text(encoding="utf-8") for path in sorted(PACKAGE.rglob("*.py"))}


def find_module(fault: Fault, sources: Mapping[Path, str]) -> Path:
    """Find the module that holds the text of a fault.

    Raises
    ------
    ValueError : it does not occur exactly once.
    """
    counts = {path: count for path, text in sources.items() if (count := text.count(fault.old))}
    if sum(counts.values()) != 1:
        places = ", ".join(f"{path.relative_to(PACKAGE)} ({count})" for path, count in counts.items()) or "nowhere"
        raise ValueError(f"{fault.name}: its text has to occur once in the package, and does so in: {places}")
    return next(iter(counts))


def seed_fault(fault: Fault, source: str) -> str:
    """Return the source of a module with the fault in it."""
    return source.replace(fault.old, fault.new)
