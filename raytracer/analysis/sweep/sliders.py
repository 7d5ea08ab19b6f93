"""What pages, sheets and animations of a sweep have in common: how its axes are called, and where its pictures are."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.sweeping.points import Axis, Sweep, Taken

Images = Callable[[Taken], NDArray[np.uint8] | None]
"""What is shown of a point: uint8 (height, width, 3) in sRGB; None where there is nothing.

It is called more than once for a point, and from threads.
"""


class Slider(NamedTuple):
    """What is chosen with one slider: a key's values, or of a zipped sweep those of all keys together."""

    key: str
    name: str
    labels: tuple[str, ...]


def short_names(keys: Sequence[str]) -> list[str]:
    """The last parts of keys, as many as tell each from the others: `f_number` for `camera.f_number`."""
    parts = [key.split(".") for key in keys]
    names = [".".join(part[-1:]) for part in parts]
    most = max(map(len, parts), default=1)
    for count in range(2, most + 1):
        names = [
            name if names.count(name) == 1 else ".".join(part[-count:]) for name, part in zip(names, parts, strict=True)
        ]
    return names


def sliders(axes: Sequence[Axis], *, zipped: bool) -> tuple[Slider, ...]:
    """The sliders of a sweep, whose numbers make a point's index."""
    names = short_names([axis.key for axis in axes])
    if not zipped or len(axes) == 1:
        return tuple(Slider(axis.key, name, axis.labels) for axis, name in zip(axes, names, strict=True))
    together = tuple(", ".join(labels) for labels in zip(*(axis.labels for axis in axes), strict=True))
    return (Slider(",".join(axis.key for axis in axes), ", ".join(names), together),)


def title_of(sweep: Sweep) -> str:
    """The scene's file without its folders, which are nobody else's."""
    return Path(sweep.scene).name


def extent(sweep: Sweep) -> str:
    """How many points there are, and of what: "35 points: 7 of camera.f_number x 5 of camera.focus_distance"."""
    count = len(sweep.taken)
    points = f"{count} point{'' if count == 1 else 's'}"
    if sweep.zipped:
        return f"{points}: {', '.join(axis.key for axis in sweep.axes)} together"
    return f"{points}: {', '.join(f'{len(axis.labels)} of {axis.key}' for axis in sweep.axes)}"
