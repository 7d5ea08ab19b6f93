"""Relief: bump and normal maps, which turn the normal that a surface is shaded with, and what keeps the energy then.

Let g be the true normal and n the shading normal, both turned to the side that light arrives from, and let the
material, shaded with n, send light toward w with the value V(w) = f |cos| and draw w with the density p(w).  It
reflects where n . w > 0 and transmits where n . w < 0; but where g . w has the other sign, reflected light would go
into the surface and transmitted light would stay out.  Such directions are mirrored at the true surface:

    m(w) = w - 2 (g . w) g,    w' = w if the signs of n . w and g . w are equal, else m(w).

So what is reflected stays on the side it came from, and what is transmitted goes through.  Since m is its own inverse
and keeps solid angles, w' has the density, and the value,

    p'(w') = [w'] p(w') + [m(w')] p(m(w')),    V'(w') = [w'] V(w') + [m(w')] V(m(w')),

where [x] is 1 if n . x has the sign of g . w', the side aimed at, and else 0: for a direction w that keeps its place
n . w has the sign of g . w = g . w', and for one that is mirrored to w' the other one, that of g . m(w) = g . w'.
Both integrals over w' are those over w, so no energy is lost or made, and no direction leaves on the wrong side.  A
sample's weight stays V(w) / p(w): given w', its mean over the two directions that may have led there, in proportion to
their densities, is V'(w') / p'(w').  Where n = g nothing is mirrored, and all is as without relief.

References: Blinn 1978, "Simulation of Wrinkled Surfaces", SIGGRAPH 78; Mikkelsen 2010, "Bump Mapping Unparametrized
Surfaces on the GPU", Journal of Graphics Tools 15(1), eq. 2 to 4 (surface gradients); Veach 1997, thesis, sec. 5.3
(shading normals).
"""

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.geometry import leaks
from raytracer.instances import Instances, pose_of
from raytracer.integrator import evaluate_from, scatter_from, shading_normal
from raytracer.jit import generic, kernel
from raytracer.materials.interface import BLACK, MaterialSpec, Scatter, absorbed, evaluate_at, scatter_at
from raytracer.motion import apply_vector, invert
from raytracer.textures.interface import Book, slope_at, texture_at
from raytracer.vec import Vec3, add, cross, dot, is_black, madd, neg, norm, normalize, reflect, scale

# The least cosine between a shading normal and the viewer: its square is what float64 can tell from 0 beside 1.
_GRAZING = 2.0**-26


class NormalMaps(NamedTuple):
    """By material reference: texture (n,) int32, its reference or -1; strength (n,) float64."""

    texture: NDArray[np.int32]
    strength: NDArray[np.float64]


class Bumps(NamedTuple):
    """By material reference: texture (n,) int32, its reference or -1; height (n,) float64, of its value 1 (m)."""

    texture: NDArray[np.int32]
    height: NDArray[np.float64]


class Relief(NamedTuple):
    """normal_maps and bumps, of which one may be None."""

    normal_maps: NormalMaps | None
    bumps: Bumps | None


def pack_relief(materials: Iterable[tuple[MaterialSpec, int]], book: Book) -> Relief | None:
    """The relief of materials, each with its reference; None where none has any."""
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
    return Relief(maps if mapped else None, bumps if bumped else None) if mapped or bumped else None


# ---- The shading normal


@generic
def _texture_of(table, reference):
    """The texture of a material, -1 for none."""
    raise NotImplementedError


@_texture_of.register(type(None))
def _(table, reference):
    return -1


@_texture_of.register(NormalMaps)
@_texture_of.register(Bumps)
def _(table, reference):
    return table.texture[reference]


@kernel
def _has_relief(relief, reference):
    return _texture_of(relief.normal_maps, reference) >= 0 or _texture_of(relief.bumps, reference) >= 0


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


@kernel
def turned_to(normal: Vec3, viewer: Vec3, geometric: Vec3) -> Vec3:
    """The nearest normal to `normal` that does not face away from the unit vector `viewer`."""
    if dot(normal, viewer) >= _GRAZING:
        return normal
    along = madd(normal, -dot(normal, viewer), viewer)
    size = norm(along)
    # A normal that looks straight away has no nearest one.
    return normalize(madd(scale(1.0 / size, along), _GRAZING, viewer)) if size > 0.0 else geometric


@shading_normal.register(Relief)
def _(relief, scene, hit, instance, reference, site, direction, front, time):
    normal = hit.shading_normal
    if not _has_relief(relief, reference):
        return normal if front else neg(normal)
    normal = _mapped(relief.normal_maps, scene, hit, reference, site, normal)
    normal = _bumped(relief.bumps, scene, hit, instance, reference, site, time, normal)
    sign = 1.0 if front else -1.0
    return turned_to(scale(sign, normal), neg(direction), scale(sign, hit.normal))


# ---- What is scattered


@kernel
def other_preimage(outgoing: Vec3, normal: Vec3, shading: Vec3, transmitted: bool) -> tuple[Vec3, bool]:
    """The mirror image of a direction, and whether the material may have drawn it for the same side."""
    image = reflect(outgoing, normal)
    return image, (dot(shading, image) < 0.0) == transmitted


@scatter_from.register(Relief)
def _(relief, scene, hit, reference, site, direction, normal, front, draws):
    out = scatter_at(scene, reference, site, direction, normal, front, draws)
    if not _has_relief(relief, reference):
        return absorbed(direction) if leaks(hit, out.direction) else out
    if is_black(out.weight):
        return out
    transmitted = dot(normal, out.direction) < 0.0
    image, was_possible = other_preimage(out.direction, hit.normal, normal, transmitted)
    through = (dot(hit.normal, out.direction) < 0.0) == front
    kept = out.direction if transmitted == through else image
    if not was_possible or math.isinf(out.pdf):
        return Scatter(kept, out.weight, out.pdf)
    _, pdf = evaluate_at(scene, reference, site, direction, normal, front, image)
    return Scatter(kept, out.weight, out.pdf + pdf)


@evaluate_from.register(Relief)
def _(relief, scene, hit, reference, site, direction, normal, front, outgoing):
    if not _has_relief(relief, reference):
        if leaks(hit, outgoing):
            return BLACK, 0.0
        return evaluate_at(scene, reference, site, direction, normal, front, outgoing)
    through = (dot(hit.normal, outgoing) < 0.0) == front
    value, density = BLACK, 0.0
    preimage = outgoing
    for _ in range(2):
        if (dot(normal, preimage) < 0.0) == through:
            part, pdf = evaluate_at(scene, reference, site, direction, normal, front, preimage)
            value = add(value, part)
            density += pdf
        preimage = reflect(outgoing, hit.normal)
    return value, density
