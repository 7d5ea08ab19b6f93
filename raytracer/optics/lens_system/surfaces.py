"""Surfaces of lenses, packed for kernels: rows on one axis.

Lengths are millimetres, in the lens's own frame: z is the axis, from the scene to the film, and the front vertex is
at 0.  A curvature is 1 / radius, positive where the centre lies on the film's side.  Flat glass has the curvature 0,
and the stop a mark of its own: tables in which a radius of 0 means the stop, as is the custom, cannot say flat glass.

References: Kolb, Mitchell, Hanrahan 1995, "A Realistic Camera Model for Computer Graphics", SIGGRAPH; Kingslake,
Johnson 2010, "Lens Design Fundamentals", 2nd ed.
"""

import functools
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray


class Surface(NamedTuple):
    """A surface as a lens table has it.

    Attributes
    ----------
    curvature (1/mm) : 1 / radius of curvature.
    thickness (mm) : distance to the next vertex towards the film, without effect in the last row.
    ior : index of refraction behind it, on the film's side.
    radius (mm) : half of the clear aperture.
    is_stop : whether it is the diaphragm, between two layers of the same index, and no glass.
    """

    curvature: float
    thickness: float
    ior: float
    radius: float
    is_stop: bool = False


class Indices(NamedTuple):
    """Packed table of the indices of refraction by wavelength.

    Attributes
    ----------
    ior : float64 (m, n + 1), by wavelength, and before the first surface and behind each.
    first (nm) : wavelength of the first row.
    step (nm) : between rows.

    Between the rows indices are interpolated linearly.  The error of that is an eighth of the second derivative times
    the square of the step: for a step of half a nanometre and the glass that disperses most, 7e-7 at 380 nm.
    """

    ior: NDArray[np.float64]
    first: float
    step: float


class LensSurfaces(NamedTuple):
    """Packed surfaces of a lens, from the front to the film.

    Attributes
    ----------
    curvature (1/mm) : float64 (n,).
    vertex (mm) : float64 (n,), places on the axis.
    radius (mm) : float64 (n,), half of the clear aperture.
    ior : float64 (n + 1,), index of refraction before the first surface, and behind each.
    stop : number of the surface that is the diaphragm, -1 if none is.
    shapes : `aspheres.SurfaceShapes`; None if all surfaces are spheres.
    indices : `Indices` by wavelength; None for the same index at all wavelengths.
    diaphragm : shape of the stop, in units of its radius; None if it is round.
    coatings : `coatings.Coatings`; None if there are none, or they have no effect.
    """

    curvature: NDArray[np.float64]
    vertex: NDArray[np.float64]
    radius: NDArray[np.float64]
    ior: NDArray[np.float64]
    stop: int
    shapes: Any = None
    indices: Any = None
    diaphragm: Any = None
    coatings: Any = None


def pack_surfaces(surfaces: Sequence[Surface], *, before: float = 1.0) -> LensSurfaces:
    """Pack a lens's surfaces, from the front to the film, behind a medium of the index `before`.

    Raises
    ------
    ValueError : a surface is not valid; it is named by its number from 1.
    """
    if not surfaces:
        raise ValueError("a lens needs a surface")
    indices = [before, *(surface.ior for surface in surfaces)]
    for number, (surface, near) in enumerate(zip(surfaces, indices, strict=False), start=1):
        _check(f"surface {number}", surface, near)
    stops = [number for number, surface in enumerate(surfaces) if surface.is_stop]
    if len(stops) > 1:
        raise ValueError(f"surface {stops[1] + 1} is a second stop")
    places = np.cumsum([0.0, *(surface.thickness for surface in surfaces[:-1])])
    curvature, radius = (np.array([float(surface[column]) for surface in surfaces]) for column in (0, 3))
    return LensSurfaces(curvature, places, radius, np.array(indices, np.float64), stops[0] if stops else -1)


def _check(name: str, surface: Surface, near: float) -> None:
    """Check a surface behind a medium of the index `near`."""
    check_surface(name, surface.curvature, surface.thickness, surface.radius)
    if not (math.isfinite(surface.ior) and math.isfinite(near)):
        raise ValueError(f"{name} has a number that is not finite")
    if surface.ior <= 0.0 or near <= 0.0:
        raise ValueError(f"{name} needs an index greater than 0 on both sides")
    if surface.is_stop and (surface.curvature != 0.0 or surface.ior != near):
        raise ValueError(f"{name} is the stop, which is flat and has the same index on both sides")


def check_surface(name: str, curvature: float, thickness: float, radius: float, conic: float = 0.0) -> None:
    """Check the numbers of a surface.

    Raises
    ------
    ValueError : they are not those of a surface; the message begins with its name.
    """
    if not all(map(math.isfinite, (curvature, thickness, radius))):
        raise ValueError(f"{name} has a number that is not finite; flat glass has the curvature 0")
    if radius <= 0.0:
        raise ValueError(f"{name} lets no light through: its radius is {radius:g} mm")
    if thickness < 0.0:
        raise ValueError(f"{name} is behind the next one: its thickness is {thickness:g} mm")
    if (1.0 + conic) * (curvature * radius) ** 2 > 1.0:
        size = 1.0 / abs(curvature)
        kind = "an ellipsoid" if conic else "a sphere"
        raise ValueError(f"{name} is {kind} of radius {size:g} mm, which reaches no {radius:g} mm far out")


def _rows_of(table: Any, rows: slice) -> Any:
    """Slice a packed table of surfaces, which may be None."""
    return table and type(table)(*(np.ascontiguousarray(column[rows]) for column in table))


def slice_surfaces(lens: LensSurfaces, first: int, last: int) -> LensSurfaces:
    """Slice a lens from one surface to before another, by numbers from 0, at their places; there may be none."""
    rows, media = slice(first, last), slice(first, last + 1)
    indices = lens.indices
    return lens._replace(
        curvature=lens.curvature[rows].copy(),
        vertex=lens.vertex[rows].copy(),
        radius=lens.radius[rows].copy(),
        ior=lens.ior[media].copy(),
        stop=lens.stop - first if first <= lens.stop < last else -1,
        shapes=_rows_of(lens.shapes, rows),
        indices=indices and indices._replace(ior=np.ascontiguousarray(indices.ior[:, media])),
        coatings=_rows_of(lens.coatings, rows),
    )


@functools.singledispatch
def reverse_shapes(shapes: Any) -> Any:
    """Mirror the shapes of a lens's surfaces across the axis, from the last to the first."""
    raise NotImplementedError(type(shapes))


@reverse_shapes.register(type(None))
def reverse_shapes_none(shapes: None) -> None:
    return None


def reverse_lens(lens: LensSurfaces) -> LensSurfaces:
    """Mirror a lens across the axis at z = 0, so that its back is in front.

    A ray to the film is one to the scene in the mirrored lens, with its z and that of its direction negated.
    """
    indices = lens.indices
    return LensSurfaces(
        curvature=-lens.curvature[::-1],
        vertex=-lens.vertex[::-1],
        radius=lens.radius[::-1].copy(),
        ior=lens.ior[::-1].copy(),
        stop=len(lens.curvature) - 1 - lens.stop if lens.stop >= 0 else -1,
        shapes=reverse_shapes(lens.shapes),
        indices=indices and indices._replace(ior=np.ascontiguousarray(indices.ior[:, ::-1])),
        diaphragm=lens.diaphragm,
    )
