"""Coverage of a light field: its views, and their pixels, that any light came to.

Behind a round lens the views in the corners see its mount; where a lens vignettes, or dust lies on the sensor, others
lack some pixels.  A file's layer `lit` holds these masks (`film.light_field.field.LIT_LAYER`); without it all pixels of
the views that lie within the lens are lit.
"""

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.field import LIT_LAYER, FieldArrays, LightField
from raytracer.film.light_field.posed_field import PosedLightField
from raytracer.film.light_field.posed_views import PosedViews
from raytracer.film.light_field.views import Views
from raytracer.lightfield.synthetic_aperture import cell_weights
from raytracer.util.errors import InputError

Mask = NDArray[np.bool_]

Light = TypeVar("Light", np.bool_, np.float64)
"""Pixels that are lit or not, or the light that they received."""


def within_lens(views: Views) -> Mask:
    """Find the views that look through the lens they are behind: bool (rows, columns); all of an array of cameras."""
    if views.coverage is not None:
        return np.asarray(views.coverage > 0.0)
    if views.aperture is None:
        return np.ones((views.rows, views.columns), dtype=bool)
    return np.asarray(np.hypot(views.position[..., 0], views.position[..., 1]) <= 0.5 * views.aperture)


def _gathers_light(views: Views | PosedViews) -> Mask:
    """Find the views that are not outside of the lens that all are behind: bool (rows, columns)."""
    if isinstance(views, PosedViews):
        return np.ones((views.rows, views.columns), dtype=bool)
    return np.asarray(cell_weights(views) > 0.0)


def lit_views(field: LightField | PosedLightField) -> Mask:
    """Find the views with a pixel that any light came to, by the lens, and by the layer `lit`: bool (rows, columns)."""
    lit = _gathers_light(field.views)
    if LIT_LAYER in field.layers:
        for row, column in np.argwhere(lit):
            lit[row, column] = np.any(field.layers[LIT_LAYER][int(row), int(column)])
    return lit


def require_lit(field: LightField | PosedLightField, row: int, column: int) -> None:
    """Raise an InputError if no light came to a view."""
    lit = field.lit(row, column)
    if not _gathers_light(field.views)[row, column] or (lit is not None and not lit.any()):
        raise InputError(f"no light came to view {row},{column}: it lies outside the lens")


def lit_view(field: FieldArrays, row: int, column: int) -> tuple[NDArray[np.float64], Mask | None]:
    """Read a view (height, width, 3), with unlit pixels filled from the nearest lit ones; and the mask of lit pixels.

    The mask is None if all are lit.  A view without any light is 0.
    """
    view, lit = field.view(row, column), field.lit(row, column)
    if lit is None or lit.all():
        return view, None
    return extrapolate_unlit(view, lit), lit


def extrapolate_unlit(values: NDArray[np.float64], lit: Mask) -> NDArray[np.float64]:
    """Replace values (height, width, ...) that are not lit by those of the nearest pixel that is; by 0 if none is."""
    from scipy import ndimage

    if not lit.any():
        return np.zeros_like(values)
    rows, columns = ndimage.distance_transform_edt(~lit, return_distances=False, return_indices=True)
    return np.asarray(values[rows, columns])


def lit_at_nearest(lit: NDArray[Light], rows: NDArray[np.float64], columns: NDArray[np.float64]) -> NDArray[Light]:
    """Look up the light, or if there is any, at the pixels nearest to places, within the view or at its edge."""
    height, width = lit.shape
    row = np.clip(np.rint(rows), 0, height - 1).astype(np.int64)
    column = np.clip(np.rint(columns), 0, width - 1).astype(np.int64)
    return np.asarray(lit[row, column])
