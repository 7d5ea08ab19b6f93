"""A lens set up to be looked at: stopped down, focused, with a film behind it and rays through it by colour."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar, cast

import numpy as np

from raytracer.lens_report.analysis.results import Curve, Settings
from raytracer.lenses.first_order import cardinal_points, entrance_pupil
from raytracer.lenses.focusing import focused
from raytracer.lenses.lens import Lens
from raytracer.lenses.stops import stop_radius_for
from raytracer.lenses.surfaces import LensSurfaces, part, trace_rays

T = TypeVar("T")

MERIDIANS = {"y": 1, "x": 0}
"""Which coordinate of a point lies along the field, by the meridian's name."""


@dataclass(frozen=True)
class Bench:
    """A lens on the bench.

    lens, settings : what is looked at, stopped down and focused, and how.
    stop : which surface is the diaphragm or acts as one; stop_radius (mm).
    film : its place on the axis (mm).
    pupil : place of the paraxial entrance pupil of the primary colour (mm), from which distances in the scene count.
    """

    lens: Lens
    settings: Settings
    stop: int
    stop_radius: float
    film: float
    pupil: float
    _kept: dict[Any, Any] = field(default_factory=dict, repr=False, compare=False)

    @property
    def primary(self) -> float:
        """The wavelength (nm) of results in one colour."""
        return self.settings.wavelengths_nm[0]

    @property
    def meridians(self) -> tuple[str, ...]:
        """The planes through the axis that differ: y, and x if there are cylinders in the lens."""
        return ("y",) if self.lens.is_round() else ("y", "x")

    @property
    def distance(self) -> float:
        """Of the plane that is focused on, from the entrance pupil (mm); may be infinite."""
        return self.settings.focus_distance_mm

    def at_infinity(self) -> "Bench":
        """The same lens and film, for an object that is infinitely far."""
        far = self.settings._replace(focus_distance_mm=math.inf)
        return self.kept("far", lambda: replace(self, settings=far, _kept={}))

    def kept(self, key: Any, make: Callable[[], T]) -> T:
        """What `make` gives, made once for a key."""
        if key not in self._kept:
            self._kept[key] = make()
        return cast(T, self._kept[key])

    def surfaces(self, wavelength_nm: float | None = None) -> LensSurfaces:
        """The lens at a wavelength (nm), the primary one by default."""
        chosen = self.primary if wavelength_nm is None else wavelength_nm
        return self.kept(("surfaces", chosen), lambda: self.lens.packed(chosen))

    def wide(self, wavelength_nm: float | None = None) -> LensSurfaces:
        """The same with no rim that blocks but that of the stop, and of aspheres, which are nothing farther out."""
        surfaces = self.surfaces(wavelength_nm)
        radius = np.full_like(surfaces.radius, np.inf)
        if surfaces.shapes is not None:
            radius[surfaces.shapes.aspheric] = surfaces.radius[surfaces.shapes.aspheric]
        radius[self.stop] = surfaces.radius[self.stop]
        return surfaces._replace(radius=radius)


def bench_of(lens: Lens, settings: Settings | None = None) -> Bench:
    """Set a lens up.

    Raises
    ------
    ValueError : the f-number or the focus distance is not possible, and it says what is; or the lens makes no image, or
        an upright one.
    """
    chosen = settings or Settings()
    if not chosen.wavelengths_nm:
        raise ValueError("a lens is looked at in at least one wavelength")
    stop = lens.stop()
    radius = lens.elements[stop].radius
    if chosen.f_number is not None:
        radius = stop_radius_for(lens, chosen.f_number)
    ready, film = focused(lens.stopped(radius), chosen.focus_distance_mm)
    for across in ("y", "x"):
        if cardinal_points(ready.packed(chosen.wavelengths_nm[0]), across).focal_length < 0.0:
            raise ValueError(
                "the lens has an image inside it, and so makes an upright one: such lenses are not studied"
            )
    pupil = entrance_pupil(ready.packed(chosen.wavelengths_nm[0]))
    return Bench(ready, chosen, stop, radius, film, pupil.z)


# ---- Rays


def unit(rows: Any) -> Curve:
    """Vectors (..., 3) made as long as 1."""
    given = np.asarray(rows, np.float64)
    made: Curve = given / np.linalg.norm(given, axis=-1, keepdims=True)
    return made


def landing(points: Curve, directions: Curve, weights: Curve, z: float) -> Curve:
    """Where rays behind the lens meet the plane at z: (n, 2), NaN for those that do not."""
    with np.errstate(divide="ignore", invalid="ignore"):
        way = (z - points[:, 2]) / directions[:, 2]
        landed: Curve = points[:, :2] + way[:, None] * directions[:, :2]
    landed[~((weights > 0.0) & (directions[:, 2] > 0.0))] = np.nan
    return landed


def out_to_scene(surfaces: LensSurfaces, first: int, origins: Curve, directions: Curve) -> tuple[Curve, Curve, Curve]:
    """Of rays that stand before surface `first` and go to the scene: weights, and their line before the lens."""
    if first == 0:
        return np.ones(len(origins)), origins, directions
    weights, points, onward = trace_rays(part(surfaces, 0, first), origins, directions, towards_film=False)
    return weights, points, onward


def along(meridian: str, across: Any, height: Any, depth: Any) -> Curve:
    """Vectors (..., 3) from their components across and along the field's direction, and along the axis."""
    columns = (across, height, depth) if meridian == "y" else (height, across, depth)
    made: Curve = np.stack(np.broadcast_arrays(*(np.asarray(column, np.float64) for column in columns)), axis=-1)
    return made
