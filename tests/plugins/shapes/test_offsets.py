"""Rays that leave a surface do not meet it again, at any scale, and lamps of all sizes; see tests/hard_cases, too.

Through Embree itself: its float32 distances are what the offsets have to make good.
"""

import math
from functools import partial

import numpy as np
import pytest

from raytracer.core.primitives.discs import Discs
from raytracer.core.primitives.parallelograms import Parallelograms
from raytracer.core.primitives.spheres import Spheres
from raytracer.core.primitives.triangles import SmoothTriangles, Triangles
from tests.plugins.shapes.kernels import (
    Stage,
    built,
    cast,
    leave,
    occluded,
    pdf_of,
    sample,
    spawn,
    trace,
    uniform_directions,
    unit,
)

SCALES = (1e-3, 1.0, 1e3, 1e6)


def spheres(center, radius):
    centers = np.atleast_2d(np.asarray(center, np.float64))
    return Spheres(centers, np.atleast_1d(np.asarray(radius, np.float64)), np.zeros(len(centers), np.int32))


def flat(kind, scale):
    """A tilted flat primitive of this size, away from the origin by its size."""
    corner, u, v = (
        scale * np.array([0.7, 0.3, -0.2]),
        scale * np.array([1.0, 0.3, 0.1]),
        scale * np.array([-0.2, 0.9, 0.6]),
    )
    normal = unit(np.cross(u, v))
    material = np.zeros(1, np.int32)
    if kind == "parallelogram":
        return Parallelograms(corner[None], u[None], v[None], material)
    if kind == "disc":
        return Discs((corner + 0.5 * u + 0.5 * v)[None], normal, np.array([0.6 * scale]), material)
    vertices = np.array([corner, corner + 2.0 * u, corner + 2.0 * v], np.float32)
    return Triangles(vertices, np.array([[0, 1, 2]], np.uint32), material)


@pytest.mark.parametrize("kind", ["parallelogram", "disc", "triangle"])
@pytest.mark.parametrize("scale", SCALES)
def test_rays_leave_flat_surfaces_for_good(kind, scale):
    # Hard case 15: a plane cannot be met twice.  Without an offset half of the rays would meet it.
    table = flat(kind, scale)
    count = 50_000
    middle = scale * (np.array([0.7, 0.3, -0.2]) + 0.5 * np.array([0.8, 1.2, 0.7]))
    origins = middle + 3.0 * scale * uniform_directions(count, 1)
    targets = middle + 0.5 * scale * np.random.default_rng(2).uniform(-1.0, 1.0, (count, 3))
    onwards, accel = uniform_directions(count, 3), built(table)
    starts = spawn((table,), origins, unit(targets - origins), onwards, accel=accel)
    left = ~np.isnan(starts[:, 0])
    assert left.sum() > count // 5
    assert not occluded(accel, starts[left], onwards[left], np.inf).any()


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), (0.0, -1.0, 0.0), (30.0, -20.0, 10.0)])
def test_rays_leave_spheres_outwards_for_good(scale, place):
    # Hard case 1: the error of a large sphere is that of |centre| + radius, not of the hit point near the origin.
    center, count = scale * np.array(place), 100_000
    table = (spheres(center, scale),)
    origins = center + 2.0 * scale * uniform_directions(count, 4)
    targets = center + scale * uniform_directions(count, 5) * 0.99
    shoot = partial(trace, Stage(table), built(*table))
    assert (leave(shoot, origins, unit(targets - origins), uniform_directions(count, 6)) == 0).all()


@pytest.mark.parametrize("scale", SCALES)
def test_rays_inside_spheres_meet_the_far_side(scale):
    # From inside, the next hit is the chord's other end, 2 r cos away; a self-hit would be near 0.
    center = scale * np.array([0.5, -1.0, 2.0])
    table = spheres(center, scale)
    count = 100_000
    directions = uniform_directions(count, 7)
    origins = np.tile(center, (count, 1))
    inwards = uniform_directions(count, 8)
    first = cast((table,), origins, directions)
    inwards *= -np.sign((inwards * first.normal).sum(axis=1))[:, None]
    accel = built(table)
    starts = spawn((table,), origins, directions, inwards, accel=accel)
    again = cast((table,), starts, inwards, accel=accel)
    cosine = -(inwards * first.normal).sum(axis=1)
    chord = 2.0 * scale * cosine
    result = np.linalg.norm(again.point - starts, axis=1)
    # Chords shorter than the offset can tell apart, at cosines below 1e-3, may be missed or met at once.
    long = cosine > 1e-3
    assert (again.table[long] == 0).all()
    # The start is off the surface by 4 ulp of the extent, which shortens a chord by that over the cosine.
    offset = 4.0 * 2.0**-23 * 3.0 * scale
    assert (np.abs(result - chord)[long] <= 2.0 * offset / cosine[long]).all()


