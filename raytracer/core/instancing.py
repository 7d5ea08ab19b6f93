"""Instances: groups of primitives that are placed many times, or move, and their intersection with rays.

All primitives of all groups lie in the scene's tables, each group as a range of rows, in a space of its own.  Embree
finds the instance and the primitive in float32; here the ray is taken into the group's space in float64, the hit is
solved there by the primitive's own code, and what it found is brought back.

References: Pharr et al. 2023, "Physically Based Rendering", 4th ed., sec. 7.1.2 (object instancing) and 3.10.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import kernel, optional
from raytracer.core.geometry import Hit, LightPoint
from raytracer.core.motion.interpolation import (
    Trajectories,
    apply_normal,
    apply_point,
    apply_transpose,
    apply_vector,
    invert,
    pose_at,
)
from raytracer.core.primitives.base.interface import hit_any, pdf_point_any, sample_point_any
from raytracer.core.sampling.warp import first_above
from raytracer.core.vec import add, dot, norm, scale, sub


class EmissiveInstances(NamedTuple):
    """Sampling tables of instances that emit.

    An emitter is chosen by variant, one for each group and each material that replaces its own, and then among the
    variant's instances by size.  Variant 0 is all that is in no instance.

    Attributes
    ----------
    variant : int32 (n,), the variant of each instance, -1 if it does not emit.
    probability : float64 (n,), of the instance among those of its variant.
    first : int32 (variants + 1,), the first entry of each variant in the two that follow.
    member : int32 (m,), instances.
    cumulative : float64 (m,), the sum of probabilities of a variant's instances up to this one.
    """

    variant: NDArray[np.int32]
    probability: NDArray[np.float64]
    first: NDArray[np.int32]
    member: NDArray[np.int32]
    cumulative: NDArray[np.float64]


class Instances(NamedTuple):
    """Table of instances, first those at rest, then those that move.

    Attributes
    ----------
    group : int32 (n,), the group that each places.
    pose : float64 (m, 3, 4), from the group's space to the world's, of those at rest.
    trajectories : of those that move, or None.
    material : int32 (n,), the reference that replaces the primitives' own, -1 for none; None if no instance has one.
    rows : int32 (groups, tables), the first row of a group's primitives in each table.
    arrays : int32 (k,), the first instance of each of Embree's instance arrays.
    base : Embree's number of the first of these arrays.
    emissive : EmissiveInstances if any of them emits, or None.
    """

    group: NDArray[np.int32]
    pose: NDArray[np.float64]
    trajectories: Trajectories | None
    material: NDArray[np.int32] | None
    rows: NDArray[np.int32]
    arrays: NDArray[np.int32]
    base: int
    emissive: EmissiveInstances | None


# ---- Look-up


@optional
def resolve_instance(instances, table, primitive, array, placement):
    """Translate Embree's numbers of a hit: the instance, -1 for none, and the primitive's row in its table."""
    return -1, primitive


@resolve_instance.register(Instances)
def resolve_instance_instances(instances, table, primitive, array, placement):
    row = np.int64(primitive)
    # Embree's number for no instance is -1, unsigned.
    if np.int32(array) < 0:
        return -1, row
    instance = np.int64(instances.arrays[np.int64(array) - instances.base]) + np.int64(placement)
    return instance, row + instances.rows[instances.group[instance], table]


# ---- Group space and world space

_POSE_ULPS = 2.0 * 2.0**-23
"""Error of Embree's float32 poses: one ulp held for 490,000 rays, over six decades of scale and of distance."""

ROTATION_ERROR = 32.0 * 2.0**-23
"""Error (rad) of its angles between two poses: up to 1.6e-6 was measured."""

_IDENTITY = ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0))


@kernel
def _static_pose(pose, index):
    return (
        (pose[index, 0, 0], pose[index, 0, 1], pose[index, 0, 2], pose[index, 0, 3]),
        (pose[index, 1, 0], pose[index, 1, 1], pose[index, 1, 2], pose[index, 1, 3]),
        (pose[index, 2, 0], pose[index, 2, 1], pose[index, 2, 2], pose[index, 2, 3]),
    )


@kernel
def _pose_at_time(trajectories, pose, instance, time):
    if trajectories is None:
        return _static_pose(pose, instance)
    if instance < len(pose):
        return _static_pose(pose, instance)
    return pose_at(trajectories, instance - len(pose), time)


