"""Lens tables of pbrt: a surface a line, `radius thickness index aperture`, from the scene to the film.

Lengths are millimetres, the aperture is a diameter, and a radius of 0 is the stop.  That leaves no way to tell flat
glass from it, so here a radius of 0 between two different media is flat glass.  What follows `#` is a comment, and a
number alone on a line before the surfaces is the focal length, as ISETLens writes it.

pbrt reads the thickness as that behind a surface.  Kolb's tables have it before each, and both call the column `axpos`,
so it is found by the numbers: see `_find_convention`.

References: Pharr, Jakob, Humphreys 2023, "Physically Based Rendering", 4th ed., sec. 5.4 (RealisticCamera).
"""

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from raytracer.optics.lens_system.first_order import cardinal_points
from raytracer.optics.lens_system.importers.draft import Choices, Draft, shape
from raytracer.optics.lens_system.lens import FileInterpretation
from raytracer.util.errors import SceneError

_COLUMNS = ("radius", "thickness", "index of refraction", "aperture")
_HEADING = re.compile(r"\bradius\b", re.IGNORECASE)
_AMBIGUOUS = re.compile(r"\baxpos\b", re.IGNORECASE)


# Relative tolerance between the focal length that a file names and the lens's own: names are rounded.
_NEAR = 0.05

_NUMBER = r"(\d+(?:\.\d+)?)"
_LENGTHS = (rf"\bscaled to {_NUMBER} ?mm\b", rf"\b(?:EFL|focal length|f) ?[=:] ?{_NUMBER}\b", rf"{_NUMBER} ?mm\b")


class Row(NamedTuple):
    """A surface of a table: the line that it stands on, and its numbers (mm)."""

    line: int
    radius: float
    gap: float
    ior: float
    aperture: float


def draft(text: str, file: str, choices: Choices) -> Draft:
    """Read the lens of a table; its comments are its name and source, and without any its name is that of the file.

    Raises
    ------
    SceneError : the text is no such table, or is ambiguous.
    """
    result = Draft(file)
    comments = [line.lstrip("# \t").rstrip() for line in text.splitlines() if line.lstrip().startswith("#")]
    remarks = [comment for comment in comments if comment and not _HEADING.search(comment)]
    result.values = {"name": remarks[0] if remarks else Path(file).stem}
    if remarks[1:]:
        result.values["source"] = "; ".join(remarks[1:])

    rows: list[Row] = []
    for line, written in enumerate(text.splitlines(), start=1):
        words = written.partition("#")[0].split()
        if len(words) == 1 and not rows and "focal_length" not in result.values:
            result.values["focal_length"] = _number(result, line, "focal length, alone on a line,", words[0])
        elif words:
            rows.append(_row(result, line, words))
    if not rows:
        result.refuse("holds no surfaces: a lens table has lines of radius, thickness, index of refraction, aperture")

    gaps = [row.gap for row in rows]
    drafts = {
        "after": Draft(file, result.values, _surfaces(rows, gaps)),
        "before": Draft(file, result.values, _surfaces(rows, [*gaps[1:], 0.0])),
    }
    if choices.thickness is not None:
        reading: FileInterpretation | None = FileInterpretation(choices.thickness, "as was asked for", is_guess=False)
    else:
        is_ambiguous = any(_AMBIGUOUS.search(comment) for comment in comments)
        reading = _find_convention(drafts, gaps, remarks, is_ambiguous=is_ambiguous)
    chosen = drafts["after" if reading is None else reading.place]
    chosen.reading = reading
    return chosen


def _surfaces(rows: list[Row], thicknesses: list[float]) -> list[tuple[int, dict[str, object]]]:
    """List the surfaces of a table, with the thickness behind each (mm)."""
    surfaces: list[tuple[int, dict[str, object]]] = []
    before = 1.0
    for (line, radius, _, ior, aperture), thickness in zip(rows, thicknesses, strict=True):
        behind = 1.0 if ior == 0.0 else ior
        is_stop = radius == 0.0 and behind == before
        kind = {"type": "stop"} if is_stop else shape(0.0 if radius == 0.0 else 1.0 / radius)
        material = {} if is_stop or behind == 1.0 else {"material": behind}
        surfaces.append((line, {**kind, "thickness": thickness, **material, "aperture": aperture}))
        before = behind
    return surfaces


