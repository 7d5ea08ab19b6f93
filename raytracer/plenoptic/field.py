"""A light field in memory, or as a file that is read as it is needed."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.plenoptic.views import Views


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
        the axis of the views), and other AOVs.
    rays : the rays themselves, where they were kept.
    settings : what it was made with.

    Raises
    ------
    ValueError : an array is not of the views' size.
    """

    radiance: Any
    views: Views
    layers: Mapping[str, Any] = field(default_factory=dict)
    rays: Rays | None = None
    settings: Mapping[str, str | float | int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        views = self.views
        size = (views.rows, views.columns, views.height, views.width)
        if tuple(np.shape(self.radiance)) != (*size, 3):
            raise ValueError(f"radiance must have the shape {(*size, 3)}, got {tuple(np.shape(self.radiance))}")
        for name, layer in self.layers.items():
            if tuple(np.shape(layer))[:4] != size:
                raise ValueError(f"layer {name} must be of the views' size, {size}, got {tuple(np.shape(layer))[:4]}")

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
