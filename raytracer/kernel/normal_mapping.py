"""Relief: bump and normal maps, and how surfaces scatter whose shading normal is not the geometric one.

A scene has a `Relief` where a material has such a map, or a mesh normals of its vertices.  What keeps the energy then
is derived in `shading_normals`.

References: Blinn 1978, "Simulation of Wrinkled Surfaces", SIGGRAPH 78; Mikkelsen 2010, "Bump Mapping Unparametrized
Surfaces on the GPU", Journal of Graphics Tools 15(1), eq. 2 to 4 (surface gradients).
"""

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.instances import Instances, pose_of
from raytracer.integrator import evaluate_from, scatter_from, shading_normal
from raytracer.jit import generic, kernel
from raytracer.materials.interface import BLACK, MaterialSpec, Scatter, absorbed, evaluate_at, scatter_at
from raytracer.motion import apply_vector, invert
from raytracer.primitives.interface import has_vertex_normals
from raytracer.shading_normals import into_wedge, out_of_wedge, tilt_of, turned_to
from raytracer.textures.interface import Book, slope_at, texture_at
from raytracer.vec import Vec3, add, cross, dot, is_black, madd, neg, norm, normalize, reflect, scale


class NormalMaps(NamedTuple):
    """By material reference: texture (n,) int32, its reference or -1; strength (n,) float64."""

    texture: NDArray[np.int32]
    strength: NDArray[np.float64]


class Bumps(NamedTuple):
    """By material reference: texture (n,) int32, its reference or -1; height (n,) float64, of its value 1 (m)."""

    texture: NDArray[np.int32]
    height: NDArray[np.float64]


class Relief(NamedTuple):
    """normal_maps and bumps, each of which may be None: both, where only vertices have normals of their own."""

    normal_maps: NormalMaps | None
    bumps: Bumps | None


def pack_relief(materials: Iterable[tuple[MaterialSpec, int]], book: Book, primitives: Iterable[Any]) -> Relief | None:
    """Pack the relief of materials, each with its reference; None where no shading normal differs from the true one.

    Parameters
    ----------
    primitives : the tables of the scene, which may have normals of vertices.
    """
    rows = list(materials)
    size = 1 + max((reference for _, reference in rows), default=0)
    maps = NormalMaps(np.full(size, -1, np.int32), np.ones(size))
    bumps = Bumps(np.full(size, -1, np.int32), np.zeros(size))
    for material, reference in rows:
        if material.normal_scale != 0.0:
            maps.texture[reference] = book.reference(material.normal_map)
            maps.strength[reference] = material.normal_scale
        if material.bump_height != 0.0:
            bumps.texture[reference] = book.reference(material.bump)
            bumps.height[reference] = material.bump_height
    mapped, bumped = (bool(np.any(table.texture >= 0)) for table in (maps, bumps))
    if mapped or bumped:
        return Relief(maps if mapped else None, bumps if bumped else None)
    return relief_of_vertices(primitives)


def relief_of_vertices(primitives: Iterable[Any]) -> Relief | None:
    """Make the relief of a scene without maps; None where no table has normals of vertices either."""
    return Relief(None, None) if any(has_vertex_normals(table) for table in primitives) else None


# ---- The shading normal


@generic
def into_group(instances, instance, time, vector):
    """A vector of the world in the space in which solid textures of an instance are looked up."""
    raise NotImplementedError


@into_group.register(type(None))
def _(instances, instance, time, vector):
    return vector


@into_group.register(Instances)
def _(instances, instance, time, vector):
    if instance < 0:
        return vector
    return apply_vector(invert(pose_of(instances, instance, time)), vector)


@kernel
def from_tangent_space(mapped: Vec3, normal: Vec3, tangent: Vec3, bitangent: Vec3) -> Vec3:
    """A normal of a normal map: x along dp/du, y to the side of dp/dv, z along the normal; that itself if undefined.

    References: Khronos Group, "glTF 2.0 Specification", sec. 3.9.3 (normal textures, with green upwards).
    """
    s = madd(tangent, -dot(normal, tangent), normal)
    size = norm(s)
    if size == 0.0:
        return normal
    s = scale(1.0 / size, s)
    t = cross(normal, s)
    if dot(t, bitangent) < 0.0:
        t = neg(t)
    found = add(scale(mapped[0], s), add(scale(mapped[1], t), scale(mapped[2], normal)))
    size = norm(found)
    return scale(1.0 / size, found) if size > 0.0 else normal


