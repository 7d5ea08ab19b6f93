"""Cross-section of a lens: glass, stop, film, fans of traced rays, and the cardinal points.

A drawing is geometry in millimetres, (z, height) with the scene on the left; surfaces are cubic curves through exact
points and slopes.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from raytracer.analysis.lens_design.cross_section.outlines import (
    FloatArray,
    Outline,
    Piece,
    Point,
    SectionAxis,
    glass_outline,
    surface_outline,
    surface_sag,
)
from raytracer.analysis.lens_design.performance.lens_study import LensStudy
from raytracer.analysis.lens_design.performance.optical_bench import OpticalBench, set_up_bench
from raytracer.analysis.lens_design.performance.results import FirstOrder
from raytracer.optics.lens_system.lens import Lens
from raytracer.optics.lens_system.ray_tracing import trace_paths
from raytracer.optics.lens_system.surfaces import LensSurfaces

# Image heights whose light is drawn, as parts of the largest field.
_FIELDS = (0.0, 0.7, 1.0)

# Parts of these that are tried in turn where no light gets through.
_LIT_PARTS = (1.0, 0.98, 0.95, 0.9)

# Greatest height to which rays behind the lens are drawn, as a part of that of all else.
_RAY_REACH = 1.3


class DrawnRay(NamedTuple):
    """Ray of a drawing.

    points : (z, height) (mm), (n, 2).
    field : number of its fan, from 0.
    """

    points: FloatArray
    field: int


class AxisMark(NamedTuple):
    """Named point of the axis (mm)."""

    z: float
    name: str
    title: str


@dataclass(frozen=True)
class CrossSection:
    """Cross-section of a lens as geometry (mm).

    outlines : of glass.
    bare : surfaces without glass.
    stops : z, radius of the opening, outer radius.
    rays : of all fans.
    fields : description of each fan, for the legend.
    marks : named points of the axis in the picture.
    outside : marks too far off to be in the picture.
    film : z, half its height.
    low, high : corners of the picture.
    """

    title: str
    outlines: tuple[Outline, ...]
    bare: tuple[tuple[Point, tuple[Piece, ...]], ...]
    stops: tuple[tuple[float, float, float], ...]
    rays: tuple[DrawnRay, ...]
    fields: tuple[str, ...]
    marks: tuple[AxisMark, ...]
    outside: tuple[AxisMark, ...]
    film: tuple[float, float]
    low: Point
    high: Point


def build_cross_section(
    lens: Lens,
    surfaces: LensSurfaces,
    film: tuple[float, float],
    heights: Sequence[float],
    *,
    object_z: float = -math.inf,
    axis: SectionAxis = "y",
    marks: Sequence[AxisMark] = (),
    wavelength: float | None = None,
) -> CrossSection:
    """Build the cross-section of a lens.

    Parameters
    ----------
    surfaces : `lens` packed as it is set: stop, focus.
    film : its place (mm from the front vertex), and half its height in this plane (mm).
    heights : in the image (mm, 0 or more) whose light is drawn.
    object_z : place of the object (mm, negative), may be infinite.
    axis : of the plane of the cross-section.
    marks : named points of the axis.
    wavelength : of the rays (nm); the d line by default.
    """
    outlines, bare, stops = _outline_elements(lens, surfaces, axis)
    rays, fields = [], []
    for number, height in enumerate(heights):
        # A point above the axis has its image below it.  At the very end of the field no light may be left.
        for part in _LIT_PARTS:
            traced = trace_fan(surfaces, film[0], -part * height, object_z=object_z, axis=axis, wavelength=wavelength)
            if traced is not None:
                points_of_rays, angle = traced
                fields.append(f"{abs(angle):.3g}° ({part * height:.3g} mm on the film)")
                rays += [DrawnRay(points, number) for points in points_of_rays]
                break

    corners = [np.array([[float(surfaces.vertex[0]), 0.0], film, [film[0], -film[1]]])]
    corners += [np.array([[o.start[0], o.start[1]], *(p.end for p in o.pieces)]) for o in outlines]
    corners += [np.array([[z, outer], [z, -outer]]) for z, _, outer in stops]
    # A few stray rays behind the lens must not make all else small.
    limit = _RAY_REACH * float(np.abs(np.concatenate(corners)[:, 1]).max())
    rays = [ray._replace(points=clip_ray(ray.points, limit)) for ray in rays]
    every = np.concatenate([*corners, *(ray.points for ray in rays)])
    low, high = every.min(axis=0), every.max(axis=0)
    margin = 0.02 * (high[0] - low[0])
    inside = tuple(mark for mark in marks if low[0] - margin <= mark.z <= high[0] + margin)
    return CrossSection(
        title=f"{lens.name}, cross-section" if lens.is_round() else f"{lens.name}, in the plane of {axis}",
        outlines=tuple(outlines),
        bare=tuple(bare),
        stops=tuple(stops),
        rays=tuple(rays),
        fields=tuple(fields),
        marks=inside,
        outside=tuple(mark for mark in marks if math.isfinite(mark.z) and mark not in inside),
        film=film,
        low=(float(low[0] - margin), float(low[1] - margin)),
        high=(float(high[0] + margin), float(high[1] + margin)),
    )


_Elements = tuple[list[Outline], list[tuple[Point, tuple[Piece, ...]]], list[tuple[float, float, float]]]


def _outline_elements(lens: Lens, surfaces: LensSurfaces, axis: SectionAxis) -> _Elements:
    """Outline the glass of a lens, its surfaces without glass, and its stop: z, radius of the opening, outer radius."""
    elements, vertex = lens.elements, [float(v) for v in surfaces.vertex]
    outlines, bare, stops = [], [], []
    for number, (one, place) in enumerate(zip(elements, vertex, strict=True)):
        is_glass = float(one.glass.ior()) != 1.0
        before = number > 0 and float(elements[number - 1].glass.ior()) != 1.0
        if is_glass and number + 1 < len(elements):
            outlines.append(glass_outline(one, elements[number + 1], (place, vertex[number + 1]), axis))
        if number == surfaces.stop:
            open_to = float(surfaces.radius[number])
            # Of glass that is its own stop it is the rim.
            rim = place + surface_sag(one, open_to, axis)
            stops.append((rim, open_to, max(1.15 * one.radius, open_to + 0.25 * one.radius)))
        elif not is_glass and not before:
            bare.append(surface_outline(one, place, one.radius, axis))
    return outlines, bare, stops


def cross_sections(lens: Lens, study: LensStudy) -> tuple[CrossSection, ...]:
    """Draw the cross-sections of a lens, set up as for a study, with the cardinal points: two if it has cylinders."""
    bench = set_up_bench(lens, study.settings)
    return tuple(_cross_section(bench, first) for first in study.first_order)


def _cross_section(bench: OpticalBench, first: FirstOrder) -> CrossSection:
    """Draw the cross-section in one meridian."""
    marks = (
        AxisMark(first.front_focus_z_mm, "F", "front focal point"),
        AxisMark(first.rear_focus_z_mm, "F′", "rear focal point"),
        AxisMark(first.front_principal_z_mm, "H", "front principal point, and nodal point"),
        AxisMark(first.rear_principal_z_mm, "H′", "rear principal point, and nodal point"),
        AxisMark(first.entrance_pupil_z_mm, "entrance pupil", "entrance pupil"),
        AxisMark(first.exit_pupil_z_mm, "exit pupil", "exit pupil"),
    )
    largest = first.half_field_image_height_mm
    heights = [part * largest for part in _FIELDS] if math.isfinite(largest) else [0.0]
    return build_cross_section(
        bench.lens,
        bench.surfaces(),
        (bench.film, max(heights)),
        heights,
        object_z=bench.pupil - bench.distance,
        axis="x" if first.meridian == "x" else "y",
        marks=marks,
        wavelength=bench.primary,
    )


def stack_labels(drawing: CrossSection, scale: float, letters: float) -> tuple[list[tuple[AxisMark, float, int]], int]:
    """Place the names of marks under the drawing so that none covers another.

    scale : of the drawing: points per millimetre.
    letters : their size (pt).

    Returns
    -------
    Marks with x (pt) and row of their names, and the number of rows.
    """
    placed: list[tuple[AxisMark, float, int]] = []
    ends: list[float] = []
    for mark in sorted(drawing.marks):
        x = scale * (mark.z - drawing.low[0])
        half = 0.5 * 0.6 * letters * len(mark.name) + 0.25 * letters
        row = next((n for n, end in enumerate(ends) if x - half > end), len(ends))
        ends[row : row + 1] = [x + half]
        placed.append((mark, x, row))
    return placed, len(ends)


# ---- Fans of rays, from one point of the scene to the film

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
) -> tuple[FloatArray, float] | None:
    """Trace the rays of one point of the scene, whose image is at a height of the film (mm; upwards in the drawing).

    The ray from the film through the middle of the stop finds that point; rays from it are then traced, and of those
    that get through a few are chosen at equal distances.

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
    chosen = chosen[np.unique(np.linspace(0, chosen.size - 1, _DRAWN).round().astype(int))]
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
