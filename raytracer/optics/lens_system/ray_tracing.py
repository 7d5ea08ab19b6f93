"""Lenses of glass: rows of surfaces on one axis, and rays through them.

Lengths are millimetres, in the lens's own frame: z is the axis, from the scene to the film, and the front vertex is
at 0.  A curvature is 1 / radius, positive where the centre lies on the film's side.  Flat glass has the curvature 0,
and the stop a mark of its own: tables in which a radius of 0 means the stop, as is the custom, cannot say flat glass.

A ray goes from surface to surface in the order in which they stand, in float64.  So it starts from the very point where
it met the one before: there is nothing to keep off, and an offset along the normal would put it out of focus.

References: Kolb, Mitchell, Hanrahan 1995, "A Realistic Camera Model for Computer Graphics", SIGGRAPH; Kingslake,
Johnson 2010, "Lens Design Fundamentals", 2nd ed.
"""

import functools
import math
from collections.abc import Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raytracer.glass import LINE_D
from raytracer.jit import entry, generic, kernel
from raytracer.lenses.diaphragm import covers
from raytracer.vec import dot, madd, scale

Rows: TypeAlias = NDArray[np.float64]


class Surface(NamedTuple):
    """A surface as a lens's table has it.

    curvature (1/mm); thickness, the distance to the next vertex towards the film (mm), without effect in the last row;
    ior, the index of refraction behind it, on the film's side; radius, how far from the axis light passes (mm);
    is_stop, whether it is the diaphragm, between two layers of the same index, and no glass.
    """

    curvature: float
    thickness: float
    ior: float
    radius: float
    is_stop: bool = False


class Indices(NamedTuple):
    """Packed: indices of refraction by wavelength, float64 (m, n + 1); that of the first row, and between rows (nm).

    Between the rows they are interpolated linearly.  The error of that is an eighth of the second derivative times the
    square of the step: for a step of half a nanometre and the glass that disperses most, 7e-7 at 380 nm.
    """

    ior: NDArray[np.float64]
    first: float
    step: float


class LensSurfaces(NamedTuple):
    """Packed, from the front to the film: float64 (n,), and (n + 1,) for the ior.

    curvature (1/mm); vertex, its place on the axis (mm); radius, that of the clear aperture (mm); ior, the index of
    refraction before the first surface, and behind each; stop, which surface is the diaphragm, -1 if none is.

    What a lens does not have is None: shapes, of surfaces that are no spheres; indices, by wavelength; diaphragm, the
    shape of a stop that is not round, in units of its radius; coatings.
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
    """A lens's surfaces, from the front to the film, behind a medium of the index `before`.

    Raises
    ------
    ValueError : what is no surface, by its number from 1.
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
    """Refuse what is no surface behind a medium of the index `near`."""
    check_surface(name, surface.curvature, surface.thickness, surface.radius)
    if not (math.isfinite(surface.ior) and math.isfinite(near)):
        raise ValueError(f"{name} has a number that is not finite")
    if surface.ior <= 0.0 or near <= 0.0:
        raise ValueError(f"{name} needs an index greater than 0 on both sides")
    if surface.is_stop and (surface.curvature != 0.0 or surface.ior != near):
        raise ValueError(f"{name} is the stop, which is flat and has the same index on both sides")


def check_surface(name: str, curvature: float, thickness: float, radius: float, conic: float = 0.0) -> None:
    """Refuse what is no surface: ValueError, which begins with its name."""
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
    """Some rows of a packed table of surfaces, which may be None."""
    return table and type(table)(*(np.ascontiguousarray(column[rows]) for column in table))


def part(lens: LensSurfaces, first: int, last: int) -> LensSurfaces:
    """The surfaces from one to before another, by numbers from 0, where they are in the lens; there may be none."""
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
def turned_shapes(shapes: Any) -> Any:
    """The shapes of a lens's surfaces in a mirror across the axis, from the last to the first."""
    raise NotImplementedError(type(shapes))


