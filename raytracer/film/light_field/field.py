"""A light field in memory, or as a file that is read as it is needed."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.views import Views

if TYPE_CHECKING:
    from raytracer.film.light_field.posed_views import PosedViews

LIT_LAYER = "lit"
"""The layer of the light that pixels received.

0 where nothing is known, whatever their radiance is; elsewhere 1, or the fraction of what an unvignetted pixel gets.
"""

DEPTH_LAYER = "depth"
"""The layer of distances along the axis (m)."""

PLAIN_LAYERS = (LIT_LAYER, DEPTH_LAYER)
"""Layers of one number a pixel, without an axis of channels."""


class Samples(NamedTuple):
    """Samples of the microlenses, which the pixels of the views were interpolated from.

    Attributes
    ----------
    place (px) : float64 (n, 2), microlenses right and down in pixels of a view, from the middle of its first pixel.
    value : float (rows, columns, n, 3), radiance that each view saw there, NaN where no light came; an array, or one
        that is read from a file by slices.
    """

    place: NDArray[np.float64]
    value: Any


class Rays(NamedTuple):
    """Rays that were rendered.

    Attributes
    ----------
    place : float64 (n, 4), right and up in the plane of the views (m), and tangents right and up, in the middle view,
        of the point where the ray meets the plane of focus (`Views`).
    value : float64 (n, 3), radiance that the ray added to the picture.
    weight : float64 (n,), its weight there.
    bundle : float64 (n, 2), where a ray stands for the light through all of a microlens: what it is wide at infinity
        (tangent) and in the plane of the views (m), see `lenslet_kinds`; None for rays without a width.
    """

    place: NDArray[np.float64]
    value: NDArray[np.float64]
    weight: NDArray[np.float64]
    bundle: NDArray[np.float64] | None = None


class FieldArrays:
    """Base of light fields: the arrays and settings that all have, in whatever way their views stand."""

    radiance: Any
    views: "Views | PosedViews"
    layers: Mapping[str, Any]
    settings: Mapping[str, str | float | int]

    def __repr__(self) -> str:
        """Describe the sizes only: arrays are large."""
        views = self.views
        size = f"{views.columns} x {views.rows} views of {views.width} x {views.height}"
        return f"<rt.lightfield.{type(self).__name__.removeprefix('Open')}: {size}>"

    @property
    def is_metric(self) -> bool:
        """Return True if lengths are metres; they are not if the camera's geometry is unknown: `settings["units"]`."""
        return self.settings.get("units", "metres") == "metres"

    def view(self, row: int, column: int) -> NDArray[np.float64]:
        """Read the radiance of a view, float64 (height, width, 3)."""
        return np.asarray(self.radiance[row, column], dtype=np.float64)

    def light(self, row: int, column: int) -> NDArray[np.float64] | None:
        """Read how much light each pixel of a view received, (height, width), 0 to 1; None as for `lit`."""
        layer = self.layers.get(LIT_LAYER)
        return None if layer is None else np.asarray(layer[row, column], dtype=np.float64)

    def lit(self, row: int, column: int) -> NDArray[np.bool_] | None:
        """Read which pixels of a view received light, bool (height, width); None for all, or if not known."""
        layer = self.layers.get(LIT_LAYER)
        return None if layer is None else np.asarray(np.asarray(layer[row, column]) > 0)


def check_arrays(field: FieldArrays) -> None:
    """Raise a ValueError if radiance and layers are not of the views' size."""
    views = field.views
    size = (views.rows, views.columns, views.height, views.width)
    if tuple(np.shape(field.radiance)) != (*size, 3):
        raise ValueError(f"radiance must have the shape {(*size, 3)}, got {tuple(np.shape(field.radiance))}")
    for name, layer in field.layers.items():
        if tuple(np.shape(layer))[:4] != size:
            raise ValueError(f"layer {name} must be of the views' size, {size}, got {tuple(np.shape(layer))[:4]}")
        if name in PLAIN_LAYERS and len(np.shape(layer)) != len(size):
            raise ValueError(f"layer {name} must have one number a pixel")


@dataclass(frozen=True, eq=False, repr=False)
class LightField(FieldArrays):
    """A light field: the radiance of all views, in linear light.

    Attributes
    ----------
    radiance : float (rows, columns, height, width, 3), row 0 at the top; an array, or one that is read from a
        file by slices.
    views : its geometry.
    layers : further arrays by name, (rows, columns, height, width) or with a last axis of channels: `depth` (m, along
        the axis of the views), `lit`, and other AOVs.
    rays : the single rays, if they are known.
    settings : that it was made with.
    samples : of the microlenses that pixels were interpolated from, if there are any.

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
        check_arrays(self)
        if self.samples is not None:
            views = (self.views.rows, self.views.columns)
            place, value = np.shape(self.samples.place), tuple(np.shape(self.samples.value))
            if place[1:] != (2,) or value != (*views, place[0], 3):
                raise ValueError(f"samples must be of shapes (n, 2) and {(*views, 'n', 3)}, got {place} and {value}")


RAYS_LAYER = "rays"
"""The layer of a picture that holds its rays, as the AOV of that name."""

_COLUMNS = 8


def rays_from_layer(layer: Any, views: Views) -> Rays:
    """Convert the rays in a layer of a picture.

    layer : (height, width, n * 8), of n samples a pixel each: place in the plane of the views, right and up (m); slopes
        right and up; red, green and blue; 1, or 0 where there is no sample.

    Missing samples, and rays whose place is not finite, are left out.
    """
    rows = np.asarray(layer, dtype=np.float64).reshape(-1, _COLUMNS)
    rows = rows[(rows[:, 7] != 0.0) & np.isfinite(rows[:, :4]).all(axis=1)]
    place = rows[:, :4].copy()
    place[:, 2:] += views.inverse_focus * place[:, :2]
    return Rays(place, rows[:, 4:7].copy(), rows[:, 7].copy())
