"""Depth map of the page, by which a click focuses, and the range of distances of its slider."""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.field import LightField
from raytracer.lightfield.coverage import lit_view
from raytracer.lightfield.depth.depth_map import depth_map
from raytracer.lightfield.viewer.size_budget import resize_view
from raytracer.report import page as html
from raytracer.util.errors import InputError
from raytracer.util.progress import Update

# Pixels along the longer side: of the map in the page, and of the views from which it is estimated.
_MAP_SIZE = 256
_SEARCH_SIZE = 192
_MAP_CODES = 65_535

_OUTLIERS = 0.1
"""Percent of the distances at each end of the map that do not widen the range of focus."""

_RANGE_MARGIN = 0.05

_DISPARITY = 3.0
"""Pixels between neighbouring views that bound the range of focus where no distances are known."""


class ViewerDepth(NamedTuple):
    """Depth map of one view.

    inverse : one over the distance (1/m), (height, width); NaN where it is not known.
    at : place of the view (m), right and up.
    """

    inverse: NDArray[np.float64]
    at: tuple[float, float]

    @property
    def ends(self) -> tuple[float, float]:
        """Least and greatest one over the distance, without outliers."""
        known = self.inverse[np.isfinite(self.inverse)]
        low, high = np.percentile(known, (_OUTLIERS, 100.0 - _OUTLIERS))
        return float(low), float(high)


def viewer_depth(field: LightField, *, metric: bool, update: Update | None) -> ViewerDepth | None:
    """Get the depth of the middle view: from the layer `depth`, or estimated from the views; None if neither can be."""
    views = field.views
    middle = views.nearest()
    if metric and "depth" in field.layers:
        distance = np.asarray(field.layers["depth"][middle], dtype=np.float64)
        inverse = 1.0 / np.where(distance > 0.0, distance, np.nan)
    elif views.rows * views.columns > 1:
        return _estimate_depth(field, update)
    else:
        return None
    step = max(1, -(-max(inverse.shape) // _MAP_SIZE))
    inverse = inverse[step // 2 :: step, step // 2 :: step]
    right, up = (float(place) for place in views.position[middle])
    return ViewerDepth(inverse, (right, up)) if np.isfinite(inverse).any() else None


def _estimate_depth(field: LightField, update: Update | None) -> ViewerDepth | None:
    """Estimate the map from the views, made smaller: that takes less time, and has less noise; None if it fails."""
    views = field.views
    scale = min(1.0, _SEARCH_SIZE / max(views.width, views.height))
    width, height = max(1, round(scale * views.width)), max(1, round(scale * views.height))
    radiance = np.empty((views.rows, views.columns, height, width, 3), dtype=np.float32)
    for place in np.ndindex(views.rows, views.columns):
        radiance[place] = resize_view(lit_view(field, *place)[0], width, height)
    plane = views.plane._replace(pixel=views.plane.pixel * views.width / width)
    smaller = LightField(radiance, replace(views, plane=plane, width=width, height=height), settings=field.settings)
    try:
        depth = depth_map(smaller, update=update)
    except InputError:
        return None
    right, up = (float(place) for place in views.position[depth.row, depth.column])
    return ViewerDepth(depth.inverse, (right, up)) if np.isfinite(depth.inverse).any() else None


def encode_depth(depth: ViewerDepth) -> dict[str, Any]:
    """Encode the map in 16 bits: 0 where it is not known, then evenly from the lowest to the highest."""
    low, high = depth.ends
    height, width = depth.inverse.shape
    part = (np.clip(depth.inverse, low, high) - low) / (high - low or 1.0)
    codes = np.where(np.isnan(part), 0, 1 + np.rint(np.nan_to_num(part) * (_MAP_CODES - 1))).astype("<u2")
    values = html.data_uri(codes.tobytes(), "").partition(",")[2]
    return {"width": width, "height": height, "low": low, "high": high, "at": depth.at, "values": values}


def focus_range(
    field: LightField, depth: ViewerDepth | None, spacing: tuple[float, float], *, metric: bool
) -> tuple[float, float]:
    """Choose the range of focus: one over the farthest and the nearest distance."""
    views = field.views
    step = max(spacing)
    pixel = views.plane.pixel / step if step > 0.0 else max(views.inverse_focus, 1.0)
    if depth is None:
        low, high = views.inverse_focus - _DISPARITY * pixel, views.inverse_focus + _DISPARITY * pixel
    else:
        low, high = depth.ends
        margin = _RANGE_MARGIN * (high - low)
        # At least a pixel from view to view to each side, so that a flat object can be put out of focus.
        low, high = min(low - margin, views.inverse_focus - pixel), max(high + margin, views.inverse_focus + pixel)
    return (max(low, 0.0) if metric else low), high
