"""Normal mapping: bump and normal maps, and scattering where the shading normal is not the geometric one.

A scene has a `NormalMapping` if a material has such a map, or a mesh normals of its vertices.  What conserves the
energy then is derived in `shading_normals`.

References: Blinn 1978, "Simulation of Wrinkled Surfaces", SIGGRAPH 78; Mikkelsen 2010, "Bump Mapping Unparametrized
Surfaces on the GPU", Journal of Graphics Tools 15(1), eq. 2 to 4 (surface gradients).
"""

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import kernel, optional
from raytracer.core.geometry import is_below_surface
from raytracer.core.instancing import Instances, pose_of
from raytracer.core.motion.interpolation import apply_vector, invert
from raytracer.core.primitives.base.interface import has_vertex_normals
from raytracer.core.shading_normals import into_wedge, normal_tilt, out_of_wedge, turn_towards_viewer
from raytracer.core.vec import Vec3, add, cross, dot, is_black, madd, neg, norm, normalize, reflect, scale
from raytracer.plugins.materials.base.dispatch import evaluate_at, scatter_at
from raytracer.plugins.materials.base.interface import BLACK, PASSTHROUGH, MaterialSpec, Scatter, absorbed_scatter
from raytracer.plugins.textures.base.interface import ParameterPacker, texture_at, texture_gradient_at


class NormalMaps(NamedTuple):
    """Normal maps by material reference: texture (n,) int32, its reference or -1; strength (n,) float64."""

    texture: NDArray[np.int32]
    strength: NDArray[np.float64]


class BumpMaps(NamedTuple):
    """Bump maps by material reference: texture (n,) int32, its reference or -1; height (n,) float64 (m), of value 1."""

    texture: NDArray[np.int32]
    height: NDArray[np.float64]


class NormalMapping(NamedTuple):
    """Normal and bump maps of a scene, each None where there is none: both, if only meshes have vertex normals."""

    normal_maps: NormalMaps | None
    bumps: BumpMaps | None


def pack_normal_mapping(
    materials: Iterable[tuple[MaterialSpec, int]], book: ParameterPacker, primitives: Iterable[Any]
) -> NormalMapping | None:
    """Pack the maps of materials, each with its reference; None where no shading normal differs from the true one.

    Parameters
    ----------
    primitives : the tables of the scene, which may have normals of vertices.
    """
    rows = list(materials)
    size = 1 + max((reference for _, reference in rows), default=0)
    maps = NormalMaps(np.full(size, -1, np.int32), np.ones(size))
    bumps = BumpMaps(np.full(size, -1, np.int32), np.zeros(size))
    for material, reference in rows:
        if material.normal_scale != 0.0:
            maps.texture[reference] = book.reference(material.normal_map)
            maps.strength[reference] = material.normal_scale
        if material.bump_height != 0.0:
            bumps.texture[reference] = book.reference(material.bump)
            bumps.height[reference] = material.bump_height
    mapped, bumped = (bool(np.any(table.texture >= 0)) for table in (maps, bumps))
    if mapped or bumped:
        return NormalMapping(maps if mapped else None, bumps if bumped else None)
    return vertex_normal_mapping(primitives)


def vertex_normal_mapping(primitives: Iterable[Any]) -> NormalMapping | None:
    """Make the normal mapping of a scene without maps; None where no table has normals of vertices either."""
    return NormalMapping(None, None) if any(has_vertex_normals(table) for table in primitives) else None


# ---- The shading normal


@optional
def to_instance_space(instances, instance, time, vector):
    """Transform a vector of the world to the space in which solid textures of an instance are looked up."""
    return vector


@to_instance_space.register(Instances)
def to_instance_space_instances(instances, instance, time, vector):
    if instance < 0:
        return vector
    return apply_vector(invert(pose_of(instances, instance, time)), vector)


