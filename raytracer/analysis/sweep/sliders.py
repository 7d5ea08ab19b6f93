"""Names of axes and points that pages, contact sheets and animations of a sweep share."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.analysis.sweep.results import Axis, PointResult, Sweep
from raytracer.report import wording

Images = Callable[[PointResult], NDArray[np.uint8] | None]
"""Function that returns the image of a point: uint8 (height, width, 3) in sRGB; None where there is none.

It is called more than once for a point, and from threads.
"""


class Slider(NamedTuple):
    """A slider that chooses among the values of a key, or of a zipped sweep among those of all keys together."""

    key: str
    name: str
    labels: tuple[str, ...]


def short_names(keys: Sequence[str]) -> list[str]:
    """Shorten keys to as many of their last parts as tell each from the others: `f_number` for `camera.f_number`."""
    parts = [key.split(".") for key in keys]
    names = [".".join(part[-1:]) for part in parts]
    most = max(map(len, parts), default=1)
    for count in range(2, most + 1):
        names = [
            name if names.count(name) == 1 else ".".join(part[-count:]) for name, part in zip(names, parts, strict=True)
        ]
    return names


def sliders(axes: Sequence[Axis], *, zipped: bool) -> tuple[Slider, ...]:
    """Make the sliders of a sweep, whose numbers make a point's index."""
    names = short_names([axis.key for axis in axes])
    if not zipped or len(axes) == 1:
        return tuple(Slider(axis.key, name, axis.labels) for axis, name in zip(axes, names, strict=True))
    together = tuple(", ".join(labels) for labels in zip(*(axis.labels for axis in axes), strict=True))
    return (Slider(",".join(axis.key for axis in axes), ", ".join(names), together),)


def scene_title(sweep: Sweep) -> str:
    """Return the scene's file without its folders, which are private."""
    return Path(sweep.scene).name


def sweep_summary(sweep: Sweep) -> str:
    """Write the number of points and of values: "35 points: 7 of camera.f_number, 5 of camera.focus_distance"."""
    points = wording.count(len(sweep.results), "point")
    if sweep.zipped:
        return f"{points}: {', '.join(axis.key for axis in sweep.axes)} together"
    return f"{points}: {', '.join(f'{len(axis.labels)} of {axis.key}' for axis in sweep.axes)}"
