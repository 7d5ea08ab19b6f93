"""Mosaics: pictures of all views of a light field side by side."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.rays_layer import RAYS_LAYER, rays_from_layer
from raytracer.film.light_field.views import Views

if TYPE_CHECKING:
    from raytracer.film.image import Image


@dataclass(frozen=True)
class Mosaic:
    """The layout in which the view of row r and column c fills the pixels from (c width, r height) on."""

    is_by_view: ClassVar[bool] = True

    views: Views

    def light_field(self, image: "Image") -> LightField:
        """Extract the light field, without a copy of the pixels."""
        rays = image.layers.get(RAYS_LAYER)
        return LightField(
            radiance=self._split_views(image.radiance),
            views=self.views,
            layers={name: self._split_views(layer) for name, layer in image.layers.items() if name != RAYS_LAYER},
            rays=None if rays is None else rays_from_layer(rays, self.views),
            settings=image.settings,
        )

    def _split_views(self, picture: NDArray[np.float64]) -> NDArray[np.float64]:
        """Reshape a picture (height, width, ...) to views (rows, columns, height, width, ...)."""
        views = self.views
        rows = picture.reshape(views.rows, views.height, views.columns, views.width, *picture.shape[2:])
        return np.swapaxes(rows, 1, 2)
