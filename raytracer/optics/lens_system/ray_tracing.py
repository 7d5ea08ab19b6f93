"""Rays through the surfaces of a lens, one at a time, from either side.

A ray goes from surface to surface in the order in which they stand, in float64.  So it starts from the very point where
it met the one before: there is nothing to keep off, and an offset along the normal would put it out of focus.

References: Kolb, Mitchell, Hanrahan 1995, "A Realistic Camera Model for Computer Graphics", SIGGRAPH.
"""

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raytracer.core.compiler.dispatch import entry, kernel, optional
from raytracer.core.vec import dot, madd, scale
from raytracer.optics.glass import LINE_D
from raytracer.optics.lens_system.surfaces import Indices, LensSurfaces, aperture_transmission

FloatArray: TypeAlias = NDArray[np.float64]


@kernel
def intersect_sphere(curvature, vertex, origin, direction, side):
    """Intersect a ray with a spherical surface, towards the film (side 1) or the scene (side -1).

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
    # Neither a miss nor NaN passes; the far half of the sphere is no part of the surface.
    return before + rest, normal, cosine if square > 0.0 and normal[2] > 0.0 else 0.0


@optional
def intersect_shape(shapes, lens, surface, origin, direction, side):
    """Intersect a ray with a surface by the shapes of all: None for spheres, or `aspheres.SurfaceShapes`."""
    return intersect_sphere(lens.curvature[surface], lens.vertex[surface], origin, direction, side)


@kernel
def intersect_surface(lens, surface, origin, direction, side):
    """Intersect a ray to the film (side 1) or the scene (side -1) with a surface of a lens: as `intersect_sphere`."""
    return intersect_shape(lens.shapes, lens, surface, origin, direction, side)


@kernel
def inside_rim(lens, surface, x, y):
    """Return 1 within the rim of a surface, else 0; 0 for NaN."""
    radius = lens.radius[surface]
    return 1.0 if x * x + y * y <= radius * radius else 0.0


@optional
def diaphragm_transmission(diaphragm, lens, surface, x, y):
    """Compute `rim_transmission` by the shape of the diaphragm."""
    return inside_rim(lens, surface, x, y)


@diaphragm_transmission.register(tuple)
def diaphragm_transmission_tuple(diaphragm, lens, surface, x, y):
    if surface == lens.stop:
        radius = lens.radius[surface]
        return aperture_transmission(diaphragm, x / radius, y / radius)
    return inside_rim(lens, surface, x, y)


@kernel
def rim_transmission(lens, surface, point):
    """Compute the fraction of light that passes the rim of a surface, or the diaphragm, at a point: 0 to 1."""
    return diaphragm_transmission(lens.diaphragm, lens, surface, point[0], point[1])


@optional
def index_row(indices, wavelength):
    """Find a wavelength (nm) in the table of indices, clamped to its ends: row, and fraction of the way to the next."""
    return 0, 0.0


@index_row.register(Indices)
def index_row_indices(indices, wavelength):
    last = len(indices.ior) - 1
    place = min(max((wavelength - indices.first) / indices.step, 0.0), float(last))
    row = min(int(place), last - 1)
    return row, place - row


@optional
def index_at_row(indices, ior, medium, row, part):
    """Look up the index of refraction before the first surface (medium 0), or behind the one of a number from 1."""
    return ior[medium]


@index_at_row.register(Indices)
def index_at_row_indices(indices, ior, medium, row, part):
    below, above = indices.ior[row, medium], indices.ior[row + 1, medium]
    return below + part * (above - below)


@kernel
def refractive_index(lens, medium, wavelength):
    """Look up the index of refraction at a wavelength (nm, or None) before the first surface (medium 0), or behind one.

    Without a table of indices it is the same at all wavelengths.
    """
    row, part = index_row(lens.indices, wavelength)
    return index_at_row(lens.indices, lens.ior, medium, row, part)


@kernel
def refract(direction, normal, cosine, ratio):
    """Refract by Snell's law: cosine of refraction, with the sign of that of incidence, and the unit direction behind.

    normal, cosine : as `intersect_sphere` gives them.
    ratio : index before the surface over that behind it.

    The cosine is 0 for total reflection.

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
    row, part = index_row(lens.indices, wavelength)
    weight, near = 1.0, index_at_row(lens.indices, lens.ior, 0 if towards_film else count, row, part)
    for step in range(count):
        surface = step if towards_film else count - 1 - step
        distance, normal, cosine = intersect_surface(lens, surface, origin, direction, side)
        point = madd(origin, distance, direction)
        weight *= rim_transmission(lens, surface, point)
        if cosine == 0.0 or weight == 0.0:
            return 0.0, origin, direction
        far = index_at_row(lens.indices, lens.ior, surface + 1 if towards_film else surface, row, part)
        refracted, onward = refract(direction, normal, cosine, near / far)
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
            distance, normal, cosine = intersect_surface(lens, surface, origin, direction, side)
            point = madd(origin, distance, direction)
            weight *= rim_transmission(lens, surface, point)
            before, behind = (surface, surface + 1) if towards_film else (surface + 1, surface)
            near, far = (
                refractive_index(lens, before, wavelengths[ray]),
                refractive_index(lens, behind, wavelengths[ray]),
            )
            refracted, way = refract(direction, normal, cosine, near / far)
            if cosine == 0.0 or weight == 0.0 or refracted == 0.0:
                weight = 0.0
                break
            origin, direction = point, way
            for axis in range(3):
                points[ray, surface, axis] = point[axis]
                onward[ray, surface, axis] = way[axis]
        weights[ray] = weight


