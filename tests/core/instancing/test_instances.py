"""Instances are equal to geometry in world space: hits, normals, offsets, and sampled light."""

from functools import partial

import numpy as np
import pytest

from raytracer.core.geometry import pad_buffer
from raytracer.core.motion.resolve import resolve_motion
from raytracer.core.motion.spec import Motion, Spin
from raytracer.core.motion.trajectory import compose_trajectories, decompose
from raytracer.core.primitives.discs import Discs
from raytracer.core.primitives.parallelograms import Parallelograms
from raytracer.core.primitives.translated import translate_table
from raytracer.core.primitives.triangles import SmoothTriangles
from raytracer.core.shutter.table import Shutter
from tests.core.instancing.kernels import cast, moving, placed
from tests.core.motion.kernels import poses
from tests.plugins.shapes.kernels import cast as cast_plain
from tests.plugins.shapes.kernels import leave, occluded, sample_on, uniform_directions, unit
from tests.plugins.shapes.test_offsets import flat, spheres


def rotation(seed):
    """A rotation matrix (3, 3), uniform over all."""
    matrix, triangle = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    matrix *= np.sign(np.diag(triangle))
    return matrix * np.sign(np.linalg.det(matrix))


def affine(linear, shift):
    """A matrix (4, 4)."""
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = linear, shift
    return result


MATRICES = {
    "as it is": np.eye(4),
    "turned and moved": affine(rotation(1), [3.0, -2.0, 5.0]),
    "scaled": affine(2.5 * rotation(2), [1.0, 2.0, 3.0]),
    "stretched": affine(rotation(3) @ np.diag([1.0, 3.0, 0.4]) @ rotation(4), [-1.0, 0.5, 2.0]),
    "mirrored": affine(rotation(5) @ np.diag([-1.0, 1.0, 1.0]), [0.0, 4.0, 0.0]),
    "sheared mirror": affine(np.array([[1.0, 0.5, 0.0], [0.0, -1.0, 0.3], [0.2, 0.0, 1.0]]), [1.0, 2.0, 3.0]),
}

every_matrix = pytest.mark.parametrize("matrix", MATRICES.values(), ids=MATRICES)


def rays(matrix, count, seed):
    """Rays from all sides at what lies within 2 of the origin, moved along by the matrix."""
    origins = 5.0 * uniform_directions(count, seed)
    targets = np.random.default_rng(seed).uniform(-1.5, 1.5, (count, 3))
    start, end = (rows @ matrix[:3, :3].T + matrix[:3, 3] for rows in (origins, targets))
    return start, unit(end - start)


def parallelograms(count, seed):
    corner, u, v = np.random.default_rng(seed).uniform(-1.0, 1.0, (3, count, 3))
    return Parallelograms(corner, u, v, np.arange(count, dtype=np.int32))


def baked(table, matrix):
    """Transform parallelograms to world space; a mirror image swaps the edges, so that u x v stays outside."""
    linear = matrix[:3, :3]
    corner, u, v = table.corner @ linear.T + matrix[:3, 3], table.u @ linear.T, table.v @ linear.T
    return Parallelograms(corner, *((u, v) if np.linalg.det(linear) > 0.0 else (v, u)), table.material)


# An octahedron with its radial vertex normals: what interpolates them points outwards, whatever the mirror.
VERTICES = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], np.float32)
FACES = np.array([[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]])
OCTAHEDRON = SmoothTriangles(
    pad_buffer(VERTICES, np.float32), pad_buffer(FACES, np.uint32), np.zeros(8, np.int32), None, VERTICES
)
DISC = Discs(np.array([[0.2, -0.1, 0.3]]), unit([1.0, 2.0, -0.5]), np.array([0.9]), np.zeros(1, np.int32))

KINDS = ("parallelogram", "disc", "triangle", "sphere", "smooth", "flying")
WAY = np.array([1.5, 0.5, -2.0])
SEEN_FROM = np.array([1.4, 1.9, 1.2])
EMITTERS = (
    flat("parallelogram", 1.0),
    DISC,
    flat("triangle", 1.0),
    spheres([0.2, -0.1, 0.3], 0.8),
    OCTAHEDRON,
    translate_table(spheres([0.2, -0.1, 0.3], 0.8), WAY),
)


