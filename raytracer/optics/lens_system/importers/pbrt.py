"""Lens tables of pbrt: a surface a line, `radius thickness index aperture`, from the scene to the film.

Lengths are millimetres, the aperture is a diameter, and a radius of 0 is the stop.  That leaves no way to tell flat
glass from it, so here a radius of 0 between two different media is flat glass.  What follows `#` is a comment, and a
number alone on a line before the surfaces is the focal length, as ISETLens writes it.

pbrt reads the thickness as that behind a surface.  Kolb's tables have it before each, and both call the column `axpos`,
so it is found by the numbers: see `thickness_convention`.

References: Pharr, Jakob, Humphreys 2023, "Physically Based Rendering", 4th ed., sec. 5.4 (RealisticCamera).
"""

import math
import re
from pathlib import Path

from raytracer.optics.lens_system.importers.draft import Choices, Draft, shape
from raytracer.optics.lens_system.importers.thickness_convention import Row, resolve_convention

_COLUMNS = ("radius", "thickness", "index of refraction", "aperture")
_HEADING = re.compile(r"\bradius\b", re.IGNORECASE)
_AMBIGUOUS = re.compile(r"\baxpos\b", re.IGNORECASE)


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

    def make_draft(thicknesses: list[float]) -> Draft:
        return Draft(file, result.values, _surfaces(rows, thicknesses))

    is_ambiguous = any(_AMBIGUOUS.search(comment) for comment in comments)
    return resolve_convention(
        make_draft, [row.gap for row in rows], remarks, choices.thickness, is_ambiguous=is_ambiguous
    )


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