@kernel
def pose_of(instances, instance, time):
    """Return the map from the group's space to the world's, at a time: three rows (linear | translation)."""
    return _pose_at_time(instances.trajectories, instances.pose, instance, time)


@kernel
def _magnitudes(affine, v):
    """Sum the magnitudes of the products that `apply_vector` adds up."""
    a, b, c = affine
    sizes = _abs(v)
    return dot(_abs(a), sizes), dot(_abs(b), sizes), dot(_abs(c), sizes)


@kernel
def _abs(v):
    return abs(v[0]), abs(v[1]), abs(v[2])


@kernel
def _embree_position_error(pose, inverse, point, normal):
    """Bound Embree's error of `point`, of world space, along a normal of the group's space (m there).

    Embree inverts the pose in float32 for each ray: W + dW in place of W = A^-1.  It then takes a point q to
    W q - W b, whose rounding is within a few ulp of |W| (|q| + |b|); and dW, which the inversion by cofactors leaves
    within a few ulp of |W| |A| |W|, adds dW (q - b).

    References: Higham 2002, "Accuracy and Stability of Numerical Algorithms", 2nd ed., sec. 3.5 and 14.1.
    """
    shift = (pose[0][3], pose[1][3], pose[2][3])
    reach = _magnitudes(pose, _magnitudes(inverse, sub(point, shift)))
    total = add(add(_abs(point), _abs(shift)), reach)
    return _POSE_ULPS * dot(_abs(normal), _magnitudes(inverse, total))


@kernel
def _rotation_error(trajectories, still, instance, pose, point):
    """Bound Embree's error (m) of a world point by its float32 angle, if the instance moves: angle times radius."""
    if trajectories is None:
        return 0.0
    if instance < still:
        return 0.0
    row = trajectories.first[instance - still]
    shift = (trajectories.rows[row, 6], trajectories.rows[row, 7], trajectories.rows[row, 8])
    return ROTATION_ERROR * (norm(shift) + norm(sub(point, (pose[0][3], pose[1][3], pose[2][3]))))


@kernel
def _surface_error(instances, instance, pose, inverse, point, normal):
    """Bound Embree's error (m) of a world point off its surface, along `normal` of the group's space."""
    swing = _rotation_error(instances.trajectories, len(instances.pose), instance, pose, point)
    return _embree_position_error(pose, inverse, point, normal) / _slope(inverse, normal) + swing


@kernel
def _slope(inverse, normal):
    """Return the length in the group's space of one metre along a world normal, along the normal that it comes from."""
    return norm(apply_transpose(inverse, normal))


@kernel
def _determinant(affine):
    a, b, c = affine
    return a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0])


@kernel
def _density_in_world(pose, direction, pdf):
    """Convert a density over directions of the group's space, at unit `direction`, to directions of the world.

    The directions w' = A w / |A w| have dw' = |det A| / |A w|^3 dw: the volume that a cone of unit length fills is
    scaled by |det A|, and its length by |A w|.
    """
    stretch = norm(apply_vector(pose, direction))
    return pdf * stretch * stretch * stretch / abs(_determinant(pose))


@kernel
def _material(override, instance, own):
    if override is None:
        return own
    given = override[instance]
    return given if given >= 0 else own


# ---- Hits


@kernel
def intersect_instance(instances, scene, instance, table, primitive, origin, direction, near, time):
    """Solve the hit that Embree found at distance `near`: a geometry.Hit in world space; `instance` is -1 for none."""
    if instances is None:
        return hit_any(scene.primitives, table, primitive, origin, direction, near, time, scene.accuracy)
    # A primitive in no instance keeps its bits.
    start, way, length = origin, direction, 1.0
    pose, inverse = _IDENTITY, _IDENTITY
    if instance >= 0:
        pose = pose_of(instances, instance, time)
        inverse = invert(pose)
        start = apply_point(inverse, origin)
        turned = apply_vector(inverse, direction)
        length = norm(turned)
        way = scale(1.0 / length, turned)
    hit = hit_any(scene.primitives, table, primitive, start, way, near * length, time, scene.accuracy)
    if instance < 0:
        return hit
    point = apply_point(pose, hit.point)
    normal, shading = apply_normal(inverse, hit.normal), apply_normal(inverse, hit.shading_normal)
    error = _surface_error(instances, instance, pose, inverse, point, hit.normal)
    offset = hit.offset / _slope(inverse, hit.normal) + error
    material = _material(instances.material, instance, hit.material)
    tangent, bitangent = apply_vector(pose, hit.tangent), apply_vector(pose, hit.bitangent)
    return Hit(point, normal, shading, hit.u, hit.v, offset, material, tangent, bitangent, hit.local)


