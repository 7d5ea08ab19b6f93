"""Pictures from any pose, before, behind or between the views of a light field: unstructured lumigraph rendering.

The depth of the views says where surfaces are: those of the views that look most alike are drawn into the picture, the
nearest counts, and what another view sees through is taken away again.  The point of each pixel is then looked up in
the views that see it, and those of the best, by the angle between their rays and by their resolution, are blended, with
weights that fall to 0 at the first that is left out, so that nothing jumps as the camera moves.

Reference: Buehler et al. 2001, "Unstructured Lumigraph Rendering", sec. 3 and 4.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.field import DEPTH_LAYER, LightField
from raytracer.film.light_field.posed_field import PosedLightField
from raytracer.lightfield.depth.depth_map import Depth
from raytracer.lightfield.kernels import view_blending
from raytracer.lightfield.kernels import view_surfaces as kernels
from raytracer.lightfield.memory import MORE_MEMORY, count_that_fit
from raytracer.lightfield.views.free_camera import FreeCamera
from raytracer.lightfield.views.view_surfaces import (
    KEPT_BYTES,
    SURFACE_BYTES,
    DepthOfView,
    ViewSurfaces,
    estimated_depth,
    layer_depth,
    plane_depth,
)

FloatArray = NDArray[np.float64]

BLENDED = 4
"""Views that a pixel is blended of, as Buehler et al. use."""

MOST_VIEWS = 48
"""Views, those that look most alike, that a picture is drawn from: with twice as many, pictures are the same."""

_ROUNDS = 6
"""Times that surfaces are drawn, each without what views saw through in the last: a few pixels are left after these."""

_PROBES = 5
"""Pixels in a row and in a column of a view at which it is compared with a camera."""

_SUBPIXELS = 2
"""Subpixels in a row and in a column of a pixel: edges are as soft as those of a render."""

_SUBPIXEL_BYTES, _VIEW_BYTES = 320, 180
"""Bytes of the work on a picture: a subpixel; and a pixel of a view, of one that is read and its depth."""


@dataclass(frozen=True)
class FreeView:
    """A picture from a pose.

    Attributes
    ----------
    radiance : float64 (height, width, 3), NaN where nothing is known.
    depth (m) : float64 (height, width), along the axis; inf where nothing is seen, NaN where nothing is known.
    """

    radiance: FloatArray
    depth: FloatArray

    @property
    def unknown(self) -> float:
        """The share of pixels of which nothing is known."""
        return float(np.isnan(self.radiance[..., 0]).mean())


def view_from(
    field: LightField | PosedLightField,
    camera: FreeCamera,
    *,
    depth: Depth | None = None,
    distance: float | None = None,
) -> FreeView:
    """Draw the picture of a camera anywhere.

    Views are read one at a time, some of them again.

    Parameters
    ----------
    depth : an estimate, for views in one plane without a layer `depth`.
    distance : of a plane across the axis of the camera (m) that is taken for all surfaces, in place of the depth;
        default, where no depth is known: the plane through the point that all views look at.

    Raises
    ------
    InputError : no depth is known, and there is no such point; or it takes more than `memory.memory_limit` gives.
    """
    return next(views_along(field, [camera], depth=depth, distance=distance))


def views_along(
    field: LightField | PosedLightField,
    cameras: Iterable[FreeCamera],
    *,
    depth: Depth | None = None,
    distance: float | None = None,
) -> Iterator[FreeView]:
    """Draw the pictures of cameras, one after the other; see `view_from`."""
    posed = PosedLightField.of(field) if isinstance(field, LightField) else field
    by_view: DepthOfView | None = None
    if distance is None and DEPTH_LAYER in field.layers:
        by_view = layer_depth(posed)
    elif distance is None and depth is not None and isinstance(field, LightField):
        by_view = estimated_depth(field, depth)
    cameras = list(cameras)
    room = _count_surfaces(posed, cameras)
    surfaces = None if by_view is None else ViewSurfaces(posed, by_view, room)
    for camera in cameras:
        known = surfaces or ViewSurfaces(posed, plane_depth(posed, camera.pose, distance), room)
        yield _average_subpixels(_draw(posed, known, camera.finer(_SUBPIXELS)))


def _count_surfaces(field: PosedLightField, cameras: Sequence[FreeCamera]) -> int:
    """Count the surfaces of views that there is memory to keep beside a picture; an InputError if there is none."""
    width, height = max(((c.width, c.height) for c in cameras), key=math.prod, default=(0, 0))
    pixels, of_view = width * height, field.views.width * field.views.height
    count = count_that_fit(
        pixels * _SUBPIXELS**2 * _SUBPIXEL_BYTES + of_view * _VIEW_BYTES,
        of_view * SURFACE_BYTES,
        f"a picture of {width} x {height} pixels",
        f"a smaller --size takes less, or {MORE_MEMORY}",
    )
    return max(1, min(count, KEPT_BYTES // (of_view * SURFACE_BYTES)))


def _average_subpixels(fine: FreeView) -> FreeView:
    """Average the subpixels of each pixel of which something is known."""
    height, width = (size // _SUBPIXELS for size in fine.depth.shape)

    def mean(values: FloatArray) -> FloatArray:
        parts = values.reshape(height, _SUBPIXELS, width, _SUBPIXELS, -1).swapaxes(1, 2)
        parts = parts.reshape(height, width, _SUBPIXELS**2, -1)
        known = ~np.isnan(parts)
        total, count = np.where(known, parts, 0.0).sum(axis=2), known.sum(axis=2)
        return np.asarray(np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0))

    return FreeView(mean(fine.radiance), mean(fine.depth)[..., 0])


def _draw(field: PosedLightField, surfaces: ViewSurfaces, camera: FreeCamera) -> FreeView:
    """Draw a picture at one place a pixel."""
    target, size = camera.row(), (camera.height, camera.width)
    chosen = _most_alike(field, surfaces, target, size)
    surface = _draw_surfaces(surfaces, target, size, chosen)
    best = np.full((*size, BLENDED + 1, 2), np.inf)
    for number, view in enumerate(chosen):
        source = surfaces.of(*view)
        view_blending.rank_view(source.camera, source.depth, source.slopes, target, surface, number, best)
    weights = _blending_weights(best)
    total = np.zeros((*size, 4))
    used = np.unique(weights[..., 1][weights[..., 0] > 0.0]).astype(np.int64)
    for number in used.tolist():
        seen, radiance = surfaces.of(*chosen[number]), field.view(*chosen[number])
        view_blending.add_view(seen, radiance, target, surface, number, weights, total)
    weight = total[..., 3:]
    radiance = np.divide(total[..., :3], weight, out=np.full((*size, 3), np.nan), where=weight > 0.0)
    with np.errstate(divide="ignore"):
        depth = np.where(weight[..., 0] > 0.0, 1.0 / surface[..., 0], np.nan)
    return FreeView(radiance, depth)


def _most_alike(
    field: PosedLightField, surfaces: ViewSurfaces, target: FloatArray, size: tuple[int, int]
) -> list[tuple[int, int]]:
    """Choose the views that see what a camera sees, from directions most like its own."""
    views = field.views
    alike: list[tuple[float, tuple[int, int]]] = []
    x, y = (np.floor((np.arange(_PROBES) + 0.5) * n / _PROBES).astype(np.int64) for n in (views.width, views.height))
    for row, column in np.ndindex(views.rows, views.columns):
        source = surfaces.of(row, column)
        angle = kernels.median_angle(source.camera, source.depth, target, size[0], size[1], x, y, np.empty(_PROBES**2))
        if angle < math.inf:
            alike.append((float(angle), (row, column)))
    return [view for _, view in sorted(alike)[:MOST_VIEWS]]


def _draw_surfaces(
    surfaces: ViewSurfaces, target: FloatArray, size: tuple[int, int], chosen: list[tuple[int, int]]
) -> FloatArray:
    """Draw the surfaces of views into a picture, without what some of them see through; see `kernels.draw_surface`."""
    surface = np.empty((*size, kernels.SURFACE))
    surface[...] = np.nan, 0.0, math.inf, math.inf
    false = np.zeros(size, dtype=np.bool_)
    for _ in range(_ROUNDS):
        for view in chosen:
            source = surfaces.of(*view)
            kernels.draw_surface(source.camera, source.depth, source.slopes, target, surface, np.empty((4, 3)))
        false[...] = False
        for view in chosen:
            source = surfaces.of(*view)
            kernels.find_false(source.camera, source.depth, source.slopes, target, surface, false)
        if not false.any():
            break
        surface[false, 3] = surface[false, 0]
        surface[false, :3] = np.nan, 0.0, math.inf
    return surface


def _blending_weights(best: FloatArray) -> FloatArray:
    """Compute the weights of the best views of each pixel, and their numbers: (height, width, k, 2).

    They fall to 0 at the last view, where there are as many (Buehler et al., sec. 4).
    """
    penalty = best[..., 0]
    last = penalty[..., -1:]
    # Where all are as good, as of the sky by views that look the same way, none is the last.
    is_falling = np.isfinite(last) & (last > penalty[..., :1])
    falling = 1.0 - np.where(is_falling, penalty, 0.0) / np.where(is_falling, last, 1.0)
    weight = np.divide(falling, penalty, out=np.zeros(penalty.shape), where=np.isfinite(penalty) & (penalty > 0.0))
    # A ray that a view has itself is taken from that view alone.
    own = penalty == 0.0
    weight = np.where(own.any(axis=-1, keepdims=True), own, weight)
    total = weight.sum(axis=-1, keepdims=True)
    weight = np.divide(weight, total, out=np.zeros(weight.shape), where=total > 0.0)
    return np.asarray(np.stack([weight, best[..., 1]], axis=-1))