def only(kind, table=None, place=placed, at=None, **more):
    """A scene of one table, placed; others are there for the type alone, so that one compiled loop serves all tests."""
    number = KINDS.index(kind)
    tables = tuple(table if table is not None and i == number else other for i, other in enumerate(EMITTERS))
    return place(tables, at, only=number, **more)


# ---- Hits


@every_matrix
def test_hits_are_those_of_the_baked_object(matrix):
    table = parallelograms(60, 1)
    origins, directions = rays(matrix, 20_000, 2)
    world = cast_plain((baked(table, matrix),), origins, directions)
    hits = cast(only("parallelogram", table, at=matrix), origins, directions)
    both = (world.table == 0) & (hits.table >= 0)
    assert both.sum() > 10_000
    # Rays that graze an edge within float32 may tell otherwise.
    assert ((world.table == 0) != (hits.table >= 0)).sum() <= 4
    same = both & (world.primitive == hits.primitive)
    assert same.sum() > 0.9995 * both.sum()
    assert (hits.instance[both] == 0).all()

    # Points are kept a spawn offset from edges, which is not the same in the two spaces.
    cosine = np.abs((world.normal * directions).sum(axis=1))
    inner = same & (cosine > 1e-3)
    inner[same] &= ((world.uv[same] > 1e-5) & (world.uv[same] < 1.0 - 1e-5)).all(axis=1)
    assert inner.sum() > 0.99 * same.sum()
    assert np.abs(hits.point - world.point)[inner].max() < 1e-9
    np.testing.assert_allclose(hits.normal[inner], world.normal[inner], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(hits.shading_normal[inner], hits.normal[inner], rtol=0.0, atol=0.0)
    assert (hits.material[inner] == world.material[inner]).all()
    np.testing.assert_allclose(
        hits.local[inner] @ matrix[:3, :3].T + matrix[:3, 3], hits.point[inner], rtol=0.0, atol=1e-12
    )
    np.testing.assert_allclose(
        hits.tangent[inner], table.u[hits.primitive[inner]] @ matrix[:3, :3].T, rtol=0.0, atol=1e-12
    )
    np.testing.assert_allclose(
        hits.bitangent[inner], table.v[hits.primitive[inner]] @ matrix[:3, :3].T, rtol=0.0, atol=1e-12
    )


@every_matrix
def test_a_sphere_becomes_an_ellipsoid(matrix):
    # p = A q + b with |q - c| = r: the quadric |A^-1 (p - b) - c|^2 = r^2, whose gradient is the outside normal.
    center, radius = np.array([0.2, -0.1, 0.3]), 0.8
    origins, directions = rays(matrix, 20_000, 3)
    hits = cast(only("sphere", at=matrix), origins, directions)
    met = hits.table >= 0
    assert met.sum() > 3000
    inverse = np.linalg.inv(matrix[:3, :3])
    q = (hits.point[met] - matrix[:3, 3]) @ inverse.T - center
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), radius, rtol=1e-12)
    np.testing.assert_allclose(hits.normal[met], unit(q @ inverse), rtol=0.0, atol=1e-11)

    # On the ray, and on its near side: seen from outside, the normal is turned against it.
    along = ((hits.point[met] - origins[met]) * directions[met]).sum(axis=1)
    off = hits.point[met] - origins[met] - along[:, None] * directions[met]
    cosine = (hits.normal[met] * directions[met]).sum(axis=1)
    assert (cosine < 0.0).all()
    assert (np.linalg.norm(off, axis=1) <= 1e-13 * 10.0 / cosine**2).all()


@every_matrix
def test_smooth_normals_and_mirrors_keep_the_outside(matrix):
    origins, directions = rays(matrix, 10_000, 4)
    hits = cast(only("smooth", at=matrix), origins, directions)
    met = hits.table >= 0
    inverse = np.linalg.inv(matrix[:3, :3])
    q = (hits.point[met] - matrix[:3, 3]) @ inverse.T
    np.testing.assert_allclose(hits.normal[met], unit(np.sign(q) @ inverse), rtol=0.0, atol=1e-6)
    bent = np.linalg.norm(hits.shading_normal[met] - hits.normal[met], axis=1) > 1e-6
    assert bent.mean() > 0.8
    # Where a normal is bent, it is the interpolated one: that of the sphere through the vertices, taken along.
    np.testing.assert_allclose(hits.shading_normal[met][bent], unit(unit(q) @ inverse)[bent], rtol=0.0, atol=2e-6)
    assert ((hits.normal[met] * directions[met]).sum(axis=1) < 0.0).all()


