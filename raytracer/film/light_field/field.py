"""A light field in memory, or as a file that is read as it is needed."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.plenoptic.views import Views

LIT = "lit"
"""The layer of which pixels any light came to: 1; and 0 where nothing is known, whatever their radiance is."""


class Samples(NamedTuple):
    """Samples of the microlenses, which the pixels of the views were interpolated from.

    place (n, 2) float64: of the microlenses, right and down in pixels of a view, from the middle of its first pixel;
    value (rows, columns, n, 3) float: what each view saw there, nan where no light came; an array, or what reads one
    from a file by slices.
    """

    place: NDArray[np.float64]
    value: Any


class Rays(NamedTuple):
    """Rays that were rendered, each with where it went and what it brought.

    place (n, 4) float64: right and up in the plane of the views (m), and right and up in the image of the middle at a
    distance of 1 of where the ray meets the plane in which all views see the same (`Views`); value (n, 3) float64, what
    it added to the picture, and weight (n,) float64, what it counted for there.
    """

    place: NDArray[np.float64]
    value: NDArray[np.float64]
    weight: NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class LightField:
    """What all views saw, in linear light.

    Attributes
    ----------
    radiance : float (rows, columns, height, width, 3), row 0 at the top; an array, or what reads one from a file by
        slices.
    views : its geometry.
    layers : further arrays by name, (rows, columns, height, width) or with a last axis of channels: `depth` (m, along
        the axis of the views), `lit`, and other AOVs.
    rays : the rays themselves, where they were kept.
    settings : what it was made with.
    samples : what pixels were interpolated from, where they were.

    Raises
    ------
    ValueError : an array is not of the views' size.
    """

    radiance: Any
    views: Views
    layers: Mapping[str, Any] = field(default_factory=dict)
    rays: Rays | None = None
    settings: Mapping[str, str | float | int] = field(default_factory=dict)
    samples: Samples | None = None

    def __post_init__(self) -> None:
        views = self.views
        size = (views.rows, views.columns, views.height, views.width)
        if tuple(np.shape(self.radiance)) != (*size, 3):
            raise ValueError(f"radiance must have the shape {(*size, 3)}, got {tuple(np.shape(self.radiance))}")
        for name, layer in self.layers.items():
            if tuple(np.shape(layer))[:4] != size:
                raise ValueError(f"layer {name} must be of the views' size, {size}, got {tuple(np.shape(layer))[:4]}")
        if LIT in self.layers and len(np.shape(self.layers[LIT])) != len(size):
            raise ValueError(f"layer {LIT} must have one number a pixel")
        if self.samples is not None:
            place, value = np.shape(self.samples.place), tuple(np.shape(self.samples.value))
            if place[1:] != (2,) or value != (*size[:2], place[0], 3):
                raise ValueError(f"samples must be of shapes (n, 2) and {(*size[:2], 'n', 3)}, got {place} and {value}")

    def __repr__(self) -> str:
        """In short: arrays are large."""
        views = self.views
        size = f"{views.columns} x {views.rows} views of {views.width} x {views.height}"
        return f"<rt.lightfield.LightField: {size}>"

    @property
    def is_metric(self) -> bool:
        """Whether lengths are metres, as all are but where the camera's geometry is not known: `settings["units"]`."""
        return self.settings.get("units", "metres") == "metres"

    def view(self, row: int, column: int) -> NDArray[np.float64]:
        """What one view saw, float64 (height, width, 3)."""
        return np.asarray(self.radiance[row, column], dtype=np.float64)

    def lit(self, row: int, column: int) -> NDArray[np.bool_] | None:
        """Read which pixels of a view any light came to, bool (height, width); None for all, or where nobody says."""
        layer = self.layers.get(LIT)
        return None if layer is None else np.asarray(np.asarray(layer[row, column]) > 0)
