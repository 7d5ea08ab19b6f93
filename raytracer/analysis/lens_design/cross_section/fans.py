"""Fans of rays through a lens, from one point of the scene to the film."""

import math

import numpy as np

from raytracer.analysis.lens_design.cross_section.outlines import FloatArray, SectionAxis
from raytracer.optics.lens_system.ray_tracing import trace_paths
from raytracer.optics.lens_system.surfaces import LensSurfaces

# Rays that are traced to find those that get through, and those of them that are drawn.
_TRIED = 801
_DRAWN = 7

# Length of a ray before the lens, as a part of the lens's length.
_BEFORE = 0.35


def trace_fan(
    surfaces: LensSurfaces,
    film: float,
    height: float,
    *,
    object_z: float = -math.inf,
    axis: SectionAxis = "y",
    wavelength: float | None = None,
    count: int = _DRAWN,
) -> tuple[FloatArray, float] | None:
    """Trace the rays of one point of the scene, whose image is at a height of the film (mm; upwards in the drawing).

    The ray from the film through the middle of the stop finds that point; rays from it are then traced, and of those
    that get through `count` are chosen at equal distances.

    Parameters
    ----------
    film : its place (mm).
    object_z : place of the point (mm, before the lens); its light is parallel if it is infinite.
    axis : of the plane of the cross-section.

    Returns
    -------
    Points (rays, surfaces + 2, 2), (z, height), from before the lens to the film; the point's angle from the axis
    (degrees, above 0 if it is below it).  None if no light gets there.
    """
    column = 0 if axis == "x" else 1
    last = float(surfaces.vertex[-1])

    def spread(values: tuple[FloatArray | float, FloatArray | float]) -> FloatArray:
        """Convert (height, z) to points of space."""
        rows = np.zeros((max(np.size(values[0]), np.size(values[1])), 3))
        rows[:, column], rows[:, 2] = values
        return rows

    # Find the chief ray, from the film to the scene.
    tried = np.linspace(-1.0, 1.0, _TRIED) * float(surfaces.radius[-1])
    ways = spread((tried - height, last - film))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    weights, points, onward = trace_paths(surfaces, spread((height, film)).repeat(_TRIED, 0), ways, False, wavelength)
    through = weights > 0.0
    if through.sum() < 2:
        return None
    points, onward = points[through], onward[through]
    stop = max(surfaces.stop, 0)
    chief = int(np.argmin(np.abs(points[:, stop, column])))
    towards = onward[chief, 0][[2, column]]
    at = points[chief, 0][[2, column]]
    angle = math.degrees(math.atan2(towards[1], -towards[0]))

    # Trace rays from there through all of the front that they may fill.
    normal = np.array([-towards[1], towards[0]])
    offsets = (points[:, 0][:, [2, column]] - at) @ normal
    margin = 0.6 * (offsets.max() - offsets.min()) + 1e-3 * float(surfaces.radius[0])
    offsets = np.linspace(offsets.min() - margin, offsets.max() + margin, _TRIED)
    aims = at + offsets[:, None] * normal
    length = float(surfaces.vertex[-1] - surfaces.vertex[0]) + abs(film - last)
    if math.isinf(object_z):
        starts = aims + _BEFORE * length * towards
        directions = np.broadcast_to(-towards, starts.shape)
    else:
        place = at + (object_z - at[0]) / towards[0] * towards
        directions = aims - place
        directions = directions / np.linalg.norm(directions, axis=1)[:, None]
        away = min(_BEFORE * length, float(np.linalg.norm(place - at)))
        starts = aims - away * directions
    weights, points, onward = trace_paths(
        surfaces, spread((starts[:, 1], starts[:, 0])), spread((directions[:, 1], directions[:, 0])), True, wavelength
    )
    chosen = np.flatnonzero(weights > 0.0)
    if chosen.size == 0:
        return None
    chosen = chosen[np.unique(np.linspace(0, chosen.size - 1, count).round().astype(int))]
    met, leaving = points[chosen][:, :, [2, column]], onward[chosen, -1][:, [2, column]]
    reached = met[:, -1] + ((film - met[:, -1, 0]) / leaving[:, 0])[:, None] * leaving
    return np.concatenate([starts[chosen][:, None], met, reached[:, None]], axis=1), angle


def clip_ray(points: FloatArray, limit: float) -> FloatArray:
    """End the last straight piece of a ray at a height, if it goes beyond."""
    (z, height), (last_z, last) = points[-2:]
    if abs(last) <= limit or abs(height) >= limit:
        return points
    part = (math.copysign(limit, last) - height) / (last - height)
    ended = points.copy()
    ended[-1] = z + part * (last_z - z), height + part * (last - height)
    return ended
