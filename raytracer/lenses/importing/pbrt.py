"""Lens tables of pbrt: a surface a line, `radius thickness index aperture`, from the scene to the film.

Lengths are millimetres, the aperture is a diameter, and a radius of 0 is the stop.  That leaves no way to tell flat
glass from it, so here a radius of 0 between two different media is flat glass.  What follows `#` is a comment.  In
tables whose heading calls the second column `axpos` it is the way from the surface before.

References: Pharr, Jakob, Humphreys 2023, "Physically Based Rendering", 4th ed., sec. 5.4 (RealisticCamera).
"""

import math
import re

from raytracer.lenses.importing.draft import Draft, Glasses, shape

_COLUMNS = ("radius", "thickness", "index of refraction", "aperture")
_HEADING = re.compile(r"\bradius\b", re.IGNORECASE)
_BEFORE = re.compile(r"\baxpos\b", re.IGNORECASE)


def draft(text: str, file: str, glasses: Glasses) -> Draft:
    """The lens of a table; its comments are its name and source.

    Raises
    ------
    SceneError : the text is no such table.
    """
    result = Draft(file)
    comments = [line.lstrip("# \t").rstrip() for line in text.splitlines() if line.lstrip().startswith("#")]
    said = [comment for comment in comments if comment and not _HEADING.search(comment)]
    result.values = {"name": said[0] if said else "unnamed lens", "source": "; ".join(said[1:])}

    rows = []
    for line, written in enumerate(text.splitlines(), start=1):
        words = written.partition("#")[0].split()
        if words:
            rows.append((line, *_numbers(result, line, words)))
    if not rows:
        result.refuse("holds no surfaces: a lens table has lines of radius, thickness, index of refraction, aperture")

    gaps = [row[2] for row in rows]
    if any(_BEFORE.search(comment) for comment in comments):
        gaps = [*gaps[1:], 0.0]
    before = 1.0
    for (line, radius, _, index, aperture), gap in zip(rows, gaps, strict=True):
        behind = 1.0 if index == 0.0 else index
        is_stop = radius == 0.0 and behind == before
        kind = {"type": "stop"} if is_stop else shape(0.0 if radius == 0.0 else 1.0 / radius)
        material = {} if is_stop or behind == 1.0 else {"material": behind}
        result.surfaces.append((line, {**kind, "thickness": gap, **material, "aperture": aperture}))
        before = behind
    return result


def _numbers(result: Draft, line: int, words: list[str]) -> tuple[float, float, float, float]:
    if len(words) != len(_COLUMNS):
        result.refuse(f"must hold {len(_COLUMNS)} numbers ({', '.join(_COLUMNS)}), got {len(words)}", line)
    found = []
    for column, word in zip(_COLUMNS, words, strict=True):
        try:
            number = float(word)
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            result.refuse(f"the {column} must be a number, got {word[:40]!r}", line)
        found.append(number)
    radius, thickness, index, aperture = found
    return radius, thickness, index, aperture