def test_each_placement_answers_by_its_number_and_may_have_a_material_of_its_own():
    matrices = np.stack([affine((0.5 + 0.1 * i) * rotation(i), [4.0 * i, 0.0, 0.0]) for i in range(6)])
    scenery = placed(EMITTERS, matrices, material=[-1, 9, -1, -1, -1, 4])
    hits = cast(scenery, matrices[:, :3, 3] + np.array([0.0, 9.0, 0.0]), [0.0, -1.0, 0.0])
    np.testing.assert_array_equal(hits.instance, np.arange(6))
    assert hits.material.tolist() == [0, 9, 0, 0, 0, 4]


def test_several_tables_answer_by_their_place():
    # At time 1, when the sphere that flies is no longer where the other is.
    matrix = MATRICES["turned and moved"]
    origins, directions = rays(matrix, 5000, 8)
    near = np.array([cast(only(kind, at=matrix), origins, directions, times=1.0).near for kind in KINDS])
    hits = cast(placed(EMITTERS, matrix), origins, directions, times=1.0)
    assert {*hits.table} == {*range(-1, len(KINDS))}
    of_its_table = np.where(hits.table < 0, np.inf, near[hits.table, np.arange(5000)])
    np.testing.assert_allclose(of_its_table, near.min(axis=0), rtol=1e-5)


@pytest.mark.parametrize("exact", [True, False])
def test_what_accuracy_adds(exact):
    # Without it the point lies where float32 says along the ray, in the world as in the group.
    matrix, table = MATRICES["stretched"], parallelograms(40, 8)
    origins, directions = rays(matrix, 5000, 7)
    scenery = only("parallelogram", table, at=matrix) if exact else placed((table,), matrix, exact=False)
    hits = cast(scenery, origins, directions)
    met = hits.table == 0
    along = ((hits.point[met] - origins[met]) * directions[met]).sum(axis=1)
    cosine = np.abs((hits.normal[met] * directions[met]).sum(axis=1))
    off = np.abs(along - hits.near[met])
    assert (off <= 32.0 * 2.0**-23 * 20.0 / cosine).all()
    assert (np.median(off) < 1e-6) if not exact else (off.max() > 1e-7)


@every_matrix
def test_what_moves_in_a_group_is_met_where_it_is_at_the_time(matrix):
    # A sphere that flies by three of its radii, in a group that stands still: at each time the ellipsoid there.
    center = np.array([0.2, -0.1, 0.3])
    times = np.float64(np.float32(np.random.default_rng(11).random(20_000)))
    origins, directions = rays(matrix, 20_000, 12)
    gone = times[:, None] * (matrix[:3, :3] @ WAY)
    hits = cast(only("flying", at=matrix), origins + gone, directions, times=times)
    met = hits.table >= 0
    assert met.sum() > 3000
    q = (hits.point[met] - matrix[:3, 3]) @ np.linalg.inv(matrix[:3, :3]).T - center - times[met, None] * WAY
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), 0.8, rtol=1e-12)
    # As many as meet it when it rests.
    still = cast(only("sphere", at=matrix), origins, directions)
    assert ((still.table >= 0) != met).sum() <= 4


# ---- Offsets


def posed(kind, scale, ratio, away, seed):
    """A table, the middle of its one primitive, and a matrix that stretches and moves it."""
    rng = np.random.default_rng(seed)
    if kind == "sphere":
        table = spheres(scale * rng.normal(size=3), scale)
        middle = table.center[0]
    else:
        table = flat(kind, scale)
        middle = scale * (np.array([0.7, 0.3, -0.2]) + 0.5 * np.array([0.8, 1.2, 0.7]))
    linear = 10.0 ** rng.uniform(-3.0, 3.0) * rotation(seed) @ np.diag([1.0, ratio, ratio**0.5]) @ rotation(seed + 1)
    size = scale * float(np.linalg.norm(linear, 2))
    return table, middle, affine(linear * (-1.0) ** seed, away * size * unit(rng.normal(size=3))[0])


