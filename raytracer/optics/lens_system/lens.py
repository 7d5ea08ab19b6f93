"""A lens: its surfaces in order, its focus and stop, and how it is packed for rays.

Lengths are millimetres, in the frame of `raytracer.optics.lens_system.surfaces`: z is the axis, from the scene to the
film, and the front vertex is at 0; x is to the right and y up as seen from behind the camera.
"""

import dataclasses
import itertools
import math
from collections.abc import Sequence
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raytracer.optics.glass import AIR, LINE_D, Glass
from raytracer.optics.lens_system.aspheres import SurfaceShapes
from raytracer.optics.lens_system.coatings import Coating, pack_coatings
from raytracer.optics.lens_system.first_order import paraxial_heights
from raytracer.optics.lens_system.surfaces import Indices, LensSurfaces

Kind: TypeAlias = Literal["flat", "stop", "spherical", "conic", "asphere", "cylindrical"]

# Places at which the sag of an asphere is sampled.
_PROFILE = 1025

FIRST_WAVELENGTH, LAST_WAVELENGTH, STEP = 380.0, 780.0, 0.5
"""Range and step of the table of indices of a lens that disperses (nm): those of the colour tables in `spectra`."""


# Places between the axis and the rim at which neighbours are tested for intersection, and the overlap that is allowed:
# tables give rims and thicknesses to a hundredth of a millimetre.
_CROSSING_STEPS = 33
_CROSSING_MM = 0.02


class Element(NamedTuple):
    """A surface of a lens.

    curvature (1/mm) : positive where the centre lies on the film's side.
    thickness (mm) : distance to the next vertex towards the film; of the last one to the film, and without effect.
    glass : the medium behind it, on the film's side.
    radius (mm) : half of the clear aperture.
    kind : as in lens files.
    conic : the constant k of a conic section, 0 for a sphere and -1 for a paraboloid.
    coefficients (mm^-3, mm^-5 ...) : a_4, a_6 ... of an even asphere, whose sag is
        c r^2 / (1 + sqrt(1 - (1 + k) c^2 r^2)) + a_4 r^4 + a_6 r^6 + ...
    axis : the direction "x" or "y" along which a cylinder is straight.
    coating : None if there is none.
    is_stop : whether its rim is the diaphragm.
    """

    curvature: float
    thickness: float
    glass: Glass
    radius: float
    kind: Kind = "spherical"
    conic: float = 0.0
    coefficients: tuple[float, ...] = ()
    axis: str = ""
    coating: Coating | None = None
    is_stop: bool = False

    def sag(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.float64]:
        """Compute the sag (mm), positive towards the film, at distances (x, y) from the axis (mm).

        x and y are broadcast; NaN where it does not reach.
        """
        u, v, w = self.quadric()
        squares = np.square(np.asarray(x, np.float64)) + np.square(np.asarray(y, np.float64))
        bent = u * np.square(np.asarray(x, np.float64)) + v * np.square(np.asarray(y, np.float64))
        with np.errstate(invalid="ignore"):
            sag = bent / (1.0 + np.sqrt(1.0 - w * bent))
        for power, coefficient in enumerate(self.coefficients, start=2):
            sag = sag + coefficient * squares**power
        return np.asarray(sag)

    def quadric(self) -> tuple[float, float, float]:
        """Compute the curvatures (1/mm) of u x^2 + v y^2 + w z^2 = 2 z, the surface without its coefficients."""
        across = (0.0 if self.axis == "x" else self.curvature, 0.0 if self.axis == "y" else self.curvature)
        return (*across, self.curvature * (1.0 + self.conic))


@dataclasses.dataclass(frozen=True)
class Focus:
    """The way in which a lens is focused.

    moves : "all", the whole lens, and "sensor", the film, which is the same to rays; or "group", a part of the lens.
    first, last : the surfaces that the group begins and ends with, by their numbers from 1.
    """

    moves: str = "all"
    first: int = 1
    last: int = 1


READING = "thickness is read as that {place} each surface, {reason}"
"""Template of the sentence that says how a file was interpreted."""


class FileInterpretation(NamedTuple):
    """Interpretation of an ambiguous lens file.

    place : of the surface that a thickness belongs to: "after" or "before" it.
    reason : a clause.
    is_guess : whether the file's own numbers do not settle it.
    """

    place: str
    reason: str
    is_guess: bool

    @property
    def text(self) -> str:
        """Write a sentence that says how the file was interpreted, and why."""
        return READING.format(place=self.place, reason=self.reason)