def _broadcast_rays(
    origins: ArrayLike, directions: ArrayLike, wavelength: ArrayLike | None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Broadcast rays as kernels take them: rows of starts and directions (n, 3), and wavelengths (n,)."""
    starts, ways = np.broadcast_arrays(np.atleast_2d(np.asarray(origins, np.float64)), np.asarray(directions))
    wavelengths = np.broadcast_to(LINE_D if wavelength is None else np.asarray(wavelength), starts.shape[:1])
    return starts.copy(), ways.astype(np.float64), wavelengths.astype(np.float64)


def trace_rays(
    lens: LensSurfaces,
    origins: ArrayLike,
    directions: ArrayLike,
    towards_film: bool = True,
    wavelength: ArrayLike | None = None,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Follow many rays by `trace`, without the interpreter lock.

    origins, directions : points of the rays (mm) and unit vectors (n, 3), or (3,) for all.
    wavelength : in air (nm), of all rays or (n,); the d line by default.

    Returns
    -------
    weights (n,), points on the last surface (n, 3), directions behind it (n, 3).
    """
    starts, ways, wavelengths = _broadcast_rays(origins, directions, wavelength)
    weights, points, onward = np.empty(len(starts)), np.empty_like(starts), np.empty_like(starts)
    _trace_rays(lens, starts, ways, bool(towards_film), wavelengths, weights, points, onward)
    return weights, points, onward


def trace_paths(
    lens: LensSurfaces,
    origins: ArrayLike,
    directions: ArrayLike,
    towards_film: bool = True,
    wavelength: ArrayLike | None = None,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Follow many rays as `trace_rays` does, and return the points where each meets each surface.

    Returns
    -------
    weights (n,), points on all surfaces (n, surfaces, 3), directions behind them on the rays' way (n, surfaces, 3), in
    the order in which the surfaces are packed; NaN for surfaces that a ray does not reach.
    """
    starts, ways, wavelengths = _broadcast_rays(origins, directions, wavelength)
    shape = (len(starts), len(lens.curvature), 3)
    weights, points, onward = np.empty(len(starts)), np.full(shape, np.nan), np.full(shape, np.nan)
    _trace_paths(lens, starts, ways, bool(towards_film), wavelengths, weights, points, onward)
    return weights, points, onward
