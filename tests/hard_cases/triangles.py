"""What is flat: the diagonals of quads, the edges and vertices of closed meshes, and rays that leave a plane."""

import math

import numpy as np
import trimesh

from raytracer.core.geometry import pad_buffer
from raytracer.core.primitives.triangles import Triangles
from tests.hard_cases.harness import hard_case
from tests.plugins.shapes.kernels import built, cast, spawn, uniform_directions, unit
from tests.plugins.shapes.test_offsets import SCALES, flat


@hard_case(11, "mitsuba3, test_scene.py; Woop et al. 2013, JCGT 2(1)", "diagonal", quick=100_000, thorough=10_000_000)
def diagonal_of_a_quad(rays):
    """Rays at the diagonal along which a quad is cut into two triangles: none passes between them.

    Without Embree's robust flag each triangle decides by itself whether a ray is within, and some are in neither.
    """
    table = flat("parallelogram", 1.0)
    corner, u, v = table.corner[0], table.u[0], table.v[0]
    accels = built(table, robust=False), built(table)
    for first in range(0, rays, 1_000_000):
        count = min(1_000_000, rays - first)
        targets = corner + u + np.random.default_rng(first).random((count, 1)) * (v - u)
        origins = targets + 2.0 * unit(uniform_directions(count, first + 1) + 1.5 * unit(np.cross(u, v)))
        ways = unit(targets - origins)
        yield "rays that pass through", *(cast((table,), origins, ways, accel=accel).table < 0 for accel in accels)


_LEAKS_AT_VERTICES = 5e-4
"""Of rays aimed at a vertex to the last bit, the part that may leak, as measured with Embree 4.4 for this mesh.

Each of the edges that meet there decides by the rounding of its own product on which side the ray passes, and if all
of them agree by chance, no triangle has it: 3.4e-4 with AVX-512, 3.3e-4 with AVX2, 4.3e-4 with SSE2, on rays as single
ones or in packets.  The zone is 1e-6 of the distance wide, so of rays at random 1e-12 meet it; a second look with a
direction moved by 2^-16 finds all that leaked, but costs a third more rays where much of the sky is seen."""


@hard_case(12, "Embree 4.4, measured; Woop et al. 2013, JCGT 2(1)", "closed_mesh", quick=60_000, thorough=30_000_000)
def closed_mesh(rays):
    """Rays from inside a closed mesh: at random, at its edges, at its vertices, and just beside these.

    Neighbours share edges to the bit, and Embree's robust test gives both the same answer there.  At the vertices
    themselves it does not, see `_LEAKS_AT_VERTICES`; the tolerance has four standard deviations of their number more.
    """
    # 1280 triangles from 0.9 to 1.1 m away from the origin.
    mesh = trimesh.creation.icosphere(3)
    points = np.array(mesh.vertices) * np.random.default_rng(1).uniform(0.9, 1.1, (len(mesh.vertices), 1))
    faces = np.array(mesh.faces)
    table = Triangles(pad_buffer(points, np.float32), pad_buffer(faces, np.uint32), np.zeros(len(faces), np.int32))
    vertices = table.vertices.astype(np.float64)
    accels = built(table, robust=False), built(table)
    count, rounds = min(500_000, rays // 3), math.ceil(rays / 1_500_000)
    at_vertices = np.zeros(2, np.int64)
    for seed in range(rounds):
        rng = np.random.default_rng(seed)
        origins = 0.5 * rng.uniform(-1.0, 1.0, (count, 3))
        face = faces[rng.integers(0, len(faces), count)]
        start, end, t = vertices[face[:, 0]], vertices[face[:, 1]], rng.random((count, 1))
        beside = start + 1e-5 * unit(rng.normal(size=(count, 3)))
        targets = (rng.normal(size=(count, 3)), start + t * (end - start), beside, start)
        leaks = np.array(
            [
                [(cast((table,), origins, unit(target - origins), accel=accel).table < 0).sum() for accel in accels]
                for target in targets
            ]
        )
        assert leaks[0, 1] == 0, "at random"
        yield "leaks at edges", *leaks[1]
        yield "leaks 1e-5 m beside vertices", *leaks[2]
        at_vertices += leaks[3]
    total = count * rounds
    most = _LEAKS_AT_VERTICES + 4.0 * math.sqrt(_LEAKS_AT_VERTICES / total)
    yield "part of the rays that leak at vertices", *(at_vertices / total), most


_OFFSETS = "Waechter, Binder 2019, Ray Tracing Gems ch. 6; pbrt-v4, sec. 6.8.6; measured with Embree 4.4"
_NEAREST = 1e-3
_NUDGE = 1e-4


@hard_case(15, _OFFSETS, "sizes", quick=10_000, thorough=1_000_000)
def tilted_planes_of_all_sizes(rays):
    """Rays that leave a tilted plane of 1 mm, 1 m, 1 km or 1000 km to either side: what is flat is not met twice.

    Lengths that suit one size, as a least distance of 1 mm or 0.1 mm along the normal, are too short for another;
    4 ulp of the plane's own coordinates suit all, and leave a plane of 1 mm in its place.
    """
    for size in SCALES:
        table = (flat("parallelogram", size),)
        accel = built(*table)
        middle = size * (np.array([0.7, 0.3, -0.2]) + 0.5 * np.array([0.8, 1.2, 0.7]))
        origins = middle + 3.0 * size * uniform_directions(rays, 1)
        ways = unit(middle + 0.5 * size * np.random.default_rng(2).uniform(-1.0, 1.0, (rays, 3)) - origins)
        hits = cast(table, origins, ways, accel=accel)
        met = hits.table == 0
        points, normals, onwards = hits.point[met], hits.normal[met], uniform_directions(rays, 3)[met]
        starts = spawn(table, origins[met], ways[met], onwards, accel=accel)
        nudged = points + _NUDGE * np.sign((onwards * normals).sum(axis=1))[:, None] * normals
        ours, bare, beyond = (cast(table, place, onwards, accel=accel) for place in (starts, points, nudged))
        again = ours.table == 0
        yield "self-hits, against no offset", bare.table == 0, again
        yield "self-hits, against a least distance of 1 mm", (bare.table == 0) & (bare.near > _NEAREST), again
        yield "self-hits, against 0.1 mm along the normal", beyond.table == 0, again