@dataclasses.dataclass(frozen=True)
class Lens:
    """A lens: its surfaces from the front to the film, and what has been published of it.

    name : of the lens.
    elements : its surfaces.
    source : where its numbers are from.
    focal_length (mm), f_number : as published; None where they are not.
    image_circle (mm) : diameter of the picture that it was designed for; None if that is not known.
    focus : the way in which it is focused.
    reading : how its file was interpreted, if that is ambiguous; lenses are compared without it.

    Raises
    ------
    ValueError : the numbers are not those of a lens; it names the surface by its number from 1.
    """

    name: str
    elements: tuple[Element, ...]
    source: str = ""
    focal_length: float | None = None
    f_number: float | None = None
    image_circle: float | None = None
    focus: Focus = Focus()
    reading: FileInterpretation | None = dataclasses.field(default=None, compare=False)

    def __post_init__(self) -> None:
        if not self.elements:
            raise ValueError("a lens needs a surface")
        stops = [number for number, element in enumerate(self.elements, start=1) if element.is_stop]
        if len(stops) > 1:
            raise ValueError(f"surface {stops[1]} is a second stop")
        for number, element in enumerate(self.elements, start=1):
            _check(f"surface {number}", element)
        pack_coatings([element.coating for element in self.elements], [float(glass.ior()) for glass in self._glasses()])
        if self.focus.moves not in {"all", "sensor", "group"}:
            raise ValueError(f"a lens focuses by moving all of it, the sensor or a group, not by {self.focus.moves}")
        if self.focus.moves == "group" and not 1 <= self.focus.first <= self.focus.last <= len(self.elements):
            raise ValueError(
                f"the group that focuses is from surface {self.focus.first} to {self.focus.last}, of "
                f"{len(self.elements)}"
            )

    def disperses(self) -> bool:
        """Return True if the index of one of its glasses depends on the wavelength."""
        return any(element.glass.disperses() for element in self.elements)

    def is_round(self) -> bool:
        """Return True if it is symmetric about its axis, which a lens with cylinders is not."""
        return not any(element.kind == "cylindrical" for element in self.elements)

    def stop(self) -> int:
        """Find the surface, from 0, that is the diaphragm: the one marked, or the one that limits axial light."""
        for number, element in enumerate(self.elements):
            if element.is_stop:
                return number
        surfaces = self._surfaces(LINE_D)
        reached = np.abs(paraxial_heights(surfaces, 1.0, 0.0, towards_film=True))
        return int(np.argmax(reached / surfaces.radius))

    def crossings(self) -> list[tuple[int, int]]:
        """Find neighbouring surfaces, by their numbers from 1, that intersect within their apertures.

        Rays meet surfaces in their order all the same, so such a lens can be rendered, but not be made.
        """
        places = itertools.accumulate((element.thickness for element in self.elements), initial=0.0)
        rows = enumerate(zip(self.elements, places, strict=False), start=1)
        # Air around a diaphragm may hold the bulge of a surface.
        glass = [(number, element, place) for number, (element, place) in rows if element.kind != "stop"]
        pairs = []
        for (first, front, z), (second, back, z_back) in itertools.pairwise(glass):
            reach = np.linspace(0.0, min(front.radius, back.radius), _CROSSING_STEPS)
            gaps = [
                z_back + back.sag(*way) - z - front.sag(*way) for way in ((reach, 0.0 * reach), (0.0 * reach, reach))
            ]
            if min(float(np.nanmin(gap)) for gap in gaps) < -_CROSSING_MM:
                pairs.append((first, second))
        return pairs

    def stopped_down(self, radius: float) -> "Lens":
        """Close the stop to a radius (mm), as if it opened no wider.

        Raises
        ------
        ValueError : the stop does not open so far.
        """
        stop, elements = self.stop(), list(self.elements)
        self._check_stop(stop, radius)
        elements[stop] = elements[stop]._replace(radius=float(radius), is_stop=True)
        return dataclasses.replace(self, elements=tuple(elements))

    def focused(self, shift: float) -> "Lens":
        """Move the group that focuses towards the scene (mm); unchanged if the whole lens moves.

        Raises
        ------
        ValueError : the group would go through what is before or behind it.
        """
        if self.focus.moves != "group" or shift == 0.0:
            return self
        elements = list(self.elements)
        # The gaps before and behind it: the frame begins at the front vertex, which may move along.
        for number, by in ((self.focus.first - 2, -shift), (self.focus.last - 1, shift)):
            if 0 <= number < len(elements) - 1:
                thickness = elements[number].thickness + by
                if thickness < 0.0:
                    raise ValueError(
                        f"the focusing group of the lens cannot move by {abs(by):g} mm: surfaces would meet"
                    )
                elements[number] = elements[number]._replace(thickness=thickness)
        return dataclasses.replace(self, elements=tuple(elements))

    def packed(
        self,
        wavelength: float = LINE_D,
        *,
        stop_radius: float | None = None,
        shift: float = 0.0,
        diaphragm: Any = None,
        dispersion: bool = False,
        coatings: bool = False,
    ) -> LensSurfaces:
        """Pack its surfaces for rays.

        Parameters
        ----------
        wavelength (nm) : of the packed indices.
        stop_radius (mm) : of the stop; its widest by default.
        shift (mm) : of the group that focuses, towards the scene.  Vertices stay where they are relative to the film,
            so the front one is at -shift if it moves along.
        diaphragm : shape of the stop, packed by `raytracer.plugins.apertures`, in units of the stop's radius; None
            is round.
        dispersion : whether rays have wavelengths; without effect on a lens that does not disperse.
        coatings : whether to pack coatings, which only reflections in the lens depend on.

        Raises
        ------
        ValueError : the stop does not open so far, or the group would go through its neighbours.
        """
        packed = self._surfaces(wavelength)
        stop = self.stop()
        vertex, radius = packed.vertex.copy(), packed.radius.copy()
        if stop_radius is not None:
            self._check_stop(stop, stop_radius)
            radius[stop] = stop_radius
        if self.focus.moves == "group":
            vertex[self.focus.first - 1 : self.focus.last] -= shift
            if (np.diff(vertex) < 0.0).any():
                raise ValueError(f"the focusing group of the lens cannot move by {shift:g} mm: surfaces would meet")
        indices = None
        if dispersion and self.disperses():
            wavelengths = np.arange(FIRST_WAVELENGTH, LAST_WAVELENGTH + STEP, STEP)
            columns = [np.broadcast_to(glass.ior(wavelengths), wavelengths.shape) for glass in self._glasses()]
            indices = Indices(np.ascontiguousarray(np.stack(columns, axis=1)), FIRST_WAVELENGTH, STEP)
        layers = (
            pack_coatings([element.coating for element in self.elements], packed.ior.tolist()) if coatings else None
        )
        return packed._replace(
            vertex=vertex, radius=radius, stop=stop, diaphragm=diaphragm, indices=indices, coatings=layers
        )

    def _check_stop(self, stop: int, radius: float) -> None:
        widest = self.elements[stop].radius
        if not 0.0 < radius <= widest:
            raise ValueError(f"the stop of the lens opens to a radius of {widest:g} mm, not {radius:g} mm")

    def _surfaces(self, wavelength: float) -> LensSurfaces:
        """Pack with the stop wide open; its number is -1 where none is marked."""
        rows = self.elements
        marked = [number for number, element in enumerate(rows) if element.is_stop]
        return LensSurfaces(
            curvature=np.array([element.curvature for element in rows], np.float64),
            vertex=np.cumsum([0.0, *(element.thickness for element in rows[:-1])]),
            radius=np.array([element.radius for element in rows], np.float64),
            ior=np.array([float(glass.ior(wavelength)) for glass in self._glasses()]),
            stop=marked[0] if marked else -1,
            shapes=_pack_shapes(rows),
        )

    def _glasses(self) -> list[Glass]:
        """List the media before the first surface, and behind each."""
        return [AIR, *(element.glass for element in self.elements)]


