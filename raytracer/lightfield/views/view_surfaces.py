"""Surfaces that the views of a light field see: by the layer `depth`, by an estimate, or a plane in their place."""

from collections import OrderedDict
from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.field import DEPTH_LAYER, LightField
from raytracer.film.light_field.posed_field import PosedLightField
from raytracer.film.light_field.views import Pose
from raytracer.lightfield.depth.depth_map import Depth
from raytracer.lightfield.kernels import view_surfaces as kernels
from raytracer.lightfield.views.synthesis import reproject_depth
from raytracer.util.errors import InputError

FloatArray = NDArray[np.float64]

DepthOfView: TypeAlias = Callable[[int, int], FloatArray]
"""One over the depth (1/m) of a view by row and column, float64 (height, width): 0 for infinity, NaN if not known."""

KEPT_BYTES = 256 << 20
"""Most bytes of surfaces that are kept for when they are asked for again."""

SURFACE_BYTES = 8 * (1 + kernels.SLOPES)
"""Bytes a pixel of the surface of a view."""


def layer_depth(field: PosedLightField) -> DepthOfView:
    """Read the depth of views from the layer of that name."""

    def depth(row: int, column: int) -> FloatArray:
        layer = np.asarray(field.layers[DEPTH_LAYER][row, column], dtype=np.float64)
        lit = field.lit(row, column)
        is_known = layer > 0.0 if lit is None else lit & (layer > 0.0)
        return np.asarray(np.divide(1.0, layer, out=np.full(layer.shape, np.nan), where=is_known))

    return depth


def estimated_depth(field: LightField, depth: Depth) -> DepthOfView:
    """Carry the depth that was estimated for one view in a plane to the others."""
    return lambda row, column: np.maximum(reproject_depth(depth, field.views, field.views.position[row, column]), 0.0)


def plane_depth(field: PosedLightField, pose: Pose, distance: float | None) -> DepthOfView:
    """Put a plane across the axis of a camera in the place of all surfaces.

    distance (m) : along that axis; default: the plane goes through the point that all views look at.

    Raises
    ------
    InputError : the views look at no point.
    """
    views = field.views
    normal = np.array(pose.forward)
    if distance is not None:
        point = np.array(pose.origin) + distance * normal
    else:
        middle = views.focus_point()
        ahead = None if middle is None else ((middle - views.pose[..., 0, :]) * views.pose[..., 3, :]).sum(axis=-1)
        if middle is None or ahead is None or np.median(ahead) <= 0.0:
            raise InputError(
                "nothing is known of its depth, and its views look at no point: give a distance, or render it with "
                "--aov depth"
            )
        point = middle

    def depth(row: int, column: int) -> FloatArray:
        origin, right, up, forward = views.pose[row, column]
        pixel, left, top = views.plane[row, column]
        x, y = left + pixel * (np.arange(views.width) + 0.5), top - pixel * (np.arange(views.height)[:, None] + 0.5)
        away = float(normal @ (point - origin))
        along = normal @ forward + (normal @ right) * x + (normal @ up) * y
        # A view in the plane itself sees nothing of it, and others none beyond its horizon.
        inverse = along / away if away != 0.0 else np.full(along.shape, np.nan)
        return np.where(inverse > 0.0, inverse, np.nan)

    return depth


class Surface(NamedTuple):
    """What a view sees.

    camera : float64 (15,), the row of its pose and image plane for kernels.
    depth : float64 (height, width), see `DepthOfView`.
    slopes : float64 (height, width, 4), see `kernels.view_surfaces.pixel_slopes`.
    """

    camera: FloatArray
    depth: FloatArray
    slopes: FloatArray


class ViewSurfaces:
    """The surfaces of all views, made when they are asked for; the last of them are kept, at most `room` of them."""

    def __init__(self, field: PosedLightField, depth: DepthOfView, room: int) -> None:
        self._field, self._depth = field, depth
        self._kept: OrderedDict[tuple[int, int], Surface] = OrderedDict()
        self._room = room

    def camera(self, row: int, column: int) -> FloatArray:
        """Return the row of a view's pose and image plane."""
        views = self._field.views
        return np.concatenate([views.pose[row, column].ravel(), views.plane[row, column]])

    def of(self, row: int, column: int) -> Surface:
        """Return the surface that a view sees."""
        kept = self._kept.get((row, column))
        if kept is not None:
            self._kept.move_to_end((row, column))
            return kept
        depth = np.ascontiguousarray(self._depth(row, column))
        slopes = np.empty((*depth.shape, kernels.SLOPES))
        camera = self.camera(row, column)
        kernels.pixel_slopes(depth, float(camera[kernels.PIXEL]), slopes)
        surface = Surface(camera, depth, slopes)
        self._kept[row, column] = surface
        if len(self._kept) > self._room:
            self._kept.popitem(last=False)
        return surface
