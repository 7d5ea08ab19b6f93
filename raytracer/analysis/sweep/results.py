"""Axes, points and results of a sweep, as plain values."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

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
        return shape_of(self.axes, zipped=self.zipped)

    def __repr__(self) -> str:
        counts = Counter(result.status for result in self.results)
        axes = (" and " if self.zipped else " x ").join(f"{len(axis.values)} {axis.key}" for axis in self.axes)
        states = ", ".join(f"{counts[status]} {status}" for status in ("done", "failed", "missing") if counts[status])
        return f"<rt.Sweep of {self.scene}: {axes}, {states}>"

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


def shape_of(axes: Sequence[Axis], *, zipped: bool) -> tuple[int, ...]:
    """Return the number of values of each axis; of zipped axes, the number of points."""
    return (len(axes[0].values),) if zipped else tuple(len(axis.values) for axis in axes)