@turned_shapes.register(type(None))
def _(shapes: None) -> None:
    return None


def turned(lens: LensSurfaces) -> LensSurfaces:
    """The lens in a mirror across the axis at z = 0, so that its back is in front.

    A ray to the film is one to the scene in there, with its z and that of its direction negated.
    """
    indices = lens.indices
    return LensSurfaces(
        curvature=-lens.curvature[::-1],
        vertex=-lens.vertex[::-1],
        radius=lens.radius[::-1].copy(),
        ior=lens.ior[::-1].copy(),
        stop=len(lens.curvature) - 1 - lens.stop if lens.stop >= 0 else -1,
        shapes=turned_shapes(lens.shapes),
        indices=indices and indices._replace(ior=np.ascontiguousarray(indices.ior[:, ::-1])),
        diaphragm=lens.diaphragm,
    )


# ---- Rays


@kernel
def meet_surface(curvature, vertex, origin, direction, side):
    """Where a ray crosses a spherical surface, towards the film (side 1) or the scene (side -1).

    Returns
    -------
    (distance, unit normal to the film's side, cosine between normal and direction); the cosine, which has the sign of
    `side`, is 0 for a ray that misses the surface, or comes from its other side.

    References: Feder 1951, "Optical Calculations with Automatic Computing Machinery", JOSA 41(9) (curvatures, so that a
    plane is no exception); Press et al. 2007, "Numerical Recipes", 3rd ed., sec. 5.6 (the root that does not cancel).
    """
    # From the ray's closest point to the vertex, on either side of it, c t^2 - 2 g t + f = 0 with f of that point.
    to = (origin[0], origin[1], origin[2] - vertex)
    before = -dot(to, direction)
    near = madd(to, before, direction)
    f, g = curvature * dot(near, near) - 2.0 * near[2], direction[2]
    square = g * g - curvature * f
    cosine = side * math.sqrt(max(square, 0.0))
    # Of the two forms of the root the one in which nothing cancels.
    onward = g * side > 0.0
    rest = (f if onward else g - cosine) / (g + cosine if onward else curvature)
    point = madd(near, rest, direction)
    normal = (-curvature * point[0], -curvature * point[1], 1.0 - curvature * point[2])
    # Neither what misses nor what is no number passes; the far half of the sphere is no part of the surface.
    return before + rest, normal, cosine if square > 0.0 and normal[2] > 0.0 else 0.0


@generic
def meet_shape(shapes, lens, surface, origin, direction, side):
    """`meet`, by what is known of the shapes of a lens's surfaces: nothing, of spheres; or `aspheres.Shapes`."""
    raise NotImplementedError


@meet_shape.register(type(None))
def _(shapes, lens, surface, origin, direction, side):
    return meet_surface(lens.curvature[surface], lens.vertex[surface], origin, direction, side)


@kernel
def meet(lens, surface, origin, direction, side):
    """Where a ray crosses a surface of a lens, towards the film (side 1) or the scene (side -1): as `meet_surface`."""
    return meet_shape(lens.shapes, lens, surface, origin, direction, side)


@kernel
def within(lens, surface, x, y):
    """1 within the rim of a surface, else 0; also for what is no number."""
    radius = lens.radius[surface]
    return 1.0 if x * x + y * y <= radius * radius else 0.0


@generic
def pass_opening(diaphragm, lens, surface, x, y):
    """`passed`, by the shape of the diaphragm."""
    raise NotImplementedError


@pass_opening.register(type(None))
def _(diaphragm, lens, surface, x, y):
    return within(lens, surface, x, y)


@pass_opening.register(tuple)
def _(diaphragm, lens, surface, x, y):
    if surface == lens.stop:
        radius = lens.radius[surface]
        return covers(diaphragm, x / radius, y / radius)
    return within(lens, surface, x, y)