def _pack_shapes(rows: Sequence[Element]) -> SurfaceShapes | None:
    """Pack the shapes of surfaces; None if all are spheres or flat."""
    if not any(element.conic or any(element.coefficients) or element.axis for element in rows):
        return None
    coefficients = np.zeros((len(rows), max(len(element.coefficients) for element in rows)))
    for row, element in zip(coefficients, rows, strict=True):
        row[: len(element.coefficients)] = element.coefficients
    bounds = np.array([_sag_bounds(element) for element in rows])
    return SurfaceShapes(
        quadric=np.array([element.quadric() for element in rows], np.float64),
        coefficients=coefficients,
        aspheric=np.ascontiguousarray(coefficients.any(axis=1)),
        plain=np.array([not (element.conic or any(element.coefficients) or element.axis) for element in rows]),
        limit=np.array([element.radius for element in rows], np.float64),
        min_sag=np.ascontiguousarray(bounds[:, 0]),
        max_sag=np.ascontiguousarray(bounds[:, 1]),
    )


def _sag_bounds(element: Element) -> tuple[float, float]:
    """Find bounds of the sag of an asphere (mm)."""
    if not any(element.coefficients):
        return 0.0, 0.0
    sags = element.sag(0.0, np.linspace(0.0, element.radius, _PROFILE))
    sags = sags[np.isfinite(sags)]
    # Between two samples it goes no further beyond both than the greatest difference of neighbours.
    margin = float(np.abs(np.diff(sags)).max())
    return float(sags.min()) - margin, float(sags.max()) + margin


def _check(name: str, element: Element) -> None:
    """Check the numbers of a surface: ValueError, which begins with its name."""
    curvature, thickness, radius = element[0], element[1], element.radius
    if not all(map(math.isfinite, (curvature, thickness, radius, element.conic, *element.coefficients))):
        raise ValueError(f"{name} has a number that is not finite; flat glass has the curvature 0")
    if (element.kind == "cylindrical") != (element.axis in {"x", "y"}):
        raise ValueError(f"{name} needs an axis, x or y, if and only if it is cylindrical")
    if element.axis and (element.conic or element.coefficients):
        raise ValueError(f"{name} is cylindrical, and can be neither conic nor aspheric as well")
    if radius <= 0.0:
        raise ValueError(f"{name} lets no light through: its radius is {radius:g} mm")
    if thickness < 0.0:
        raise ValueError(f"{name} is behind the next one: its thickness is {thickness:g} mm")
    if (1.0 + element.conic) * (curvature * radius) ** 2 > 1.0:
        kind = "an ellipsoid" if element.conic else "a sphere"
        raise ValueError(
            f"{name} is {kind} of radius {1.0 / abs(curvature):g} mm, which reaches no {radius:g} mm far out"
        )
