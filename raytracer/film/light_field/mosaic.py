"""A picture that is made of all views of a light field, side by side."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from raytracer.plenoptic.field import LightField
from raytracer.plenoptic.rays import LAYER, rays_of
from raytracer.plenoptic.views import Views

if TYPE_CHECKING:
    from raytracer.film.image import Image


@dataclass(frozen=True)
class Mosaic:
    """The view of row r and column c fills the pixels from (c width, r height) on."""

    is_by_view: ClassVar[bool] = True

    views: Views

    def light_field(self, image: "Image") -> LightField:
        """What the picture holds, without a copy of its pixels."""
        rays = image.layers.get(LAYER)
        return LightField(
            radiance=self._apart(image.radiance),
            views=self.views,
            layers={name: self._apart(layer) for name, layer in image.layers.items() if name != LAYER},
            rays=None if rays is None else rays_of(rays, self.views),
            settings=image.settings,
        )

    def _apart(self, picture: NDArray[np.float64]) -> NDArray[np.float64]:
        views = self.views
        rows = picture.reshape(views.rows, views.height, views.columns, views.width, *picture.shape[2:])
        return np.swapaxes(rows, 1, 2)
