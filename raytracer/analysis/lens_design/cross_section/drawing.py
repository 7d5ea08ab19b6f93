"""Cross-section of a lens: glass, stop, film, fans of traced rays, and the cardinal points.

A drawing is geometry in millimetres, (z, height) with the scene on the left; surfaces are cubic curves through exact
points and slopes.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from raytracer.analysis.lens_design.cross_section.fans import clip_ray, trace_fan
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


class SectionSetup(NamedTuple):
    """Contents of a cross-section besides the glass.

    film : place of the film (mm from the front vertex).
    half_film : half the film's height in this plane (mm).
    heights : in the image (mm, 0 or more) whose light is drawn.
    object_z : place of the object (mm, negative), may be infinite.
    axis : of the plane of the cross-section.
    marks : places on the axis (mm) and what they are, by the names that are drawn.
    wavelength : of the rays (nm); the d line by default.
    """

    film: float
    half_film: float
    heights: Sequence[float]
    object_z: float = -math.inf
    axis: SectionAxis = "y"
    marks: Mapping[str, tuple[float, str]] | None = None
    wavelength: float | None = None


def build_cross_section(lens: Lens, surfaces: LensSurfaces, setup: SectionSetup) -> CrossSection:
    """Build the cross-section of a lens.

    surfaces : `lens` packed as it is set: stop, focus.
    """
    outlines, bare, stops = _outline_elements(lens, surfaces, setup.axis)
    rays, fields = _trace_fields(surfaces, setup)

    film, half_film = setup.film, setup.half_film
    corners = [np.array([[float(surfaces.vertex[0]), 0.0], [film, half_film], [film, -half_film]])]
    corners += [np.array([[o.start[0], o.start[1]], *(p.end for p in o.pieces)]) for o in outlines]
    corners += [np.array([[z, outer], [z, -outer]]) for z, _, outer in stops]
    # A few stray rays behind the lens must not make all else small.
    limit = _RAY_REACH * float(np.abs(np.concatenate(corners)[:, 1]).max())
    rays = [ray._replace(points=clip_ray(ray.points, limit)) for ray in rays]
    every = np.concatenate([*corners, *(ray.points for ray in rays)])
    low, high = every.min(axis=0), every.max(axis=0)
    margin = 0.02 * (high[0] - low[0])
    marks = [AxisMark(z, name, title) for name, (z, title) in (setup.marks or {}).items() if math.isfinite(z)]
    inside = [mark for mark in marks if low[0] - margin <= mark.z <= high[0] + margin]
    is_round = lens.is_round()
    return CrossSection(
        title=f"{lens.name}, cross-section" if is_round else f"{lens.name}, in the plane of {setup.axis}",
        outlines=tuple(outlines),
        bare=tuple(bare),
        stops=tuple(stops),
        rays=tuple(rays),
        fields=tuple(fields),
        marks=tuple(inside),
        outside=tuple(mark for mark in marks if mark not in inside),
        film=(film, half_film),
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


def _trace_fields(surfaces: LensSurfaces, setup: SectionSetup) -> tuple[list[DrawnRay], list[str]]:
    """Trace a fan of rays for each height in the image, and describe its field."""
    rays, fields = [], []
    for number, height in enumerate(setup.heights):
        # A point above the axis has its image below it.  At the very end of the field no light may be left.
        for part in _LIT_PARTS:
            traced = trace_fan(
                surfaces,
                setup.film,
                -part * height,
                object_z=setup.object_z,
                axis=setup.axis,
                wavelength=setup.wavelength,
            )
            if traced is not None:
                points_of_rays, angle = traced
                fields.append(f"{abs(angle):.3g}° ({part * height:.3g} mm on the film)")
                rays += [DrawnRay(points, number) for points in points_of_rays]
                break
    return rays, fields


def cross_sections(lens: Lens, study: LensStudy) -> tuple[CrossSection, ...]:
    """Draw the cross-sections of a lens, set up as for a study: one, or two of a lens with cylinders."""
    bench = set_up_bench(lens, study.settings)
    return tuple(_cross_section(bench, first) for first in study.first_order)


def _cross_section(bench: OpticalBench, first: FirstOrder) -> CrossSection:
    """Draw the cross-section in one meridian, with the cardinal points."""
    axis: SectionAxis = "x" if first.meridian == "x" else "y"
    marks = {
        "F": (first.front_focus_z_mm, "front focal point"),
        "F′": (first.rear_focus_z_mm, "rear focal point"),
        "H": (first.front_principal_z_mm, "front principal point, and nodal point"),
        "H′": (first.rear_principal_z_mm, "rear principal point, and nodal point"),
        "entrance pupil": (first.entrance_pupil_z_mm, "entrance pupil"),
        "exit pupil": (first.exit_pupil_z_mm, "exit pupil"),
    }
    largest = first.half_field_image_height_mm
    heights = [part * largest for part in _FIELDS] if math.isfinite(largest) else [0.0]
    setup = SectionSetup(
        bench.film,
        max(heights),
        heights,
        object_z=bench.pupil - bench.distance,
        axis=axis,
        marks=marks,
        wavelength=bench.primary,
    )
    return build_cross_section(bench.lens, bench.surfaces(), setup)


def stack_labels(
    drawing: CrossSection, scale: float, margin: float, letters: float = 12.0
) -> tuple[list[tuple[AxisMark, float, int]], int]:
    """Place the names of marks under the drawing so that none covers another.

    Parameters
    ----------
    scale, margin : of the drawing: points or pixels per millimetre, and from its left edge.
    letters : their size, in the same unit.

    Returns
    -------
    Marks with x and row of their names, and the number of rows.
    """
    placed: list[tuple[AxisMark, float, int]] = []
    ends: list[float] = []
    for mark in sorted(drawing.marks):
        x = margin + scale * (mark.z - drawing.low[0])
        half = 0.5 * 0.6 * letters * len(mark.name) + 0.25 * letters
        row = next((n for n, end in enumerate(ends) if x - half > end), len(ends))
        ends[row : row + 1] = [x + half]
        placed.append((mark, x, row))
    return placed, len(ends)