def _row(result: Draft, line: int, words: list[str]) -> Row:
    """Parse a line of a surface."""
    if len(words) != len(_COLUMNS):
        result.refuse(f"must hold {len(_COLUMNS)} numbers ({', '.join(_COLUMNS)}), got {len(words)}", line)
    radius, gap, ior, aperture = (
        _number(result, line, column, word) for column, word in zip(_COLUMNS, words, strict=True)
    )
    return Row(line, radius, gap, ior, aperture)


def _number(result: Draft, line: int, column: str, word: str) -> float:
    """Parse a finite number."""
    try:
        number = float(word)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        result.refuse(f"the {column} must be a number, got {word[:40]!r}", line)
    return number


# ---- The convention of thickness
#
# After each surface, nothing need be in the last row, and before each, nothing in the first.  So a 0 in just one of
# them decides.  Else, and where the lens so found has surfaces that intersect, both lenses are compared.


class _Candidate(NamedTuple):
    """A lens that a table may mean.

    focal_length (mm) : its own; None if it has none, or is not valid.
    crossings : surfaces of it that intersect, by number from 1.
    """

    focal_length: float | None = None
    crossings: Sequence[tuple[int, int]] = ()

    def describe(self) -> str:
        """Describe it in words."""
        length = "no focal length" if self.focal_length is None else f"a focal length of {self.focal_length:.6g} mm"
        if not self.crossings:
            return length
        first, second = self.crossings[0]
        return f"{length} and surfaces {first} and {second} that go through each other"


def _find_convention(
    drafts: Mapping[str, Draft], gaps: Sequence[float], comments: Sequence[str], *, is_ambiguous: bool
) -> FileInterpretation | None:
    """Find the convention of a table's thicknesses by its numbers; None if it makes no difference.

    Parameters
    ----------
    drafts : the lens by either convention, "after" or "before" each surface.
    gaps (mm) : the thicknesses in the rows of the table.
    comments : of the table, which may name its focal length.
    is_ambiguous : whether the table's heading is used for both; else "after" is assumed where nothing decides.

    Raises
    ------
    SceneError : the table is ambiguous.
    """
    if gaps[:-1] == gaps[1:]:
        return None
    at_ends = [name for name, gap in (("before", gaps[0]), ("after", gaps[-1])) if gap == 0.0]
    lenses = {name: _candidate(draft) for name, draft in drafts.items()}
    after, before = lenses["after"], lenses["before"]
    if after.focal_length is before.focal_length is None:
        return None
    clean = [name for name, one in lenses.items() if not one.crossings and one.focal_length is not None]
    if len(at_ends) == 1 and not (clean and lenses[at_ends[0]].crossings):
        (name,) = at_ends
        reason = f"since the {'first' if name == 'before' else 'last'} is 0; it has {lenses[name].describe()}"
        return FileInterpretation(name, reason, is_guess=False)

    # Evidence for one of them alone: the numbers in the first and the last row, the surfaces, and the name.
    named = _named(drafts["after"], comments)
    near = [
        name
        for name, one in lenses.items()
        if named is not None and one.focal_length is not None and abs(abs(one.focal_length) - named) <= _NEAR * named
    ]
    favoured = {names[0] for names in (at_ends, clean, near) if len(names) == 1}
    if not favoured and not is_ambiguous:
        favoured = {"after"}
    ends = f"the first is {gaps[0]:g} mm and the last {gaps[-1]:g} mm"
    if len(favoured) != 1:
        drafts["after"].refuse(
            f"may be two lenses, as {ends}: with thickness after each surface it has {after.describe()}, with "
            f"thickness before each {before.describe()}; say which is meant by rt lens import --thickness after, or "
            "before"
        )
    (name,) = favoured
    other = "before" if name == "after" else "after"
    reason = f"for {lenses[name].describe()}; as that {other} each it would have {lenses[other].describe()} ({ends})"
    return FileInterpretation(name, reason, is_guess=True)


def _candidate(draft: Draft) -> _Candidate:
    """Find the focal length of a draft, and its surfaces that intersect."""
    try:
        lens = draft.spec().lens()
        return _Candidate(cardinal_points(lens.packed()).focal_length, lens.crossings())
    except (SceneError, ValueError):
        return _Candidate()


def _named(draft: Draft, comments: Sequence[str]) -> float | None:
    """Find the focal length (mm) that a table gives on a line of its own, in the name of its file, or in a comment."""
    written = draft.values.get("focal_length")
    if written is not None:
        return float(written)
    for strings in ([Path(draft.file).stem], comments):
        for pattern in _LENGTHS:
            for text in strings:
                if found := re.search(pattern, text, re.IGNORECASE):
                    return float(found[1])
    return None
