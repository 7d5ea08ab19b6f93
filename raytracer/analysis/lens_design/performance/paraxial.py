"""Rays in the limit of small heights and angles, in either meridian of a lens.

References: Welford 1986, "Aberrations of Optical Systems", ch. 3.
"""

from typing import NamedTuple

import numpy as np

from raytracer.lens_report.analysis.bench import MERIDIANS, Bench
from raytracer.lens_report.analysis.results import Curve
from raytracer.lenses.surfaces import LensSurfaces


class ParaxialRay(NamedTuple):
    """heights (n,) at the surfaces (mm); slopes (n + 1,) before the first and behind each, dy/dz."""

    heights: Curve
    slopes: Curve

    def plus(self, other: "ParaxialRay", factor: float) -> "ParaxialRay":
        """This ray with another one added, times a factor: the equations are linear."""
        return ParaxialRay(self.heights + factor * other.heights, self.slopes + factor * other.slopes)

    def times(self, factor: float) -> "ParaxialRay":
        """All of it times a factor."""
        return ParaxialRay(factor * self.heights, factor * self.slopes)


def vertex_curvatures(surfaces: LensSurfaces, meridian: str) -> Curve:
    """Of the surfaces at the axis (1/mm), in a meridian: (n,)."""
    found: Curve = surfaces.curvature if surfaces.shapes is None else surfaces.shapes.quadric[:, MERIDIANS[meridian]]
    return found


def paraxial_ray(surfaces: LensSurfaces, height: float, slope: float, meridian: str = "y") -> ParaxialRay:
    """The ray that has a height (mm) at the front vertex and a slope before it."""
    curvature, ior = vertex_curvatures(surfaces, meridian), surfaces.ior
    ways = np.diff(surfaces.vertex)
    heights, slopes = [height], [slope]
    for surface, power in enumerate(curvature * np.diff(ior)):
        slopes.append((ior[surface] * slopes[-1] - heights[-1] * power) / ior[surface + 1])
        if surface < len(ways):
            heights.append(heights[-1] + ways[surface] * slopes[-1])
    return ParaxialRay(np.array(heights), np.array(slopes))


def marginal_ray(
    bench: Bench, surfaces: LensSurfaces, meridian: str = "y", distance: float | None = None
) -> ParaxialRay:
    """From the point on the axis that is focused on, or one at a distance from the pupil (mm), to the stop's rim."""
    away = bench.distance if distance is None else distance
    front = away - bench.pupil + surfaces.vertex[0]
    ray = paraxial_ray(surfaces, 1.0, 0.0 if np.isinf(away) else 1.0 / front, meridian)
    return ray.times(bench.stop_radius / ray.heights[bench.stop])


def chief_ray(bench: Bench, surfaces: LensSurfaces, meridian: str = "y") -> ParaxialRay:
    """With slope -1 before the lens, as from a field above the axis, through the centre of the stop."""
    parallel, tilted = paraxial_ray(surfaces, 1.0, 0.0, meridian), paraxial_ray(surfaces, 0.0, -1.0, meridian)
    return tilted.plus(parallel, -tilted.heights[bench.stop] / parallel.heights[bench.stop])


def crossing(surfaces: LensSurfaces, ray: ParaxialRay) -> float:
    """Where a ray meets the axis behind the lens (z in mm); inf if it is parallel to it."""
    if ray.slopes[-1] == 0.0:
        return float("inf")
    return float(surfaces.vertex[-1] - ray.heights[-1] / ray.slopes[-1])