@pytest.mark.parametrize("kind", KINDS[:4])
@pytest.mark.parametrize("ratio", [1.0, 10.0, 1000.0])
@pytest.mark.parametrize("away", [0.01, 3.0, 1000.0])
def test_rays_leave_instances_for_good(kind, ratio, away):
    # Embree sees an instance where its float32 matrices put it, which are worse the farther off and the more stretched
    # it is.  Without an allowance for them, half of the rays meet the surface again at 1000 sizes from the origin.
    count, left = 4000, []
    for scale in (1e-3, 1.0, 1e3):
        seed = int(10 * scale) + int(ratio) + int(100 * away)
        table, middle, matrix = posed(kind, scale, ratio, away, seed)
        scenery = only(kind, table, at=matrix)
        linear, shift = matrix[:3, :3], matrix[:3, 3]
        starts = middle + 3.0 * scale * uniform_directions(count, seed)
        targets = middle + 0.4 * scale * np.random.default_rng(seed).uniform(-1.0, 1.0, (count, 3))
        onwards = unit(uniform_directions(count, seed + 2) @ linear.T)
        left.append(
            leave(partial(cast, scenery), starts @ linear.T + shift, unit((targets - starts) @ linear.T), onwards)
        )
    assert (np.array(left) >= 0).sum() > count
    assert (np.array(left) == 1).sum() == 0


@pytest.mark.parametrize("rate", [40.0, 500.0])
@pytest.mark.parametrize("arm", [0.0, 3.0, 300.0])
def test_rays_leave_what_turns_for_good(rate, arm):
    # Embree's angle between two poses is wrong by 1e-6, which counts by the distance from the axis.
    count = 4000
    for seed, kind in enumerate(["parallelogram", "sphere"]):
        table, middle, matrix = posed(kind, 1.0, 1.0, 2.0, seed)
        size = float(np.linalg.norm(matrix[:3, :3], 2))
        center = matrix[:3, :3] @ middle + matrix[:3, 3] + arm * size * unit([1.0, 2.0, 0.5])[0]
        motion = Motion(spin=Spin(axis=(1.0, -2.0, 0.5), rate=rate, center=tuple(map(float, center))))
        trajectory = resolve_motion(motion, matrix, Shutter(0.0, 1.0)).trajectory
        times = np.float64(np.float32(np.random.default_rng(seed).random(count)))
        pose = poses(trajectory, times)
        linear, shift = pose[:, :, :3], pose[:, :, 3]
        starts = middle + 3.0 * uniform_directions(count, seed)
        targets = middle + 0.4 * np.random.default_rng(seed + 5).uniform(-1.0, 1.0, (count, 3))
        origins = np.einsum("nij,nj->ni", linear, starts) + shift
        directions = unit(np.einsum("nij,nj->ni", linear, targets - starts))
        scenery = only(kind, table, moving, [trajectory])
        left = leave(partial(cast, scenery), origins, directions, uniform_directions(count, seed + 9), times)
        assert (left >= 0).sum() > count // 4
        assert (left == 1).sum() == 0
        # Solved at the ray's own time: what is on the primitive in the group is the point in the world, to float64.
        first = cast(scenery, origins, directions, times=times)
        back = np.einsum("nij,nj->ni", linear, first.local) + shift
        np.testing.assert_allclose(back, first.point, rtol=1e-13, atol=1e-11 * size * max(arm, 1.0))


# ---- Light


