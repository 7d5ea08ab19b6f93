"""Optical bench: a lens that is stopped down and focused, with a film behind it, for rays of any wavelength."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np

from raytracer.analysis.lens_design.performance.results import Curve, Settings
from raytracer.optics.lens_system.first_order import cardinal_points, entrance_pupil
from raytracer.optics.lens_system.focusing import focus_lens
from raytracer.optics.lens_system.lens import Lens
from raytracer.optics.lens_system.lens_setup import stop_radius_for
from raytracer.optics.lens_system.surfaces import LensSurfaces

T = TypeVar("T")

MERIDIANS = {"y": 1, "x": 0}
"""Coordinate of a point that lies along the field, by the meridian's name."""


@dataclass(frozen=True)
class OpticalBench:
    """Lens on an optical bench.

    lens : stopped down and focused.
    settings : of the study.
    stop : index of the surface that is the diaphragm or acts as one.
    stop_radius : (mm).
    film : place on the axis (mm).
    pupil : place of the paraxial entrance pupil of the primary colour (mm), from which distances in the scene count.
    """

    lens: Lens
    settings: Settings
    stop: int
    stop_radius: float
    film: float
    pupil: float
    _memo: dict[Any, Any] = field(default_factory=dict, repr=False, compare=False)

    @property
    def primary(self) -> float:
        """Wavelength (nm) of results in one colour."""
        return self.settings.wavelengths_nm[0]

    @property
    def meridians(self) -> tuple[str, ...]:
        """Planes through the axis that differ: y, and x if there are cylinders in the lens."""
        return ("y",) if self.lens.is_round() else ("y", "x")

    @property
    def distance(self) -> float:
        """Distance of the plane that is focused on, from the entrance pupil (mm); may be infinite."""
        return self.settings.focus_distance_mm

    def at_infinity(self) -> "OpticalBench":
        """Return the same lens and film, for an object that is infinitely far."""
        far = self.settings._replace(focus_distance_mm=math.inf)
        return self.memoize("far", lambda: replace(self, settings=far, _memo={}))

    def memoize(self, key: Any, make: Callable[[], T]) -> T:
        """Return the result of `make`, computed once for a key."""
        if key not in self._memo:
            self._memo[key] = make()
        return cast(T, self._memo[key])

    def surfaces(self, wavelength_nm: float | None = None) -> LensSurfaces:
        """Pack the lens for a wavelength (nm), the primary one by default."""
        chosen = self.primary if wavelength_nm is None else wavelength_nm
        return self.memoize(("surfaces", chosen), lambda: self.lens.packed(chosen))

    def without_rims(self, wavelength_nm: float | None = None) -> LensSurfaces:
        """Pack the lens with no rims but those of the stop, and of aspheres, which are not defined farther out."""
        surfaces = self.surfaces(wavelength_nm)
        radius = np.full_like(surfaces.radius, np.inf)
        if surfaces.shapes is not None:
            radius[surfaces.shapes.aspheric] = surfaces.radius[surfaces.shapes.aspheric]
        radius[self.stop] = surfaces.radius[self.stop]
        return surfaces._replace(radius=radius)

    def marginal_ray(self, surfaces: LensSurfaces, meridian: str = "y", distance: float | None = None) -> "ParaxialRay":
        """Trace the paraxial ray to the stop's rim from the axis, at the focus or at a distance from the pupil (mm)."""
        away = self.distance if distance is None else distance
        front = away - self.pupil + surfaces.vertex[0]
        ray = paraxial_ray(surfaces, 1.0, 0.0 if np.isinf(away) else 1.0 / front, meridian)
        return ray.times(self.stop_radius / ray.heights[self.stop])

    def chief_ray(self, surfaces: LensSurfaces, meridian: str = "y") -> "ParaxialRay":
        """Trace the paraxial ray through the centre of the stop with slope -1, as from a field above the axis."""
        parallel, tilted = paraxial_ray(surfaces, 1.0, 0.0, meridian), paraxial_ray(surfaces, 0.0, -1.0, meridian)
        return tilted.plus(parallel, -tilted.heights[self.stop] / parallel.heights[self.stop])


def set_up_bench(lens: Lens, settings: Settings | None = None) -> OpticalBench:
    """Stop a lens down, focus it, and put a film behind it.

    Raises
    ------
    ValueError : the f-number or the focus distance is not possible (the message gives the range); or the lens makes no
        image, or an upright one.
    """
    chosen = settings or Settings()
    if not chosen.wavelengths_nm:
        raise ValueError("a lens is looked at in at least one wavelength")
    stop = lens.stop()
    radius = lens.elements[stop].radius
    if chosen.f_number is not None:
        radius = stop_radius_for(lens, chosen.f_number)
    ready, film = focus_lens(lens.stopped_down(radius), chosen.focus_distance_mm)
    for across in ("y", "x"):
        if cardinal_points(ready.packed(chosen.wavelengths_nm[0]), across).focal_length < 0.0:
            raise ValueError(
                "the lens has an image inside it, and so makes an upright one: such lenses are not studied"
            )
    pupil = entrance_pupil(ready.packed(chosen.wavelengths_nm[0]))
    return OpticalBench(ready, chosen, stop, radius, film, pupil.z)


# ---- Rays


def normalize(rows: Any) -> Curve:
    """Scale vectors (..., 3) to length 1."""
    given = np.asarray(rows, np.float64)
    unit: Curve = given / np.linalg.norm(given, axis=-1, keepdims=True)
    return unit


def intersect_film(points: Curve, directions: Curve, weights: Curve, z: float) -> Curve:
    """Intersect rays behind the lens with the plane at z: (n, 2), NaN for those that do not meet it."""
    with np.errstate(divide="ignore", invalid="ignore"):
        way = (z - points[:, 2]) / directions[:, 2]
        landed: Curve = points[:, :2] + way[:, None] * directions[:, :2]
    landed[~((weights > 0.0) & (directions[:, 2] > 0.0))] = np.nan
    return landed


def meridian_vector(meridian: str, across: Any, height: Any, depth: Any) -> Curve:
    """Make vectors (..., 3) from components across and along the field's direction, and along the axis."""
    columns = (across, height, depth) if meridian == "y" else (height, across, depth)
    vectors: Curve = np.stack(np.broadcast_arrays(*(np.asarray(column, np.float64) for column in columns)), axis=-1)
    return vectors


# ---- Paraxial rays: the limit of small heights and angles; Welford 1986, "Aberrations of Optical Systems", ch. 3


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


def crossing(surfaces: LensSurfaces, ray: ParaxialRay) -> float:
    """Return the place at which a ray crosses the axis behind the lens (z in mm); inf if it is parallel to it."""
    if ray.slopes[-1] == 0.0:
        return float("inf")
    return float(surfaces.vertex[-1] - ray.heights[-1] / ray.slopes[-1])