@pytest.mark.parametrize("distance", [10.0, 1e3, 1e5])
def test_far_spheres_are_met_in_front_and_exactly(distance):
    # Hard case 1: unit spheres within an impact parameter of 0.999; however near the limb, the near side is met.
    count = 20_000
    rng = np.random.default_rng(11)
    b, phi = 0.999 * np.sqrt(rng.random(count)), 2.0 * np.pi * rng.random(count)
    table = spheres([0.0, 0.0, 0.0], 1.0)
    origins = np.column_stack([b * np.cos(phi), b * np.sin(phi), np.full(count, distance)])
    hits = cast((table,), origins, np.tile([0.0, 0.0, -1.0], (count, 1)))
    met = hits.table == 0
    # From 1e5 radii, float32 cannot tell 0.998 of a radius from 1: hard case 2 warns there.
    assert (~met).sum() == 0 if distance < 1e5 else met.mean() > 0.99
    height = np.sqrt(1.0 - b * b)
    assert (hits.normal[met, 2] > 0.0).all()
    # The height of the closest approach is known to the rounding of the distance, 1e-16 d / height.
    assert (np.abs(hits.point[met, 2] - height[met]) * height[met] <= 4e-16 * distance + 1e-15).all()


@pytest.mark.parametrize(("distance", "radius"), [(1e4, 1.0), (1e8, 1.0), (1.0 + 1e-5, 1.0)])
def test_cone_of_a_sphere_light_keeps_its_density_finite(distance, radius):
    # Hard case 10: the solid angle is 2 pi s^2 / (1 + sqrt(1 - s^2)), s = r / d; 1 - cos is 0 in float32 at d = 1e4.
    table = spheres([0.0, 0.0, 0.0], radius)
    points = sample((table,), 0, 0, [distance, 0.0, 0.0], np.random.default_rng(13).random((1000, 2)))
    squared = (radius / distance) ** 2
    solid_angle = 2.0 * math.pi * squared / (1.0 + math.sqrt(1.0 - squared))
    np.testing.assert_allclose(points.pdf, 1.0 / solid_angle, rtol=1e-7)
    np.testing.assert_allclose(np.linalg.norm(points.point, axis=1), radius, rtol=1e-14)
    assert (points.normal[:, 0] >= radius / distance - 1e-7).all()


@pytest.mark.parametrize("distance", [1.0 - 2.0**-52, 1.0, 1.0 + 2.0**-52, 1.0 + 1e-9])
def test_a_sphere_is_drawn_by_area_from_points_on_it(distance):
    # Such as those of glowing glass that lights itself; which side of the sphere rounding puts them on must not matter.
    table = (spheres([0.0, 0.0, 0.0], 1.0),)
    points = sample(table, 0, 0, [distance, 0.0, 0.0], np.random.default_rng(13).random((4000, 2)))
    assert abs(points.point[:, 0].mean()) < 4.0 / math.sqrt(3.0 * 4000)
    # A chord c meets the sphere at the cosine c / 2: c^2 / (4 pi c / 2) = c / (2 pi).
    chord = np.linalg.norm(points.point - [distance, 0.0, 0.0], axis=1)
    np.testing.assert_allclose(points.pdf, chord / (2.0 * math.pi), rtol=1e-4)
    result = pdf_of(table, 0, 0, [distance, 0.0, 0.0], points.point, points.normal)
    np.testing.assert_allclose(result, points.pdf, rtol=1e-9)


def test_the_far_side_of_a_sphere_is_not_aimed_at():
    # From outside only the near side is drawn, so what is seen of the far one through holes is left to paths.
    table = (spheres([0.0, 0.0, 0.0], -1.0),)
    points = sample(table, 0, 0, [3.0, 0.0, 0.0], np.random.default_rng(13).random((1000, 2)))
    way = unit(points.point - [3.0, 0.0, 0.0])
    far = points.point - 2.0 * (points.point * way).sum(axis=1)[:, None] * way
    np.testing.assert_allclose(np.linalg.norm(far, axis=1), 1.0, rtol=1e-12)
    np.testing.assert_allclose(
        pdf_of(table, 0, 0, [3.0, 0.0, 0.0], points.point, points.normal), points.pdf, rtol=1e-12
    )
    assert not pdf_of(table, 0, 0, [3.0, 0.0, 0.0], far, -far).any()


@pytest.mark.parametrize("exact", [True, False])
def test_what_accuracy_adds(exact):
    # `exact` solves the hit again, to 1e-15 of the distance; `fast` takes Embree's float32 distance along the ray.
    table = flat("parallelogram", 1.0)
    corner, u, v = table.corner[0], table.u[0], table.v[0]
    a = np.random.default_rng(16).random((2000, 2))
    targets = corner + a[:, :1] * u + a[:, 1:] * v
    origins = targets + 100.0 * unit(uniform_directions(len(a), 17) + 1.5 * unit(np.cross(u, v)))
    hits = cast((table,), origins, unit(targets - origins), exact=exact)
    off = np.linalg.norm(hits.point - targets, axis=1)
    if exact:
        assert off.max() < 1e-12
        np.testing.assert_allclose(hits.uv, a, atol=1e-12)
    else:
        # Half an ulp of 100 m is 3.8e-6 m; a few of them add up, more so at a slant.
        assert 1e-6 < off.max() < 1e-4


def test_vertex_normals_that_cancel_leave_the_face_its_own():
    # Half of one normal and half of its opposite: 0 / 0 in place of a direction, where a file's normals are that bad.
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], np.float32)
    bent = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.0, 0.0, -1.0]], np.float32)
    table = SmoothTriangles(corners, np.array([[0, 1, 2]], np.uint32), np.zeros(1, np.int32), None, bent)
    hits = cast((table,), [0.25, 0.25, 1.0], [0.0, 0.0, -1.0])
    np.testing.assert_array_equal(hits.shading_normal[0], [0.0, 0.0, 1.0])
