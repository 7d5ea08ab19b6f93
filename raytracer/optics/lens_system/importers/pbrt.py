"""Lens tables of pbrt: a surface a line, `radius thickness index aperture`, from the scene to the film.

Lengths are millimetres, the aperture is a diameter, and a radius of 0 is the stop.  That leaves no way to tell flat
glass from it, so here a radius of 0 between two different media is flat glass.  What follows `#` is a comment, and a
number alone on a line before the surfaces is the focal length, as ISETLens writes it.

pbrt reads the thickness as that behind a surface.  Tables of Kolb's have it before each, and both call the column
`axpos`, so it is told by the numbers: see `gaps`.

References: Pharr, Jakob, Humphreys 2023, "Physically Based Rendering", 4th ed., sec. 5.4 (RealisticCamera).
"""

import math
import re
from pathlib import Path

from raytracer.lenses.importing.draft import Choices, Draft, shape
from raytracer.lenses.importing.gaps import Row, read_gaps

_COLUMNS = ("radius", "thickness", "index of refraction", "aperture")
_HEADING = re.compile(r"\bradius\b", re.IGNORECASE)
_AMBIGUOUS = re.compile(r"\baxpos\b", re.IGNORECASE)


def draft(text: str, file: str, choices: Choices) -> Draft:
    """The lens of a table; its comments are its name and source, and without any the file's name is its.

    Raises
    ------
    SceneError : the text is no such table, or may be read as two lenses.
    """
    result = Draft(file)
    comments = [line.lstrip("# \t").rstrip() for line in text.splitlines() if line.lstrip().startswith("#")]
    said = [comment for comment in comments if comment and not _HEADING.search(comment)]
    result.values = {"name": said[0] if said else Path(file).stem}
    if said[1:]:
        result.values["source"] = "; ".join(said[1:])

    rows: list[Row] = []
    for line, written in enumerate(text.splitlines(), start=1):
        words = written.partition("#")[0].split()
        if len(words) == 1 and not rows and "focal_length" not in result.values:
            result.values["focal_length"] = _number(result, line, "focal length, alone on a line,", words[0])
        elif words:
            rows.append(_row(result, line, words))
    if not rows:
        result.refuse("holds no surfaces: a lens table has lines of radius, thickness, index of refraction, aperture")

    def drafted(thicknesses: list[float]) -> Draft:
        return Draft(file, result.values, _surfaces(rows, thicknesses))

    is_ambiguous = any(_AMBIGUOUS.search(comment) for comment in comments)
    return read_gaps(drafted, [row.gap for row in rows], said, choices.thickness, is_ambiguous=is_ambiguous)


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
    if len(words) != len(_COLUMNS):
        result.refuse(f"must hold {len(_COLUMNS)} numbers ({', '.join(_COLUMNS)}), got {len(words)}", line)
    radius, gap, ior, aperture = (
        _number(result, line, column, word) for column, word in zip(_COLUMNS, words, strict=True)
    )
    return Row(line, radius, gap, ior, aperture)


def _number(result: Draft, line: int, column: str, word: str) -> float:
    try:
        number = float(word)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        result.refuse(f"the {column} must be a number, got {word[:40]!r}", line)
    return number
