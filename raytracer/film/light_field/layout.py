"""The layouts of a light field in a picture, and the light field that a picture holds."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.field import RAYS_LAYER, LightField, rays_from_layer
from raytracer.film.light_field.views import Views
from raytracer.util.errors import InputError

if TYPE_CHECKING:
    from raytracer.film.image import Image
    from raytracer.film.light_field.posed_field import PosedLightField
    from raytracer.film.light_field.posed_views import PosedViews

NO_LIGHT_FIELD_MESSAGE = (
    "the picture is of one view, or a part of one, and no light field: render the whole picture of a camera_array, "
    "light_slab, camera_sphere, camera_box or light_field, or of a thin_lens with the AOV rays"
)


class Layout(Protocol):
    """Places in a whole picture of what the views of a light field saw."""

    is_by_view: ClassVar[bool]
    """True if each view has a part of the picture to itself."""

    @property
    def views(self) -> "Views | PosedViews":
        """The geometry of the views."""

    def light_field(self, image: "Image") -> "LightField | PosedLightField":
        """Extract the light field, with its layers, from a whole picture."""


class ViewLayout(Layout, Protocol):
    """A layout in which each view has a part of the picture to itself."""

    def part(self, rows: slice, columns: slice) -> "ViewLayout":
        """Return the layout of the picture of some rows and columns of views."""


def extract_light_field(image: "Image") -> "LightField | PosedLightField":
    """Extract the light field that a picture holds, without a copy of its pixels.

    Raises
    ------
    InputError : it holds none.
    """
    field = None if image.layout is None else image.layout.light_field(image)
    if field is None or (field.views.rows * field.views.columns == 1 and field.rays is None):
        raise InputError(NO_LIGHT_FIELD_MESSAGE)
    return field


@dataclass(frozen=True)
class Mosaic:
    """The layout in which the view of row r and column c fills the pixels from (c width, r height) on."""

    is_by_view: ClassVar[bool] = True

    views: Views

    def part(self, rows: slice, columns: slice) -> "Mosaic":
        """Return the layout of the picture of some rows and columns of views."""
        return Mosaic(replace(self.views, position=self.views.position[rows, columns]))

    def light_field(self, image: "Image") -> LightField:
        """Extract the light field, without a copy of the pixels."""
        views = self.views
        layers = {name: split_views(layer, views) for name, layer in image.layers.items() if name != RAYS_LAYER}
        rays = rays_from_layer(image.layers[RAYS_LAYER], views) if RAYS_LAYER in image.layers else None
        return LightField(split_views(image.radiance, views), views, layers, rays, image.settings)


def split_views(picture: NDArray[Any], views: "Views | PosedViews") -> NDArray[Any]:
    """Reshape a picture (height, width, ...) to views (rows, columns, height, width, ...), without a copy."""
    rows = picture.reshape(views.rows, views.height, views.columns, views.width, *picture.shape[2:])
    return np.swapaxes(rows, 1, 2)