@kernel
def passed(lens, surface, point):
    """Which part of light passes the rim of a surface, or the diaphragm, at a point of it: 0 to 1."""
    return pass_opening(lens.diaphragm, lens, surface, point[0], point[1])


@generic
def row_of(indices, wavelength):
    """Where a wavelength (nm) is in the table of indices: row, and how far to the next one; the nearest it has."""
    raise NotImplementedError


@row_of.register(type(None))
def _(indices, wavelength):
    return 0, 0.0


@row_of.register(Indices)
def _(indices, wavelength):
    last = len(indices.ior) - 1
    place = min(max((wavelength - indices.first) / indices.step, 0.0), float(last))
    row = min(int(place), last - 1)
    return row, place - row


@generic
def index_in(indices, ior, medium, row, part):
    """The index of refraction before the first surface (medium 0), or behind the one of a number from 1."""
    raise NotImplementedError


@index_in.register(type(None))
def _(indices, ior, medium, row, part):
    return ior[medium]


@index_in.register(Indices)
def _(indices, ior, medium, row, part):
    below, above = indices.ior[row, medium], indices.ior[row + 1, medium]
    return below + part * (above - below)


@kernel
def index_of(lens, medium, wavelength):
    """The index of refraction at a wavelength (nm, or None) before the first surface (medium 0), or behind number 1 ...

    Without a table of indices it is the same at all wavelengths.
    """
    row, part = row_of(lens.indices, wavelength)
    return index_in(lens.indices, lens.ior, medium, row, part)


@kernel
def bend(direction, normal, cosine, ratio):
    """Snell's law: cosine of refraction, with the sign of that of incidence, and the unit direction behind.

    normal, cosine : as `meet_surface` gives them; ratio : index before the surface over that behind it.  The cosine is
    0 for total reflection.

    References: Feder 1951, JOSA 41(9).
    """
    sine2 = ratio * ratio * ((1.0 - cosine) * (1.0 + cosine))
    refracted = math.copysign(math.sqrt(max(1.0 - sine2, 0.0)), cosine)
    # No boundary at all leaves directions as they are, to the last bit.
    if ratio == 1.0:
        return cosine, direction
    return refracted, madd(scale(ratio, direction), refracted - ratio * cosine, normal)


@kernel
def trace(lens, origin, direction, towards_film, wavelength):
    """Follow a ray through all surfaces of a lens, from whichever side.

    Parameters
    ----------
    lens : LensSurfaces.
    origin, direction : a point of the ray (mm), and a unit vector.
    towards_film : whether the ray goes from the scene to the film; else the other way.
    wavelength : in air (nm); without effect, and may be None, for a lens without a table of indices.

    Returns
    -------
    (weight, point on the last surface, direction behind it); weight 0 if the ray does not get through: it misses a
    surface, is stopped by a rim or the diaphragm, or is totally reflected; between 0 and 1 behind a diaphragm that is
    partly transparent.
    """
    count = len(lens.curvature)
    side = 1.0 if towards_film else -1.0
    row, part = row_of(lens.indices, wavelength)
    weight, near = 1.0, index_in(lens.indices, lens.ior, 0 if towards_film else count, row, part)
    for step in range(count):
        surface = step if towards_film else count - 1 - step
        distance, normal, cosine = meet(lens, surface, origin, direction, side)
        point = madd(origin, distance, direction)
        weight *= passed(lens, surface, point)
        if cosine == 0.0 or weight == 0.0:
            return 0.0, origin, direction
        far = index_in(lens.indices, lens.ior, surface + 1 if towards_film else surface, row, part)
        refracted, onward = bend(direction, normal, cosine, near / far)
        if refracted == 0.0:
            return 0.0, origin, direction
        origin, direction, near = point, onward, far
    return weight, origin, direction


# ---- Rays from Python


