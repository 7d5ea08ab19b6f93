"""Lenses of glass: rows of surfaces on one axis, and rays through them.

Lengths are millimetres, in the lens's own frame: z is the axis, from the scene to the film, and the front vertex is
at 0.  A curvature is 1 / radius, positive where the centre lies on the film's side.  Flat glass has the curvature 0,
and the stop a mark of its own: tables in which a radius of 0 means the stop, as is the custom, cannot say flat glass.

A ray goes from surface to surface in the order in which they stand, in float64.  So it starts from the very point where
it met the one before: there is nothing to keep off, and an offset along the normal would put it out of focus.

References: Kolb, Mitchell, Hanrahan 1995, "A Realistic Camera Model for Computer Graphics", SIGGRAPH; Kingslake,
Johnson 2010, "Lens Design Fundamentals", 2nd ed.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.jit import entry, kernel
from raytracer.optics import fresnel_dielectric, refract
from raytracer.vec import dot, madd


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


class LensSurfaces(NamedTuple):
    """Packed, from the front to the film: float64 (n,), and (n + 1,) for the ior.

    curvature (1/mm); vertex, its place on the axis (mm); radius, that of the clear aperture (mm); ior, the index of
    refraction before the first surface, and behind each; stop, which surface is the diaphragm, -1 if none is.
    """

    curvature: NDArray[np.float64]
    vertex: NDArray[np.float64]
    radius: NDArray[np.float64]
    ior: NDArray[np.float64]
    stop: int


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
    if not all(map(math.isfinite, (*surface[:4], near))):
        raise ValueError(f"{name} has a number that is not finite; flat glass has the curvature 0")
    if surface.ior <= 0.0 or near <= 0.0:
        raise ValueError(f"{name} needs an index greater than 0 on both sides")
    if surface.radius <= 0.0:
        raise ValueError(f"{name} lets no light through: its radius is {surface.radius:g} mm")
    if surface.thickness < 0.0:
        raise ValueError(f"{name} is behind the next one: its thickness is {surface.thickness:g} mm")
    if abs(surface.curvature) * surface.radius > 1.0:
        size = 1.0 / abs(surface.curvature)
        raise ValueError(f"{name} is a sphere of radius {size:g} mm, which reaches no {surface.radius:g} mm far out")
    if surface.is_stop and (surface.curvature != 0.0 or surface.ior != near):
        raise ValueError(f"{name} is the stop, which is flat and has the same index on both sides")


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
    # Neither what misses nor what is no number passes.
    if not square > 0.0:
        return 0.0, (0.0, 0.0, 1.0), 0.0
    cosine = side * math.sqrt(square)
    rest = f / (g + cosine) if g * side > 0.0 else (g - cosine) / curvature
    point = madd(near, rest, direction)
    normal = (-curvature * point[0], -curvature * point[1], 1.0 - curvature * point[2])
    # The far half of the sphere is no part of the surface.
    return before + rest, normal, cosine if normal[2] > 0.0 else 0.0


@kernel
def trace(lens, origin, direction, towards_film):
    """Follow a ray through all surfaces of a lens, from whichever side.

    Parameters
    ----------
    lens : LensSurfaces.
    origin, direction : a point of the ray before the lens (mm), and a unit vector.
    towards_film : whether the ray goes from the scene to the film; else the other way.

    Returns
    -------
    (weight, point on the last surface, direction behind it); weight 0 if the ray does not get through: it misses a
    surface, is stopped by a rim or the diaphragm, or is totally reflected.
    """
    count = len(lens.curvature)
    side = 1.0 if towards_film else -1.0
    for step in range(count):
        surface = step if towards_film else count - 1 - step
        distance, normal, cosine = meet_surface(lens.curvature[surface], lens.vertex[surface], origin, direction, side)
        point = madd(origin, distance, direction)
        radius = lens.radius[surface]
        # What is no number is stopped too.
        if cosine == 0.0 or not point[0] * point[0] + point[1] * point[1] <= radius * radius:
            return 0.0, origin, direction

        # Refract with the normal against the ray.
        near, far = (surface, surface + 1) if towards_film else (surface + 1, surface)
        eta = lens.ior[far] / lens.ior[near]
        cos_i = min(1.0, abs(cosine))
        _, cos_t = fresnel_dielectric(cos_i, eta)
        if cos_t == 0.0:
            return 0.0, origin, direction
        against = (-side * normal[0], -side * normal[1], -side * normal[2])
        origin, direction = point, refract(direction, against, cos_i, cos_t, eta)
    return 1.0, origin, direction


@entry
def trace_ray(lens, origin, direction, towards_film):
    """`trace`, for Python."""
    return trace(lens, origin, direction, towards_film)
