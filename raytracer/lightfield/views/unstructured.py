"""Pictures from any pose, before, behind or between the views of a light field: unstructured lumigraph rendering.

The depth of the views says where surfaces are; each pixel's point of these is looked up in the views that see it, and
those of the best, by the angle between their rays and by their resolution, are blended.

Reference: Buehler et al. 2001, "Unstructured Lumigraph Rendering", sec. 3 and 4.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.posed_field import PosedLightField
from raytracer.film.light_field.posed_views import PosedViews
from raytracer.film.light_field.views import Plane, Pose
from raytracer.lightfield.views import posed_kernels as kernels
from raytracer.util.errors import InputError

FloatArray = NDArray[np.float64]

DEPTH_LAYER = "depth"

BLENDED = 4
"""Views that a pixel is blended of."""


class FreeCamera(NamedTuple):
    """A pinhole camera anywhere.

    pose : in the scene.
    plane : the image plane at a distance of 1.
    width, height (px) : of its picture.
    """

    pose: Pose
    plane: Plane
    width: int
    height: int

    def row(self) -> FloatArray:
        """Return the numbers that kernels take, float64 (15,)."""
        return np.concatenate([np.ravel(np.array(self.pose)), np.array(self.plane)])


@dataclass(frozen=True)
class NovelView:
    """A picture from a pose.

    Attributes
    ----------
    radiance : float64 (height, width, 3), NaN where nothing is known.
    depth : float64 (height, width), m along the axis, inf where nothing is seen, NaN where nothing is known.
    """

    radiance: FloatArray
    depth: FloatArray

    @property
    def unknown(self) -> float:
        """Return the share of pixels of which nothing is known."""
        return float(np.isnan(self.radiance[..., 0]).mean())


def view_from(field: PosedLightField, camera: FreeCamera) -> NovelView:
    """Draw the picture of a camera anywhere."""
    views = field.views
    target = camera.row()
    order = [(row, column) for row in range(views.rows) for column in range(views.columns)]
    surface = np.full((camera.height, camera.width, 4), np.nan)
    surface[..., 2] = math.inf
    for number, (row, column) in enumerate(order):
        depth, slopes = _depth(field, row, column)
        kernels.draw_surface(_row(views, row, column), depth, slopes, target, surface, number, np.empty((4, 3)))
    best = np.full((camera.height, camera.width, BLENDED + 1, 2), np.inf)
    for number, (row, column) in enumerate(order):
        depth, slopes = _depth(field, row, column)
        kernels.rank_view(_row(views, row, column), depth, slopes, target, surface, number, best)
    weights = _weights(best)
    total = np.zeros((camera.height, camera.width, 4))
    used = np.unique(weights[..., 1][weights[..., 0] > 0.0]).astype(int)
    for number in used.tolist():
        row, column = order[number]
        depth, slopes = _depth(field, row, column)
        radiance = field.view(row, column)
        kernels.add_view(
            _row(views, row, column), depth, slopes, radiance, target, surface, number, weights, total
        )
    with np.errstate(invalid="ignore", divide="ignore"):
        return NovelView(total[..., :3] / total[..., 3:], 1.0 / surface[..., 0])


def _row(views: PosedViews, row: int, column: int) -> FloatArray:
    return np.concatenate([views.pose[row, column].ravel(), views.plane[row, column]])


def _depth(field: PosedLightField, row: int, column: int):
    with np.errstate(divide="ignore"):
        depth = 1.0 / np.asarray(field.layers[DEPTH_LAYER][row, column], dtype=np.float64)
    slopes = np.empty((*depth.shape, 3))
    kernels.pixel_slopes(depth, float(field.views.plane[row, column, 0]), slopes)
    return depth, slopes


def _weights(best: FloatArray) -> FloatArray:
    """Compute the weights of the best views of each pixel, (height, width, k, 2); that of the last is 0."""
    penalty = best[..., 0]
    last = penalty[..., -1:]
    with np.errstate(divide="ignore", invalid="ignore"):
        weight = np.where(np.isfinite(penalty), np.where(np.isinf(last), 1.0, 1.0 - penalty / last) / penalty, 0.0)
    exact = np.isinf(weight)
    weight = np.where(exact.any(axis=-1, keepdims=True), exact, weight)
    total = weight.sum(axis=-1, keepdims=True)
    return np.stack([weight / np.where(total > 0.0, total, 1.0), best[..., 1]], axis=-1)
