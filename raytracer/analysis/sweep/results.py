"""What a sweep asks and what it finds, as plain values: axes, points, and what was taken at each."""

import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.errors import InputError

if TYPE_CHECKING:
    from raytracer.film.image import Image

MOST_POINTS = 1000
"""Points that a sweep has at most unless more are asked for: a slip of a count should not fill a disk."""


class Axis(NamedTuple):
    """A key of the scene, and the values that it takes in turn.

    values : as `raytracer.load` takes overrides; labels, a short text for each, all different: what was written ("1.4",
        "1/125 s", "ball"), or the number to as many digits as tell it from the others.
    """

    key: str
    values: tuple[Any, ...]
    labels: tuple[str, ...]


@dataclass(frozen=True)
class Point:
    """One combination of values.

    index : for each axis, the number of its value; values, by key, those of the axes alone; name, the stem of its
        files, different for all points; digest, hex SHA-256 of all that its picture depends on, or "" where its scene
        is wrong or a file of it changed while it was read.
    """

    index: tuple[int, ...]
    values: dict[str, Any]
    name: str
    digest: str = ""


@dataclass(frozen=True)
class Taken:
    """What became of a point.

    status : "done", "failed", or "missing", if the sweep was ended before it.
    reason : why it failed; one sentence.
    files : names of its images within the folder, in the order of the formats that were asked for; the first is for
        display if any is.
    camera : derived numbers of the camera by names that end in their units, as `rt explain` tells them; may be inf.
    exposure : numbers of the exposure, as `rt render --stats` has them; empty for plain radiance.
    seconds : by phase, as in `Stats.seconds`, with "total".
    samples : mean samples a pixel.
    rays : camera, bounce and shadow rays.
    error : `relative` error (RMS, 0.01 is 1 %) with `low` and `high`, the ends of its 95 % interval; empty if unknown.
    nan_samples : samples that were not finite and were dropped.
    complete : whether all samples were taken, or the error asked for was reached.
    warnings : what its scene makes one doubt, a sentence each.
    """

    point: Point
    status: Literal["done", "failed", "missing"]
    reason: str = ""
    files: tuple[str, ...] = ()
    camera: dict[str, float] = field(default_factory=dict)
    exposure: dict[str, float] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    samples: float = 0.0
    rays: int = 0
    error: dict[str, float] = field(default_factory=dict)
    nan_samples: int = 0
    complete: bool = True
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Sweep:
    """A sweep, as far as it got.

    Attributes
    ----------
    scene : the scene's file, or "scene" for one that has none.
    axes : in the order in which they were given; the last one's values change fastest from point to point.
    zipped : whether the axes' values are taken in pairs, so that all of a point's indices are alike.
    taken : one for each point, in their order.
    folder : where the images are; None if they are in memory.
    interrupted : whether a KeyboardInterrupt ended it early.
    kept : how many points were done by an earlier sweep.
    pictures : the image of each point, in their order, None for those that are not done; empty if they are in `folder`.
    """

    scene: str
    axes: tuple[Axis, ...]
    zipped: bool
    taken: tuple[Taken, ...]
    folder: Path | None = None
    interrupted: bool = False
    kept: int = 0
    pictures: tuple["Image | None", ...] = ()

    @property
    def shape(self) -> tuple[int, ...]:
        """How many values each axis has; of zipped axes, how many points there are."""
        return shape_of(self.axes, zipped=self.zipped)

    def __repr__(self) -> str:
        counts = Counter(taken.status for taken in self.taken)
        axes = (" and " if self.zipped else " x ").join(f"{len(axis.values)} {axis.key}" for axis in self.axes)
        states = ", ".join(f"{counts[status]} {status}" for status in ("done", "failed", "missing") if counts[status])
        return f"<rt.Sweep of {self.scene}: {axes}, {states}>"

    @property
    def images(self) -> NDArray[np.object_]:
        """The images, of shape `shape`: `images[2, 0].radiance`; None for points that are not done.

        Raises
        ------
        InputError : they are in a folder.
        """
        if self.folder is not None:
            raise InputError(
                f"this sweep's images are files in {self.folder}; without a folder they are kept in memory"
            )
        array = np.empty(len(self.pictures), dtype=np.object_)
        array[:] = self.pictures
        return array.reshape(self.shape)


def shape_of(axes: Sequence[Axis], *, zipped: bool) -> tuple[int, ...]:
    """How many values each axis has; of zipped axes, how many points there are."""
    return (len(axes[0].values),) if zipped else tuple(len(axis.values) for axis in axes)


# ---- From axes to points

_NAME_LENGTH = 150
"""Letters of a file's stem; with four bytes a letter and a suffix, what file systems hold would be 255 bytes."""

# Letters that no file system, shell or address gives a meaning of its own.
_UNSAFE = re.compile(r"[^\w.,=+-]+")


def points_of(axes: Sequence[Axis], *, zipped: bool = False, most: int = MOST_POINTS) -> tuple[Point, ...]:
    """The points of axes: all combinations of their values, or pairs of them.

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
    parts = [_parts_of_names(axis, key) for axis, key in zip(axes, _short_keys(axes), strict=True)]
    names = ["_".join(part[i] for part, i in zip(parts, index, strict=True)) for index in indices]
    shared = Counter(name.casefold() for name in names)
    points = []
    for index, name in zip(indices, names, strict=True):
        values = {axis.key: axis.values[i] for axis, i in zip(axes, index, strict=True)}
        fits = len(name.encode()) <= _NAME_LENGTH and shared[name.casefold()] == 1
        points.append(Point(index, values, name if fits else "point_" + "_".join(str(i + 1) for i in index)))
    return tuple(points)


def _short_keys(axes: Sequence[Axis]) -> list[str]:
    """The last step of each key, or all of a key whose last step is another's too, as a part of a file's name."""
    steps = [re.split(r"[.\[\]]+", axis.key.rstrip("]")) for axis in axes]
    last = [step[-1] for step in steps]
    return [_safe(own[-1] if last.count(own[-1]) == 1 else ".".join(own)) for own in steps]


def _parts_of_names(axis: Axis, key: str) -> list[str]:
    """What files are called after each value: `f_number=2.8`; different ones also where case does not count."""
    texts = [_safe(label) for label in axis.labels]
    times = Counter(text.casefold() for text in texts)
    return [
        f"{key}={text}" if text and times[text.casefold()] == 1 else f"{key}={text}.{i + 1}"
        for i, text in enumerate(texts)
    ]


def _safe(text: str) -> str:
    """`text` as a part of a file's name: `1/125 s` is `1-125s`, `[-1, 0, 0]` is `-1,0,0`."""
    marked = _UNSAFE.sub("\0", re.sub(r"\s+", "", text))
    return marked.strip("\0.").replace("\0", "-")
