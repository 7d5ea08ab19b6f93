"""Axes, points and results of a sweep, as plain values."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.analysis.sweep.notebook import sweep_html
from raytracer.report.wording import count
from raytracer.util.errors import InputError

if TYPE_CHECKING:
    from raytracer.film.image import Image


class Axis(NamedTuple):
    """A key of the scene, and the values that it takes in turn.

    values : as `raytracer.load` takes overrides.
    labels : a short string for each, all different: what was written ("1.4", "1/125 s", "ball"), or the number with as
        many digits as distinguish it from the others.
    """

    key: str
    values: tuple[Any, ...]
    labels: tuple[str, ...]


@dataclass(frozen=True)
class SweepPoint:
    """One combination of values.

    index : for each axis, the number of its value.
    values : by key, those of the axes alone.
    name : stem of its files, different for all points.
    digest : hex SHA-256 of all that its image depends on, or "" where its scene is wrong or a file of it changed while
        it was read.
    """

    index: tuple[int, ...]
    values: dict[str, Any]
    name: str
    digest: str = ""


@dataclass(frozen=True)
class PointResult:
    """Result of a point.

    status : "done", "failed", or "missing", if the sweep was ended before it.
    reason : why it failed; one sentence.
    files : names of its images within the folder, in the order of the formats that were asked for; the first is for
        display if any is.
    camera : derived numbers of the camera by names that end in their units, as in `rt explain`; may be inf.
    exposure : numbers of the exposure, as `rt render --stats` has them; empty for plain radiance.
    seconds : by phase, as in `Stats.seconds`, with "total".
    samples : mean samples a pixel.
    rays : camera, bounce and shadow rays.
    error : `relative` error (RMS, 0.01 is 1 %) with `low` and `high`, the ends of its 95 % interval; empty if unknown.
    nan_samples : samples that were not finite and were dropped.
    complete : True if all samples were taken, or the error asked for was reached.
    warnings : of its scene, a sentence each.
    """

    point: SweepPoint
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


Images = Callable[[PointResult], NDArray[np.uint8] | None]
"""Function that returns the image of a point: uint8 (height, width, 3) in sRGB; None where there is none.

It is called more than once for a point, and from threads.
"""


class Slider(NamedTuple):
    """A slider that chooses among the values of a key, or of a zipped sweep among those of all keys together."""

    key: str
    name: str
    labels: tuple[str, ...]


@dataclass(frozen=True)
class Sweep:
    """A sweep, as far as it got.

    Attributes
    ----------
    scene : the scene's file, or "scene" for one that has none.
    axes : in the order in which they were given; the last one's values change fastest from point to point.
    zipped : True if the axes' values are taken in pairs, so that all of a point's indices are alike.
    results : one for each point, in their order.
    folder : folder of the images; None if they are in memory.
    interrupted : True if a KeyboardInterrupt ended it early.
    reused : number of points that were done by an earlier sweep.
    pictures : the image of each point, in their order, None for those that are not done; empty if they are in `folder`.
    """

    scene: str
    axes: tuple[Axis, ...]
    zipped: bool
    results: tuple[PointResult, ...]
    folder: Path | None = None
    interrupted: bool = False
    reused: int = 0
    pictures: tuple["Image | None", ...] = ()

    @property
    def taken(self) -> tuple[PointResult, ...]:
        """The old name of `results`."""
        return self.results

    @property
    def kept(self) -> int:
        """The old name of `reused`."""
        return self.reused

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values of each axis; of zipped axes, number of points."""
        lengths = tuple(len(axis.values) for axis in self.axes)
        return lengths[:1] if self.zipped else lengths

    @property
    def title(self) -> str:
        """The scene's file without its folders, which are private."""
        return Path(self.scene).name

    @property
    def summary(self) -> str:
        """The number of points and of values: "35 points: 7 of camera.f_number, 5 of camera.focus_distance"."""
        points = count(len(self.results), "point")
        if self.zipped:
            return f"{points}: {', '.join(axis.key for axis in self.axes)} together"
        return f"{points}: {', '.join(f'{len(axis.labels)} of {axis.key}' for axis in self.axes)}"

    @property
    def sliders(self) -> tuple[Slider, ...]:
        """Sliders whose numbers make a point's index."""
        names = short_names([axis.key for axis in self.axes])
        if not self.zipped or len(names) == 1:
            return tuple(Slider(axis.key, name, axis.labels) for axis, name in zip(self.axes, names, strict=True))
        together = tuple(", ".join(labels) for labels in zip(*(axis.labels for axis in self.axes), strict=True))
        return (Slider(",".join(axis.key for axis in self.axes), ", ".join(names), together),)

    def __repr__(self) -> str:
        counts = Counter(result.status for result in self.results)
        axes = (" and " if self.zipped else " x ").join(f"{len(axis.values)} {axis.key}" for axis in self.axes)
        states = ", ".join(f"{counts[status]} {status}" for status in ("done", "failed", "missing") if counts[status])
        return f"<rt.Sweep of {self.scene}: {axes}, {states}>"

    def _repr_html_(self) -> str:
        """Show the pictures in a notebook."""
        return sweep_html(self)

    @property
    def images(self) -> NDArray[np.object_]:
        """Images, of shape `shape`: `images[2, 0].radiance`; None for points that are not done.

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


def short_names(keys: Sequence[str]) -> list[str]:
    """Shorten keys to as many of their last parts as tell each from the others: `f_number` for `camera.f_number`."""
    parts = [key.split(".") for key in keys]
    names = [".".join(part[-1:]) for part in parts]
    most = max(map(len, parts), default=1)
    for length in range(2, most + 1):
        names = [
            name if names.count(name) == 1 else ".".join(part[-length:])
            for name, part in zip(names, parts, strict=True)
        ]
    return names
