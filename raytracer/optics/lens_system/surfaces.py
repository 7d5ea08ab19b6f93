"""Surfaces of lenses, packed for kernels: rows on one axis.

Lengths are millimetres, in the lens's own frame: z is the axis, from the scene to the film, and the front vertex is
at 0.  A curvature is 1 / radius, positive where the centre lies on the film's side.  Flat glass has the curvature 0,
and the stop a mark of its own: tables in which a radius of 0 means the stop, as is the custom, cannot say flat glass.

References: Kolb, Mitchell, Hanrahan 1995, "A Realistic Camera Model for Computer Graphics", SIGGRAPH; Kingslake,
Johnson 2010, "Lens Design Fundamentals", 2nd ed.
"""

from functools import singledispatch
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import optional


class Indices(NamedTuple):
    """Packed table of the indices of refraction by wavelength.

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
        shapes=lens.shapes and lens.shapes.reversed(),
        indices=indices and indices._replace(ior=np.ascontiguousarray(indices.ior[:, ::-1])),
        diaphragm=lens.diaphragm,
    )


# ---- The opening of the stop
#
# Its unit of length is the radius of the round opening of the same area; x is to the right and y up, as seen from
# behind the camera.  Shapes are kinds of apertures, which register their cases.


@optional
def aperture_transmission(diaphragm, x, y):
    """Compute the fraction of the light at (x, y) that an opening lets through, 0 to 1; 0 for NaN.

    `sample_aperture` samples points with this density, over pi.
    """
    return 1.0 if x * x + y * y <= 1.0 else 0.0


@singledispatch
def aperture_extent(diaphragm: Any) -> float:
    """Find the greatest distance from the axis at which an opening lets light through."""
    raise NotImplementedError(type(diaphragm))


@aperture_extent.register
def aperture_extent_none(diaphragm: None) -> float:
    return 1.0
