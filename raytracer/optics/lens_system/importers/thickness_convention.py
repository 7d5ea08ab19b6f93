"""Lens tables that do not say whether thickness stands after each surface or before it: which lens is meant.

After each surface, nothing need be in the last row, and before each, nothing in the first.  So a 0 in just one of them
tells.  Else, and where the lens that it tells has surfaces that go through each other, both lenses are looked at.
"""

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from raytracer.errors import SceneError
from raytracer.lenses.first_order import cardinal_points
from raytracer.lenses.importing.draft import Draft
from raytracer.lenses.lens import Reading

# How near to the focal length that its file names a lens's own is: names are rounded.
_NEAR = 0.05

_NUMBER = r"(\d+(?:\.\d+)?)"
_LENGTHS = (
    rf"\bscaled to {_NUMBER} ?mm\b",
    rf"\b(?:EFL|focal length|f) ?[=:] ?{_NUMBER}\b",
    rf"{_NUMBER} ?mm\b",
)


class Row(NamedTuple):
    """A surface as a table has it: the line that it stands on, and its numbers (mm)."""

    line: int
    radius: float
    gap: float
    ior: float
    aperture: float


class _Candidate(NamedTuple):
    """A lens that a table may mean.

    place : where thickness stands in it, "after" or "before" each surface.
    draft : the lens.
    focal_length : its own (mm); None if it has none, or is no lens.
    crossings : surfaces of it that go through each other, by number from 1.
    """

    place: str
    draft: Draft
    focal_length: float | None
    crossings: Sequence[tuple[int, int]]

    def told(self) -> str:
        """Describe it in words."""
        length = "no focal length" if self.focal_length is None else f"a focal length of {self.focal_length:.6g} mm"
        if not self.crossings:
            return length
        first, second = self.crossings[0]
        return f"{length} and surfaces {first} and {second} that go through each other"


def read_gaps(
    drafted: Callable[[list[float]], Draft],
    gaps: list[float],
    comments: Sequence[str],
    place: str | None,
    *,
    is_ambiguous: bool,
) -> Draft:
    """Read the gaps of a table as the thickness that is meant.

    Parameters
    ----------
    drafted : makes the lens from the thickness behind each surface (mm).
    gaps : what the table has in its rows (mm).
    comments : of the table, which may name its focal length.
    place : where thickness stands, "after" or "before" each surface; None to tell it by the numbers.
    is_ambiguous : whether the table's heading stands for both; else "after" is what a table means that tells neither.

    Raises
    ------
    SceneError : it may be either.
    """
    thickness = {"after": gaps, "before": [*gaps[1:], 0.0]}
    if place is not None:
        return _read(drafted(thickness[place]), place, "as was asked for", is_guess=False)
    if gaps[:-1] == gaps[1:]:  # ways that are all alike stand after a surface as they stand before it
        return drafted(gaps)
    at_ends = [name for name, gap in (("before", gaps[0]), ("after", gaps[-1])) if gap == 0.0]
    chosen = {name: _candidate(name, drafted(thickness[name])) for name in ("after", "before")}
    after, before = chosen.values()
    if after.focal_length is before.focal_length is None:
        return after.draft
    clean = [name for name, one in chosen.items() if not one.crossings and one.focal_length is not None]
    if len(at_ends) == 1 and not (clean and chosen[at_ends[0]].crossings):
        (name,) = at_ends
        reason = f"since the {'first' if name == 'before' else 'last'} is 0; it has {chosen[name].told()}"
        return _read(chosen[name].draft, name, reason, is_guess=False)

    # What speaks for one of them alone, of the numbers in the first and the last row, of the surfaces, and of the name.
    named = _named(after.draft, comments)
    near = [name for name, one in chosen.items() if named is not None and _is_near(one.focal_length, named)]
    spoken = {names[0] for names in (at_ends, clean, near) if len(names) == 1}
    if not spoken and not is_ambiguous:
        spoken = {"after"}
    ends = f"the first is {gaps[0]:g} mm and the last {gaps[-1]:g} mm"
    if len(spoken) != 1:
        after.draft.refuse(
            f"may be two lenses, as {ends}: with thickness after each surface it has {after.told()}, with thickness "
            f"before each {before.told()}; say which is meant by rt lens import --thickness after, or before"
        )
    (name,) = spoken
    other = before if name == "after" else after
    reason = f"for {chosen[name].told()}; as that {other.place} each it would have {other.told()} ({ends})"
    return _read(chosen[name].draft, name, reason, is_guess=True)


def _read(draft: Draft, place: str, reason: str, *, is_guess: bool) -> Draft:
    draft.reading = Reading(f"thickness is read as that {place} each surface, {reason}", is_guess)
    return draft


def _candidate(place: str, draft: Draft) -> _Candidate:
    try:
        lens = draft.spec().lens()
        length = cardinal_points(lens.packed()).focal_length
    except (SceneError, ValueError):
        return _Candidate(place, draft, None, ())
    return _Candidate(place, draft, length, lens.crossings())


def _named(draft: Draft, comments: Sequence[str]) -> float | None:
    """Find the focal length (mm) that a table has in a line of its own, in the name of its file, or in a comment."""
    written = draft.values.get("focal_length")
    if written is not None:
        return float(written)
    for texts in ([Path(draft.file).stem], comments):
        for pattern in _LENGTHS:
            for text in texts:
                if found := re.search(pattern, text, re.IGNORECASE):
                    return float(found[1])
    return None


def _is_near(length: float | None, named: float) -> bool:
    return length is not None and abs(abs(length) - named) <= _NEAR * named