@kernel
def from_tangent_space(mapped: Vec3, normal: Vec3, tangent: Vec3, bitangent: Vec3) -> Vec3:
    """Transform a mapped normal: x along dp/du, y to the side of dp/dv, z along the normal, which is kept if undefined.

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
    bent = add(scale(mapped[0], s), add(scale(mapped[1], t), scale(mapped[2], normal)))
    size = norm(bent)
    return scale(1.0 / size, bent) if size > 0.0 else normal


@kernel
def perturb_normal(normal: Vec3, tangent: Vec3, bitangent: Vec3, along_u: float, along_v: float) -> Vec3:
    """Compute the normal of a surface raised by heights that grow by `along_u` and `along_v` a unit of u and v."""
    volume = dot(normal, cross(tangent, bitangent))
    if volume == 0.0:
        return normal
    across = add(scale(along_u, cross(bitangent, normal)), scale(along_v, cross(normal, tangent)))
    return normalize(madd(normal, -1.0 / volume, across))


@optional
def _apply_normal_map(normal_maps, scene, surface, normal):
    """Return the normal after normal maps."""
    return normal


@_apply_normal_map.register(NormalMaps)
def _apply_normal_map_normal_maps(normal_maps, scene, surface, normal):
    texture = normal_maps.texture[surface.material]
    if texture < 0:
        return normal
    r, g, b = texture_at(scene.textures, texture, surface.site)
    strength = normal_maps.strength[surface.material]
    mapped = (strength * (2.0 * r - 1.0), strength * (2.0 * g - 1.0), 2.0 * b - 1.0)
    return from_tangent_space(mapped, normal, surface.hit.tangent, surface.hit.bitangent)


@optional
def _apply_bump_map(bumps, scene, surface, normal):
    """Return the normal after bump maps."""
    return normal


@_apply_bump_map.register(BumpMaps)
def _apply_bump_map_bump_maps(bumps, scene, surface, normal):
    texture = bumps.texture[surface.material]
    if texture < 0:
        return normal
    hit = surface.hit
    tangent = to_instance_space(scene.instances, surface.instance, surface.time, hit.tangent)
    bitangent = to_instance_space(scene.instances, surface.instance, surface.time, hit.bitangent)
    along_u, along_v = texture_gradient_at(scene.textures, texture, surface.site, tangent, bitangent)
    height = bumps.height[surface.material]
    return perturb_normal(normal, hit.tangent, hit.bitangent, height * along_u, height * along_v)


@optional
def shading_normal(normal_mapping, scene, surface):
    """Return the normal that a surface is shaded with, on the side of the incoming ray."""
    return surface.normal


@shading_normal.register(NormalMapping)
def shading_normal_normal_mapping(normal_mapping, scene, surface):
    """Shade with the normal after maps, turned to the side that light arrives from and not away from there."""
    if surface.material == PASSTHROUGH:
        return surface.normal
    normal = _apply_normal_map(normal_mapping.normal_maps, scene, surface, surface.hit.shading_normal)
    normal = _apply_bump_map(normal_mapping.bumps, scene, surface, normal)
    sign = 1.0 if surface.front else -1.0
    return turn_towards_viewer(scale(sign, normal), neg(surface.direction), scale(sign, surface.hit.normal))


# ---- Scattering


@optional
def scatter_surface(normal_mapping, scene, surface, draws):
    """Sample the BSDF of a surface: a Scatter; directions below the true surface are absorbed."""
    out = scatter_at(scene, surface, draws)
    if is_below_surface(surface.hit, out.direction):
        return absorbed_scatter(surface.direction)
    return out


@scatter_surface.register(NormalMapping)
def scatter_surface_normal_mapping(normal_mapping, scene, surface, draws):
    """Scatter by the shading normal, to that side of the true surface on which the material scatters."""
    out = scatter_at(scene, surface, draws)
    if is_black(out.weight):
        return out
    transmitted = dot(surface.normal, out.direction) < 0.0
    tilt = normal_tilt(_geometric_normal(surface), surface.normal, surface.direction, transmitted)
    rise = dot(tilt.up, out.direction)
    if rise == 0.0:
        return absorbed_scatter(surface.direction)
    if rise > 0.0:
        if math.isinf(out.pdf):
            return out
        other, spread = into_wedge(tilt, out.direction)
        if spread == 0.0:
            return out
        _, pdf = evaluate_at(scene, surface, other)
        return Scatter(out.direction, out.weight, out.pdf + spread * pdf)
    if tilt.spread == 0.0:
        return Scatter(reflect(out.direction, tilt.up), out.weight, out.pdf)
    turned = out_of_wedge(tilt, out.direction)
    _, pdf = evaluate_at(scene, surface, turned)
    return Scatter(turned, out.weight, tilt.spread * out.pdf + pdf)


@optional
def evaluate_surface(normal_mapping, scene, surface, outgoing):
    """Evaluate the BSDF of a surface, times the cosine, and its pdf: zero for directions below the true surface."""
    if is_below_surface(surface.hit, outgoing):
        return BLACK, 0.0
    return evaluate_at(scene, surface, outgoing)


@evaluate_surface.register(NormalMapping)
def evaluate_surface_normal_mapping(normal_mapping, scene, surface, outgoing):
    """Evaluate by the shading normal what `scatter_surface_normal_mapping` sends to `outgoing`."""
    transmitted = (dot(surface.hit.normal, outgoing) < 0.0) == surface.front
    if (dot(surface.normal, outgoing) < 0.0) != transmitted:
        return BLACK, 0.0
    value, pdf = evaluate_at(scene, surface, outgoing)
    tilt = normal_tilt(_geometric_normal(surface), surface.normal, surface.direction, transmitted)
    drawn, spread = into_wedge(tilt, outgoing)
    if spread == 0.0:
        return value, pdf
    more, drawn_pdf = evaluate_at(scene, surface, drawn)
    return madd(value, spread, more), pdf + spread * drawn_pdf


@kernel
def _geometric_normal(surface):
    """Return the normal of the true surface, on the side of the incoming ray."""
    return surface.hit.normal if surface.front else neg(surface.hit.normal)
