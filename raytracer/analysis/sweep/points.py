"""Enumeration of the points of a sweep from its axes, and the names of their files."""

import math
import re
from collections import Counter
from collections.abc import Sequence
from itertools import product

from raytracer.analysis.sweep.results import Axis, SweepPoint
from raytracer.util.errors import InputError

MAX_POINTS = 1000
"""Most points of a sweep unless more are asked for: a slip of a count should not fill a disk."""

_NAME_LENGTH = 150
"""Letters of a file's stem; with four bytes a letter and a suffix, what file systems hold would be 255 bytes."""

# Letters that no file system, shell or address gives a meaning of its own.
_UNSAFE = re.compile(r"[^\w.,=+-]+")


def enumerate_points(axes: Sequence[Axis], *, zipped: bool = False, most: int = MAX_POINTS) -> tuple[SweepPoint, ...]:
    """Enumerate the points of axes: all combinations of their values, or pairs of them.

    Raises
    ------
    InputError : no axes, more than `most` points, or axes of different lengths that were to be zipped.
    """
    if not axes:
        raise InputError(
            "nothing to sweep: give a key several values, such as -D camera.f_number=1.4,2,2.8 or "
            "-D camera.focus_distance=2:10:5"
        )
    lengths = [len(axis.values) for axis in axes]
    if zipped and len(set(lengths)) > 1:
        counts = ", ".join(f"{axis.key} has {len(axis.values)}" for axis in axes)
        raise InputError(f"--zip takes the values of all keys in pairs, so each needs as many: {counts}")
    count = lengths[0] if zipped else math.prod(lengths)
    if count > most:
        sizes = "" if zipped or len(axes) == 1 else f" ({' x '.join(map(str, lengths))})"
        raise InputError(f"the sweep has {count:,} points{sizes}, more than the {most:,} that --max-points allows")
    indices = [(i,) * len(axes) for i in range(count)] if zipped else list(product(*map(range, lengths)))
    parts = [_name_parts(axis, key) for axis, key in zip(axes, _short_keys(axes), strict=True)]
    names = ["_".join(part[i] for part, i in zip(parts, index, strict=True)) for index in indices]
    shared = Counter(name.casefold() for name in names)
    points = []
    for index, name in zip(indices, names, strict=True):
        values = {axis.key: axis.values[i] for axis, i in zip(axes, index, strict=True)}
        fits = len(name.encode()) <= _NAME_LENGTH and shared[name.casefold()] == 1
        points.append(SweepPoint(index, values, name if fits else "point_" + "_".join(str(i + 1) for i in index)))
    return tuple(points)


def _short_keys(axes: Sequence[Axis]) -> list[str]:
    """Shorten keys for names of files: to their last steps, but for keys whose last step is another's too."""
    steps = [re.split(r"[.\[\]]+", axis.key.rstrip("]")) for axis in axes]
    last = [step[-1] for step in steps]
    return [_safe(own[-1] if last.count(own[-1]) == 1 else ".".join(own)) for own in steps]


def _name_parts(axis: Axis, key: str) -> list[str]:
    """Make the part of a file's name for each value, as `f_number=2.8`; all differ, whatever their case."""
    texts = [_safe(label) for label in axis.labels]
    times = Counter(text.casefold() for text in texts)
    return [
        f"{key}={text}" if text and times[text.casefold()] == 1 else f"{key}={text}.{i + 1}"
        for i, text in enumerate(texts)
    ]


def _safe(text: str) -> str:
    """Turn a text into a part of a file's name: `1/125 s` is `1-125s`, `[-1, 0, 0]` is `-1,0,0`."""
    marked = _UNSAFE.sub("\0", re.sub(r"\s+", "", text))
    return marked.strip("\0.").replace("\0", "-")
