"""The layer of a picture that holds its rays, and their conversion to rays of a light field."""

from typing import Any

import numpy as np

from raytracer.film.light_field.field import Rays
from raytracer.film.light_field.views import Views

RAYS_LAYER = "rays"
"""The layer of a picture that holds its rays, as the AOV of that name."""

_COLUMNS = 8


def rays_from_layer(layer: Any, views: Views) -> Rays:
    """Convert the rays in a layer of a picture.

    Parameters
    ----------
    layer : (height, width, n * 8), of n samples a pixel each: place in the plane of the views, right and up (m); slopes
        right and up; red, green and blue; 1, or 0 where there is no sample.

    Missing samples, and rays whose place is not finite, are left out.
    """
    rows = np.asarray(layer, dtype=np.float64).reshape(-1, _COLUMNS)
    rows = rows[(rows[:, 7] != 0.0) & np.isfinite(rows[:, :4]).all(axis=1)]
    place = rows[:, :4].copy()
    place[:, 2:] += views.inverse_focus * place[:, :2]
    return Rays(place, rows[:, 4:7].copy(), rows[:, 7].copy())