@kernel
def raised(normal: Vec3, tangent: Vec3, bitangent: Vec3, along_u: float, along_v: float) -> Vec3:
    """The normal of a surface raised by heights that grow by `along_u` and `along_v` a unit of u and v."""
    volume = dot(normal, cross(tangent, bitangent))
    if volume == 0.0:
        return normal
    across = add(scale(along_u, cross(bitangent, normal)), scale(along_v, cross(normal, tangent)))
    return normalize(madd(normal, -1.0 / volume, across))


@generic
def _mapped(normal_maps, scene, hit, reference, site, normal):
    """The normal after normal maps."""
    raise NotImplementedError


@_mapped.register(type(None))
def _(normal_maps, scene, hit, reference, site, normal):
    return normal


@_mapped.register(NormalMaps)
def _(normal_maps, scene, hit, reference, site, normal):
    found = normal_maps.texture[reference]
    if found < 0:
        return normal
    r, g, b = texture_at(scene.textures, found, site)
    strength = normal_maps.strength[reference]
    mapped = (strength * (2.0 * r - 1.0), strength * (2.0 * g - 1.0), 2.0 * b - 1.0)
    return from_tangent_space(mapped, normal, hit.tangent, hit.bitangent)


@generic
def _bumped(bumps, scene, hit, instance, reference, site, time, normal):
    """The normal after bump maps."""
    raise NotImplementedError


@_bumped.register(type(None))
def _(bumps, scene, hit, instance, reference, site, time, normal):
    return normal


@_bumped.register(Bumps)
def _(bumps, scene, hit, instance, reference, site, time, normal):
    found = bumps.texture[reference]
    if found < 0:
        return normal
    tangent = into_group(scene.instances, instance, time, hit.tangent)
    bitangent = into_group(scene.instances, instance, time, hit.bitangent)
    along_u, along_v = slope_at(scene.textures, found, site, tangent, bitangent)
    height = bumps.height[reference]
    return raised(normal, hit.tangent, hit.bitangent, height * along_u, height * along_v)


@shading_normal.register(Relief)
def shading_normal_with_relief(relief, scene, hit, instance, reference, site, direction, front, time):
    """Shade with the normal after maps, turned to the side that light arrives from and not away from there."""
    normal = _mapped(relief.normal_maps, scene, hit, reference, site, hit.shading_normal)
    normal = _bumped(relief.bumps, scene, hit, instance, reference, site, time, normal)
    sign = 1.0 if front else -1.0
    return turned_to(scale(sign, normal), neg(direction), scale(sign, hit.normal))


# ---- What is scattered


@scatter_from.register(Relief)
def scatter_from_tilted(relief, scene, hit, reference, site, direction, normal, front, draws):
    """Scatter by the shading normal, to the side of the true surface that the material meant."""
    out = scatter_at(scene, reference, site, direction, normal, front, draws)
    if is_black(out.weight):
        return out
    transmitted = dot(normal, out.direction) < 0.0
    tilt = tilt_of(hit.normal if front else neg(hit.normal), normal, direction, transmitted)
    rise = dot(tilt.up, out.direction)
    if rise == 0.0:
        return absorbed(direction)
    if rise > 0.0:
        if math.isinf(out.pdf):
            return out
        other, spread = into_wedge(tilt, out.direction)
        if spread == 0.0:
            return out
        _, pdf = evaluate_at(scene, reference, site, direction, normal, front, other)
        return Scatter(out.direction, out.weight, out.pdf + spread * pdf)
    if tilt.spread == 0.0:
        return Scatter(reflect(out.direction, tilt.up), out.weight, out.pdf)
    turned = out_of_wedge(tilt, out.direction)
    _, pdf = evaluate_at(scene, reference, site, direction, normal, front, turned)
    return Scatter(turned, out.weight, tilt.spread * out.pdf + pdf)


@evaluate_from.register(Relief)
def evaluate_from_tilted(relief, scene, hit, reference, site, direction, normal, front, outgoing):
    """Evaluate by the shading normal what `scatter_from_tilted` sends to `outgoing`."""
    transmitted = (dot(hit.normal, outgoing) < 0.0) == front
    if (dot(normal, outgoing) < 0.0) != transmitted:
        return BLACK, 0.0
    value, pdf = evaluate_at(scene, reference, site, direction, normal, front, outgoing)
    tilt = tilt_of(hit.normal if front else neg(hit.normal), normal, direction, transmitted)
    drawn, spread = into_wedge(tilt, outgoing)
    if spread == 0.0:
        return value, pdf
    more, drawn_pdf = evaluate_at(scene, reference, site, direction, normal, front, drawn)
    return madd(value, spread, more), pdf + spread * drawn_pdf
