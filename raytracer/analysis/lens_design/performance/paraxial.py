"""Paraxial rays: the limit of small heights and angles, in either meridian of a lens.

References: Welford 1986, "Aberrations of Optical Systems", ch. 3.
"""

from typing import NamedTuple

import numpy as np

from raytracer.analysis.lens_design.performance.optical_bench import MERIDIANS, OpticalBench
from raytracer.analysis.lens_design.performance.results import Curve
from raytracer.optics.lens_system.surfaces import LensSurfaces


class ParaxialRay(NamedTuple):
    """Paraxial ray.

    heights : at the surfaces (mm), (n,).
    slopes : dy/dz before the first surface and behind each, (n + 1,).
    """

    heights: Curve
    slopes: Curve

    def plus(self, other: "ParaxialRay", factor: float) -> "ParaxialRay":
        """Add another ray, times a factor: the equations are linear."""
        return ParaxialRay(self.heights + factor * other.heights, self.slopes + factor * other.slopes)

    def times(self, factor: float) -> "ParaxialRay":
        """Multiply heights and slopes by a factor."""
        return ParaxialRay(factor * self.heights, factor * self.slopes)


def vertex_curvatures(surfaces: LensSurfaces, meridian: str) -> Curve:
    """Return the curvatures of the surfaces at the axis (1/mm), in a meridian: (n,)."""
    if surfaces.shapes is None:
        return surfaces.curvature
    curvatures: Curve = surfaces.shapes.quadric[:, MERIDIANS[meridian]]
    return curvatures


def paraxial_ray(surfaces: LensSurfaces, height: float, slope: float, meridian: str = "y") -> ParaxialRay:
    """Trace the ray that has a height (mm) at the front vertex and a slope before it."""
    curvature, ior = vertex_curvatures(surfaces, meridian), surfaces.ior
    ways = np.diff(surfaces.vertex)
    heights, slopes = [height], [slope]
    for surface, power in enumerate(curvature * np.diff(ior)):
        slopes.append((ior[surface] * slopes[-1] - heights[-1] * power) / ior[surface + 1])
        if surface < len(ways):
            heights.append(heights[-1] + ways[surface] * slopes[-1])
    return ParaxialRay(np.array(heights), np.array(slopes))


def marginal_ray(
    bench: OpticalBench, surfaces: LensSurfaces, meridian: str = "y", distance: float | None = None
) -> ParaxialRay:
    """Trace the ray to the stop's rim from the axis, where the lens is focused or at a distance from the pupil (mm)."""
    away = bench.distance if distance is None else distance
    front = away - bench.pupil + surfaces.vertex[0]
    ray = paraxial_ray(surfaces, 1.0, 0.0 if np.isinf(away) else 1.0 / front, meridian)
    return ray.times(bench.stop_radius / ray.heights[bench.stop])


def chief_ray(bench: OpticalBench, surfaces: LensSurfaces, meridian: str = "y") -> ParaxialRay:
    """Trace the ray through the centre of the stop with slope -1 before the lens, as from a field above the axis."""
    parallel, tilted = paraxial_ray(surfaces, 1.0, 0.0, meridian), paraxial_ray(surfaces, 0.0, -1.0, meridian)
    return tilted.plus(parallel, -tilted.heights[bench.stop] / parallel.heights[bench.stop])


def crossing(surfaces: LensSurfaces, ray: ParaxialRay) -> float:
    """Return the place at which a ray crosses the axis behind the lens (z in mm); inf if it is parallel to it."""
    if ray.slopes[-1] == 0.0:
        return float("inf")
    return float(surfaces.vertex[-1] - ray.heights[-1] / ray.slopes[-1])