@pytest.mark.parametrize("kind", KINDS[:4])
@every_matrix
def test_points_on_placed_emitters_have_their_density(kind, matrix):
    # The mean of 1 / pdf is the solid angle in view, which rays in all directions measure too; and what is drawn lies
    # on the emitter, with the density that `pdf_instance_point` gives it.
    scenery = only(kind, at=matrix)
    reference = matrix[:3, :3] @ SEEN_FROM + matrix[:3, 3]
    u = np.random.default_rng(1).random((40_000, 2))
    points = sample_on(scenery.stage, reference, u, instance=0, table=KINDS.index(kind))
    np.testing.assert_allclose(points.pdf, points.twin, rtol=1e-9)
    ways = points.point - reference
    front = (ways * points.normal).sum(axis=1) < 0.0
    assert front.all() or not front.any()
    hits = cast(scenery, reference, unit(ways[:2000]))
    met = hits.table >= 0
    assert met.mean() > 0.998
    assert np.median(np.linalg.norm(hits.point - points.point[:2000], axis=1)[met]) < 1e-12

    directions = uniform_directions(200_000, 2)
    seen = occluded(scenery.accel, np.tile(reference, (len(directions), 1)), directions, np.inf).mean()
    solid_angle, noise = 4.0 * np.pi * seen, 4.0 * np.pi * np.sqrt(seen / len(directions))
    solid_angles = 1.0 / points.pdf
    spread = solid_angles.std() / np.sqrt(len(solid_angles))
    assert abs(solid_angles.mean() - solid_angle) <= 4.0 * (spread + noise)

    # Shadow rays end before it, far from the origin, too; yet what stands a little before it is found: at 3600 m,
    # coordinates are good to 2.4e-4 m.
    far = affine(np.eye(3), [3000.0, -2000.0, 500.0]) @ matrix
    scenery, reference = only(kind, at=far), far[:3, :3] @ SEEN_FROM + far[:3, 3]
    points = sample_on(scenery.stage, reference, u[:20_000], instance=0, table=KINDS.index(kind))
    ways = points.point - reference
    distance = np.linalg.norm(ways, axis=1)
    ends = np.maximum(distance - points.gap, 0.0)
    assert not occluded(scenery.accel, np.tile(reference, (len(ways), 1)), unit(ways), ends).any()
    assert np.median(points.gap / distance) < 0.02


def test_points_on_an_emitter_that_moves_are_where_it_is():
    motion = Motion(spin=Spin(axis=(0.0, 1.0, 0.0), rate=90.0, center=(1.0, 0.0, 0.0)))
    trajectory = resolve_motion(motion, MATRICES["stretched"], Shutter(0.0, 1.0)).trajectory
    scenery = only("parallelogram", place=moving, at=[trajectory])
    u = np.random.default_rng(4).random((2000, 2))
    for time in (0.0, 0.375, 1.0):
        pose = np.array([*poses(trajectory, time)[0], (0.0, 0.0, 0.0, 1.0)])
        reference = pose[:3, :3] @ SEEN_FROM + pose[:3, 3]
        there = sample_on(scenery.stage, reference, u, instance=0, time=time)
        still = sample_on(only("parallelogram", at=pose).stage, reference, u, instance=0)
        np.testing.assert_allclose(there.point, still.point, rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(there.pdf, still.pdf, rtol=1e-10)
        np.testing.assert_allclose(there.twin, there.pdf, rtol=1e-9)


# ---- Trajectories in trajectories

SPIN = Motion(spin=Spin(axis=(1.0, 2.0, -1.0), rate=200.0, center=(0.5, -1.0, 2.0)))


@pytest.mark.parametrize("name", ["turned and moved", "scaled", "mirrored", "stretched"])
def test_what_is_placed_in_what_moves_moves_along_and_the_other_way_round(name):
    times = np.array([0.0, 0.17, 0.5, 0.83, 1.0])
    still, path = MATRICES[name], resolve_motion(SPIN, MATRICES["turned and moved"], Shutter(0.0, 1.0)).trajectory
    rest = np.broadcast_to([[0.0, 0.0, 0.0, 1.0]], (5, 1, 4))
    whole = np.concatenate([poses(path, times), rest], axis=1)
    inner = compose_trajectories(path, decompose(still)[None])
    assert len(inner) == len(path)
    np.testing.assert_allclose(poses(inner, times), (whole @ still)[:, :3], rtol=0.0, atol=1e-12)
    outer = poses(compose_trajectories(decompose(still)[None], path), times)
    # A turn is no turn once it is stretched: then the 129 steps are exact, and between them it is as good as they are.
    for time, pose, expected in zip(times, outer, (still @ whole)[:, :3], strict=True):
        exact = name != "stretched" or (128.0 * time).is_integer()
        np.testing.assert_allclose(pose, expected, rtol=0.0, atol=1e-12 if exact else 1e-3)