# ---- Emitters


@kernel
def sample_instance_point(instances, scene, instance, table, primitive, reference, u1, u2, time):
    """Sample a point on an emitting primitive: a geometry.LightPoint in world space; `instance` is -1 for none."""
    if instances is None:
        return sample_point_any(scene.primitives, table, primitive, reference, u1, u2, time)
    seen_from = reference
    pose, inverse = _IDENTITY, _IDENTITY
    if instance >= 0:
        pose = pose_of(instances, instance, time)
        inverse = invert(pose)
        seen_from = apply_point(inverse, reference)
    on = sample_point_any(scene.primitives, table, primitive, seen_from, u1, u2, time)
    if instance < 0:
        return on
    point, normal = apply_point(pose, on.point), apply_normal(inverse, on.normal)
    way = sub(point, reference)
    distance = norm(way)
    cosine = abs(dot(way, normal)) / distance
    if on.pdf == 0.0 or cosine == 0.0:
        return LightPoint(point, normal, 0.0, distance, on.u, on.v, on.local)
    local_way = sub(on.point, seen_from)
    local_distance = norm(local_way)
    pdf = _density_in_world(pose, scale(1.0 / local_distance, local_way), on.pdf)

    # The shadow ray's origin is misplaced too; along the ray, an error off the surface grows by 1 / cosine.
    off = _surface_error(instances, instance, pose, inverse, point, on.normal)
    off += _surface_error(instances, instance, pose, inverse, reference, on.normal)
    gap = on.gap * distance / local_distance + off / cosine
    return LightPoint(point, normal, pdf, gap, on.u, on.v, on.local)


@kernel
def pdf_instance_point(instances, scene, instance, table, primitive, reference, point, normal, time):
    """Compute the density of `sample_instance_point` in solid angle (1/sr) at a point in world space."""
    if instances is None:
        return pdf_point_any(scene.primitives, table, primitive, reference, point, normal, time)
    seen_from, on, outside = reference, point, normal
    pose = _IDENTITY
    if instance >= 0:
        pose = pose_of(instances, instance, time)
        inverse = invert(pose)
        seen_from, on = apply_point(inverse, reference), apply_point(inverse, point)
        # Normals transform back by the transpose of the pose.
        outside = apply_normal(pose, normal)
    pdf = pdf_point_any(scene.primitives, table, primitive, seen_from, on, outside, time)
    if instance < 0:
        return pdf
    way = sub(on, seen_from)
    return _density_in_world(pose, scale(1.0 / norm(way), way), pdf)


@kernel
def _choose_member(glow, variant, u):
    if glow is None:
        return -1, 1.0
    if variant == 0:
        return -1, 1.0
    member = first_above(glow.cumulative, glow.first[variant], glow.first[variant + 1] - 1, u)
    instance = np.int64(glow.member[member])
    return instance, glow.probability[instance]


@optional
def choose_instance(instances, variant, u):
    """Choose an instance of a variant by a number in [0, 1); returns it and its probability, -1 and 1 for none."""
    return -1, 1.0


@choose_instance.register(Instances)
def choose_instance_instances(instances, variant, u):
    return _choose_member(instances.emissive, variant, u)


@kernel
def _variant_in(glow, instance):
    if glow is None:
        return 0 if instance < 0 else -1, 1.0
    if instance < 0:
        return 0, 1.0
    return np.int64(glow.variant[instance]), glow.probability[instance]


@optional
def variant_of(instances, instance):
    """Return the variant of an instance, -1 if it does not emit, and its probability in `choose_instance`."""
    return 0, 1.0


@variant_of.register(Instances)
def variant_of_instances(instances, instance):
    return _variant_in(instances.emissive, instance)


def pose_rows(matrix: Any) -> NDArray[np.float64]:
    """Return the upper three rows of matrices (..., 4, 4)."""
    return np.ascontiguousarray(np.asarray(matrix, np.float64)[..., :3, :])
