"""A light field of views that each have a pose of their own, and the layout of such views in a picture."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

from raytracer.film.light_field.field import FieldArrays, LightField, check_arrays
from raytracer.film.light_field.layout import split_views
from raytracer.film.light_field.posed_views import PosedViews

if TYPE_CHECKING:
    from raytracer.film.image import Image


@dataclass(frozen=True, eq=False, repr=False)
class PosedLightField(FieldArrays):
    """A light field of views with poses of their own: the radiance of all, in linear light.

    Attributes
    ----------
    radiance : float (rows, columns, height, width, 3); an array, or one that is read from a file by slices.
    views : its geometry.
    layers : further arrays by name, (rows, columns, height, width) or with a last axis of channels: `depth` (m, along
        the axis of each view), `lit`, and other AOVs.
    settings : that it was made with.
    rays, samples : None: single rays, and samples of microlenses, belong to views in one plane.

    Raises
    ------
    ValueError : an array is not of the views' size.
    """

    rays: ClassVar[None] = None
    samples: ClassVar[None] = None

    radiance: Any
    views: PosedViews
    layers: Mapping[str, Any] = field(default_factory=dict)
    settings: Mapping[str, str | float | int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_arrays(self)

    @classmethod
    def of(cls, planar: LightField) -> "PosedLightField":
        """Convert a light field of views in one plane; its arrays are not copied."""
        return cls(planar.radiance, PosedViews.of(planar.views), planar.layers, planar.settings)


@dataclass(frozen=True)
class PosedMosaic:
    """The layout in which the view of row r and column c fills the pixels from (c width, r height) on."""

    is_by_view: ClassVar[bool] = True

    views: PosedViews

    def part(self, rows: slice, columns: slice) -> "PosedMosaic":
        """Return the layout of the picture of some rows and columns of views."""
        return PosedMosaic(self.views.part(rows, columns))

    def light_field(self, image: "Image") -> PosedLightField:
        """Extract the light field, without a copy of the pixels."""
        layers = {name: split_views(layer, self.views) for name, layer in image.layers.items()}
        return PosedLightField(split_views(image.radiance, self.views), self.views, layers, image.settings)