@entry
def _trace_rays(lens, origins, directions, towards_film, wavelengths, weights, points, onward):
    for ray in range(len(weights)):
        origin = (origins[ray, 0], origins[ray, 1], origins[ray, 2])
        direction = (directions[ray, 0], directions[ray, 1], directions[ray, 2])
        weight, point, way = trace(lens, origin, direction, towards_film, wavelengths[ray])
        weights[ray] = weight
        for axis in range(3):
            points[ray, axis] = point[axis]
            onward[ray, axis] = way[axis]


@entry
def _trace_paths(lens, origins, directions, towards_film, wavelengths, weights, points, onward):
    count = len(lens.curvature)
    side = 1.0 if towards_film else -1.0
    for ray in range(len(weights)):
        origin = (origins[ray, 0], origins[ray, 1], origins[ray, 2])
        direction = (directions[ray, 0], directions[ray, 1], directions[ray, 2])
        weight = 1.0
        for step in range(count):
            surface = step if towards_film else count - 1 - step
            distance, normal, cosine = meet(lens, surface, origin, direction, side)
            point = madd(origin, distance, direction)
            weight *= passed(lens, surface, point)
            before, behind = (surface, surface + 1) if towards_film else (surface + 1, surface)
            near, far = index_of(lens, before, wavelengths[ray]), index_of(lens, behind, wavelengths[ray])
            refracted, way = bend(direction, normal, cosine, near / far)
            if cosine == 0.0 or weight == 0.0 or refracted == 0.0:
                weight = 0.0
                break
            origin, direction = point, way
            for axis in range(3):
                points[ray, surface, axis] = point[axis]
                onward[ray, surface, axis] = way[axis]
        weights[ray] = weight


def _rays(
    lens: LensSurfaces, origins: ArrayLike, directions: ArrayLike, wavelength: ArrayLike | None
) -> tuple[Rows, Rows, Rows]:
    """Rays as kernels take them: rows of starts and directions (n, 3), and wavelengths (n,)."""
    starts, ways = np.broadcast_arrays(np.atleast_2d(np.asarray(origins, np.float64)), np.asarray(directions))
    wavelengths = np.broadcast_to(LINE_D if wavelength is None else np.asarray(wavelength), starts.shape[:1])
    return starts.copy(), ways.astype(np.float64), wavelengths.astype(np.float64)


def trace_rays(
    lens: LensSurfaces,
    origins: ArrayLike,
    directions: ArrayLike,
    towards_film: bool = True,
    wavelength: ArrayLike | None = None,
) -> tuple[Rows, Rows, Rows]:
    """`trace` of many rays, without the interpreter lock.

    Parameters
    ----------
    origins, directions : points of the rays (mm) and unit vectors (n, 3), or (3,) for all.
    wavelength : in air (nm), of all rays or (n,); the d line by default.

    Returns
    -------
    weights (n,), points on the last surface (n, 3), directions behind it (n, 3).
    """
    starts, ways, wavelengths = _rays(lens, origins, directions, wavelength)
    weights, points, onward = np.empty(len(starts)), np.empty_like(starts), np.empty_like(starts)
    _trace_rays(lens, starts, ways, bool(towards_film), wavelengths, weights, points, onward)
    return weights, points, onward


def trace_paths(
    lens: LensSurfaces,
    origins: ArrayLike,
    directions: ArrayLike,
    towards_film: bool = True,
    wavelength: ArrayLike | None = None,
) -> tuple[Rows, Rows, Rows]:
    """As `trace_rays`, but with where each ray meets each surface.

    Returns
    -------
    weights (n,), points on all surfaces (n, surfaces, 3), directions behind them on the rays' way (n, surfaces, 3), in
    the order in which the surfaces are packed; NaN where a ray does not get.
    """
    starts, ways, wavelengths = _rays(lens, origins, directions, wavelength)
    shape = (len(starts), len(lens.curvature), 3)
    weights, points, onward = np.empty(len(starts)), np.full(shape, np.nan), np.full(shape, np.nan)
    _trace_paths(lens, starts, ways, bool(towards_film), wavelengths, weights, points, onward)
    return weights, points, onward
