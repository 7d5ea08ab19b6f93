"""Instances are equal to geometry in world space: hits, normals, offsets, and sampled light."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from raytracer.core.geometry import pad_buffer
from raytracer.core.motion.interpolation import pack_trajectories, pose_at
from raytracer.core.motion.resolve import resolve_motion
from raytracer.core.motion.spec import Motion, Spin
from raytracer.core.motion.trajectory import compose_trajectories, decompose
from raytracer.core.primitives.discs import Discs
from raytracer.core.primitives.parallelograms import Parallelograms
from raytracer.core.primitives.spheres import Spheres
from raytracer.core.primitives.translated import translate_table
from raytracer.core.primitives.triangles import SmoothTriangles
from raytracer.core.shutter.table import Shutter
from tests.core.instancing.kernels import cast, moving, placed, sample
from tests.plugins.shapes.kernels import cast as cast_plain
from tests.plugins.shapes.kernels import occluded, uniform_directions, unit
from tests.plugins.shapes.test_offsets import flat, spheres

Array = NDArray[np.float64]


def rotation(seed: int) -> Array:
    """A rotation matrix (3, 3), uniform over all."""
    matrix, triangle = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    matrix *= np.sign(np.diag(triangle))
    return matrix * np.sign(np.linalg.det(matrix))


def affine(linear: Array, shift: Any) -> Array:
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


def rays(matrix: Array, count: int, seed: int) -> tuple[Array, Array]:
    """Rays from all sides at what lies within 2 of the origin, moved along by the matrix."""
    origins = 5.0 * uniform_directions(count, seed)
    targets = np.random.default_rng(seed).uniform(-1.5, 1.5, (count, 3))
    start, end = (rows @ matrix[:3, :3].T + matrix[:3, 3] for rows in (origins, targets))
    return start, unit(end - start)


def parallelograms(count: int, seed: int) -> Parallelograms:
    corner, u, v = np.random.default_rng(seed).uniform(-1.0, 1.0, (3, count, 3))
    return Parallelograms(corner, u, v, np.arange(count, dtype=np.int32))


def baked(table: Parallelograms, matrix: Array) -> Parallelograms:
    """Transform parallelograms to world space; a mirror image swaps the edges, so that u x v stays outside."""
    linear = matrix[:3, :3]
    corner, u, v = table.corner @ linear.T + matrix[:3, 3], table.u @ linear.T, table.v @ linear.T
    return Parallelograms(corner, *((u, v) if np.linalg.det(linear) > 0.0 else (v, u)), table.material)


# ---- Hits


@every_matrix
def test_hits_are_those_of_the_baked_object(matrix: Array) -> None:
    table = parallelograms(60, 1)
    origins, directions = rays(matrix, 20_000, 2)
    world = cast_plain((baked(table, matrix),), origins, directions)
    hits = cast(placed((table,), matrix), origins, directions)
    both = (world.table == 0) & (hits.table == 0)
    assert both.sum() > 10_000
    # Rays that graze an edge within float32 may tell otherwise.
    assert ((world.table == 0) != (hits.table == 0)).sum() <= 4
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
def test_a_sphere_becomes_an_ellipsoid(matrix: Array) -> None:
    # p = A q + b with |q - c| = r: the quadric |A^-1 (p - b) - c|^2 = r^2, whose gradient is the outside normal.
    center, radius = np.array([0.2, -0.1, 0.3]), 0.8
    origins, directions = rays(matrix, 20_000, 3)
    hits = cast(placed((spheres(center, radius),), matrix), origins, directions)
    met = hits.table == 0
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
def test_smooth_normals_and_mirrors_keep_the_outside(matrix: Array) -> None:
    # An octahedron with its radial vertex normals: what interpolates them points outwards, whatever the mirror.
    vertices = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
    faces = np.array([[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]], np.int64)
    table = SmoothTriangles(
        pad_buffer(vertices, np.float32),
        pad_buffer(faces, np.uint32),
        np.zeros(8, np.int32),
        None,
        np.float32(vertices),
    )
    origins, directions = rays(matrix, 10_000, 4)
    hits = cast(placed((table,), matrix), origins, directions)
    met = hits.table == 0
    inverse = np.linalg.inv(matrix[:3, :3])
    q = (hits.point[met] - matrix[:3, 3]) @ inverse.T
    np.testing.assert_allclose(hits.normal[met], unit(np.sign(q) @ inverse), rtol=0.0, atol=1e-6)
    bent = np.linalg.norm(hits.shading_normal[met] - hits.normal[met], axis=1) > 1e-6
    assert bent.mean() > 0.8
    # Where a normal is bent, it is the interpolated one: that of the sphere through the vertices, taken along.
    np.testing.assert_allclose(hits.shading_normal[met][bent], unit(unit(q) @ inverse)[bent], rtol=0.0, atol=2e-6)
    assert ((hits.normal[met] * directions[met]).sum(axis=1) < 0.0).all()


def test_each_placement_answers_by_its_number() -> None:
    matrices = np.stack([affine((0.5 + 0.1 * i) * rotation(i), [4.0 * i, 0.0, 0.0]) for i in range(6)])
    scenery = placed((spheres([0.0, 0.0, 0.0], 1.0), parallelograms(5, 6)), matrices)
    targets = matrices[:, :3, 3]
    hits = cast(scenery, targets + np.array([0.0, 9.0, 0.0]), [0.0, -1.0, 0.0])
    np.testing.assert_array_equal(hits.instance, np.arange(6))


def test_an_instance_may_have_a_material_of_its_own() -> None:
    matrices = np.stack([affine(np.eye(3), [4.0 * i, 0.0, 0.0]) for i in range(3)])
    table = Spheres(np.zeros((1, 3)), np.ones(1), np.array([5], np.int32))
    scenery = placed((table,), matrices, material=np.array([-1, 9, -1], np.int32))
    hits = cast(scenery, matrices[:, :3, 3] + [0.0, 9.0, 0.0], [0.0, -1.0, 0.0])
    assert hits.material.tolist() == [5, 9, 5]


@pytest.mark.parametrize("exact", [True, False])
def test_what_accuracy_adds(exact: bool) -> None:
    # Without it the point lies where float32 says along the ray, in the world as in the group.
    matrix = MATRICES["stretched"]
    origins, directions = rays(matrix, 5000, 7)
    hits = cast(placed((parallelograms(40, 8),), matrix, exact=exact), origins, directions)
    met = hits.table == 0
    along = ((hits.point[met] - origins[met]) * directions[met]).sum(axis=1)
    cosine = np.abs((hits.normal[met] * directions[met]).sum(axis=1))
    off = np.abs(along - hits.near[met])
    assert (off <= 32.0 * 2.0**-23 * 20.0 / cosine).all()
    assert (np.median(off) < 1e-6) if not exact else (off.max() > 1e-7)


# ---- Offsets


def posed(kind: str, scale: float, ratio: float, away: float, seed: int) -> tuple[Any, Array, Array]:
    """A table, the middle of its one primitive, and a matrix that stretches and moves it."""
    rng = np.random.default_rng(seed)
    if kind == "sphere":
        table: Any = spheres(scale * rng.normal(size=3), scale)
        middle = table.center[0]
    else:
        table = flat(kind, scale)
        middle = scale * (np.array([0.7, 0.3, -0.2]) + 0.5 * np.array([0.8, 1.2, 0.7]))
    linear = 10.0 ** rng.uniform(-3.0, 3.0) * rotation(seed) @ np.diag([1.0, ratio, ratio**0.5]) @ rotation(seed + 1)
    size = scale * float(np.linalg.norm(linear, 2))
    return table, middle, affine(linear * (-1.0) ** seed, away * size * unit(rng.normal(size=3))[0])


@pytest.mark.parametrize("kind", ["parallelogram", "disc", "triangle", "sphere"])
@pytest.mark.parametrize("ratio", [1.0, 10.0, 1000.0])
@pytest.mark.parametrize("away", [0.01, 3.0, 1000.0])
def test_rays_leave_instances_for_good(kind: str, ratio: float, away: float) -> None:
    # Embree sees an instance where its float32 matrices put it, which are worse the farther off and the more stretched
    # it is.  Without an allowance for them, half of the rays meet the surface again at 1000 sizes from the origin.
    count, failures, left_for_good = 4000, 0, 0
    for scale in (1e-3, 1.0, 1e3):
        seed = int(10 * scale) + int(ratio) + int(100 * away)
        table, middle, matrix = posed(kind, scale, ratio, away, seed)
        scenery = placed((table,), matrix)
        linear, shift = matrix[:3, :3], matrix[:3, 3]
        starts = middle + 3.0 * scale * uniform_directions(count, seed)
        targets = middle + 0.4 * scale * np.random.default_rng(seed).uniform(-1.0, 1.0, (count, 3))
        origins, directions = starts @ linear.T + shift, unit((targets - starts) @ linear.T)
        onwards = unit(uniform_directions(count, seed + 2) @ linear.T)
        if kind == "sphere":
            normals = cast(scenery, origins, directions).normal
            onwards *= np.sign((onwards * normals).sum(axis=1))[:, None]
        first = cast(scenery, origins, directions, np.nan_to_num(onwards))
        met = (first.table == 0) & np.isfinite(onwards[:, 0])
        again = cast(scenery, first.start[met], onwards[met])
        left_for_good += int(met.sum())
        failures += int((again.table >= 0).sum())
    assert left_for_good > count
    assert failures == 0


@pytest.mark.parametrize("rate", [40.0, 500.0])
@pytest.mark.parametrize("arm", [0.0, 3.0, 300.0])
def test_rays_leave_what_turns_for_good(rate: float, arm: float) -> None:
    # Embree's angle between two poses is wrong by 1e-6, which counts by the distance from the axis.
    count, failures = 4000, 0
    for seed, kind in enumerate(["parallelogram", "sphere"]):
        table, middle, matrix = posed(kind, 1.0, 1.0, 2.0, seed)
        size = float(np.linalg.norm(matrix[:3, :3], 2))
        center = matrix[:3, :3] @ middle + matrix[:3, 3] + arm * size * unit([1.0, 2.0, 0.5])[0]
        motion = Motion(spin=Spin(axis=(1.0, -2.0, 0.5), rate=rate, center=tuple(map(float, center))))
        trajectory = resolve_motion(motion, matrix, Shutter(0.0, 1.0)).trajectory
        packed = pack_trajectories([trajectory])
        times = np.float64(np.float32(np.random.default_rng(seed).random(count)))
        poses = np.array([pose_at(packed, 0, float(time)) for time in times])
        starts = middle + 3.0 * uniform_directions(count, seed)
        targets = middle + 0.4 * np.random.default_rng(seed + 5).uniform(-1.0, 1.0, (count, 3))
        origins = np.einsum("nij,nj->ni", poses[:, :, :3], starts) + poses[:, :, 3]
        directions = unit(np.einsum("nij,nj->ni", poses[:, :, :3], targets - starts))
        scenery = moving((table,), [trajectory])
        onwards = uniform_directions(count, seed + 9)
        if kind == "sphere":
            normals = cast(scenery, origins, directions, times=times).normal
            onwards *= np.nan_to_num(np.sign((onwards * normals).sum(axis=1)), nan=1.0)[:, None]
        first = cast(scenery, origins, directions, onwards, times)
        met = first.table == 0
        assert met.sum() > count // 4
        # Solved at the ray's own time: in the group the hit lies on the primitive, to float64.
        local = np.einsum("nji,nj->ni", np.linalg.inv(poses[met][:, :, :3]).transpose(0, 2, 1), first.point[met])
        assert np.isfinite(local).all()
        back = np.einsum("nij,nj->ni", poses[met][:, :, :3], first.local[met]) + poses[met][:, :, 3]
        np.testing.assert_allclose(back, first.point[met], rtol=1e-13, atol=1e-11 * size * max(arm, 1.0))
        failures += int((cast(scenery, first.start[met], onwards[met], times=times[met]).table >= 0).sum())
    assert failures == 0


# ---- Light


def emitter(kind: str) -> Any:
    if kind == "sphere":
        return spheres([0.2, -0.1, 0.3], 0.8)
    if kind == "disc":
        return Discs(np.array([[0.2, -0.1, 0.3]]), unit([1.0, 2.0, -0.5]), np.array([0.9]), np.zeros(1, np.int32))
    return flat(kind, 1.0)


@pytest.mark.parametrize("kind", ["sphere", "disc", "parallelogram", "triangle"])
@every_matrix
def test_points_on_placed_emitters_have_their_density(kind: str, matrix: Array) -> None:
    # The mean of 1 / pdf is the solid angle in view, which rays in all directions measure too; and what is drawn lies
    # on the emitter, with the density that `pdf_instance_point` gives it.
    scenery = placed((emitter(kind),), matrix)
    reference = matrix[:3, :3] @ [1.4, 1.9, 1.2] + matrix[:3, 3]
    points = sample(scenery, 0, reference, np.random.default_rng(1).random((40_000, 2)))
    np.testing.assert_allclose(points.pdf, points.twin, rtol=1e-9)
    ways = points.point - reference
    front = (ways * points.normal).sum(axis=1) < 0.0
    assert front.all() or not front.any()
    hits = cast(scenery, np.tile(reference, (2000, 1)), unit(ways[:2000]))
    assert (hits.table == 0).mean() > 0.998
    off = np.linalg.norm(hits.point - points.point[:2000], axis=1)[hits.table == 0]
    assert np.median(off) < 1e-12

    directions = uniform_directions(400_000, 2)
    seen = (cast(scenery, np.tile(reference, (len(directions), 1)), directions).table == 0).mean()
    solid_angle, noise = 4.0 * np.pi * seen, 4.0 * np.pi * np.sqrt(seen / len(directions))
    solid_angles = 1.0 / points.pdf
    spread = solid_angles.std() / np.sqrt(len(solid_angles))
    assert abs(solid_angles.mean() - solid_angle) <= 4.0 * (spread + noise)


@pytest.mark.parametrize("kind", ["sphere", "disc", "parallelogram", "triangle"])
@every_matrix
def test_shadow_rays_end_before_the_placed_emitter(kind: str, matrix: Array) -> None:
    far = affine(np.eye(3), [3000.0, -2000.0, 500.0]) @ matrix
    scenery = placed((emitter(kind),), far)
    reference = far[:3, :3] @ [1.4, 1.9, 1.2] + far[:3, 3]
    points = sample(scenery, 0, reference, np.random.default_rng(3).random((20_000, 2)))
    ways = points.point - reference
    distance = np.linalg.norm(ways, axis=1)
    ends = np.maximum(distance - points.gap, 0.0)
    assert not occluded(scenery.accel, np.tile(reference, (len(ways), 1)), unit(ways), ends).any()
    # Yet what stands a little before it is found: at 3600 m from the origin, coordinates are good to 2.4e-4 m.
    assert np.median(points.gap / distance) < 0.02


def test_points_on_an_emitter_that_moves_are_where_it_is() -> None:
    matrix = MATRICES["stretched"]
    motion = Motion(spin=Spin(axis=(0.0, 1.0, 0.0), rate=90.0, center=(1.0, 0.0, 0.0)))
    trajectory = resolve_motion(motion, matrix, Shutter(0.0, 1.0)).trajectory
    packed = pack_trajectories([trajectory])
    scenery = moving((emitter("parallelogram"),), [trajectory])
    u = np.random.default_rng(4).random((2000, 2))
    for time in (0.0, 0.375, 1.0):
        pose = np.array([*pose_at(packed, 0, time), (0.0, 0.0, 0.0, 1.0)])
        reference = pose[:3, :3] @ [1.4, 1.9, 1.2] + pose[:3, 3]
        there = sample(scenery, 0, reference, u, time=time)
        still = sample(placed((emitter("parallelogram"),), pose), 0, reference, u)
        np.testing.assert_allclose(there.point, still.point, rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(there.pdf, still.pdf, rtol=1e-10)
        np.testing.assert_allclose(there.twin, there.pdf, rtol=1e-9)


# ---- Trajectories in trajectories


SPIN = Motion(spin=Spin(axis=(1.0, 2.0, -1.0), rate=200.0, center=(0.5, -1.0, 2.0)))


@pytest.mark.parametrize("time", [0.0, 0.17, 0.5, 0.83, 1.0])
@pytest.mark.parametrize("name", ["turned and moved", "scaled", "mirrored", "stretched"])
def test_what_is_placed_in_what_moves_moves_along(name: str, time: float) -> None:
    inner, outer = MATRICES[name], resolve_motion(SPIN, MATRICES["turned and moved"], Shutter(0.0, 1.0)).trajectory
    both = compose_trajectories(outer, decompose(inner)[None])
    assert len(both) == len(outer)
    pose, expected = pose_at(pack_trajectories([both]), 0, time), pose_at(pack_trajectories([outer]), 0, time)
    whole = np.array([*expected, (0.0, 0.0, 0.0, 1.0)]) @ inner
    np.testing.assert_allclose(np.array(pose), whole[:3], rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("time", [0.0, 0.17, 0.5, 0.83, 1.0])
@pytest.mark.parametrize("name", ["turned and moved", "scaled", "mirrored", "stretched"])
def test_what_moves_in_what_is_placed_is_placed_along(name: str, time: float) -> None:
    outer, inner = MATRICES[name], resolve_motion(SPIN, MATRICES["turned and moved"], Shutter(0.0, 1.0)).trajectory
    both = compose_trajectories(decompose(outer)[None], inner)
    pose, expected = pose_at(pack_trajectories([both]), 0, time), pose_at(pack_trajectories([inner]), 0, time)
    whole = outer @ np.array([*expected, (0.0, 0.0, 0.0, 1.0)])
    # A turn is no turn once it is stretched: then the 129 steps are exact, and between them it is as good as they are.
    exact = name != "stretched" or (128.0 * time).is_integer()
    np.testing.assert_allclose(np.array(pose), whole[:3], rtol=0.0, atol=1e-12 if exact else 1e-3)


def test_no_instances_take_what_they_took() -> None:
    # Placed by the identity, hits are those of the plain table, but for the float32 rounding of near.
    table = parallelograms(30, 9)
    origins, directions = rays(np.eye(4), 3000, 10)
    plain, hits = cast_plain((table,), origins, directions), cast(placed((table,), np.eye(4)), origins, directions)
    assert (plain.table != hits.table).sum() <= 2
    met = (plain.table == 0) & (hits.table == 0)
    same = plain.primitive[met] == hits.primitive[met]
    assert (~same).sum() <= 2
    inner = met.copy()
    inner[met] = same
    inner[met] &= ((plain.uv[met] > 1e-5) & (plain.uv[met] < 1.0 - 1e-5)).all(axis=1)
    np.testing.assert_allclose(hits.point[inner], plain.point[inner], rtol=0.0, atol=1e-14)


@every_matrix
def test_what_moves_in_a_group_is_met_where_it_is_at_the_time(matrix: Array) -> None:
    # A sphere that flies by three of its radii, in a group that stands still: at each time the ellipsoid there.
    center, way = np.array([0.2, -0.1, 0.3]), np.array([1.5, 0.5, -2.0])
    table = translate_table(spheres(center, 0.8), way)
    times = np.float64(np.float32(np.random.default_rng(11).random(20_000)))
    origins, directions = rays(matrix, 20_000, 12)
    origins += times[:, None] * (matrix[:3, :3] @ way)
    hits = cast(placed((table,), matrix), origins, directions, times=times)
    met = hits.table == 0
    assert met.sum() > 3000
    q = (hits.point[met] - matrix[:3, 3]) @ np.linalg.inv(matrix[:3, :3]).T - center - times[met, None] * way
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), 0.8, rtol=1e-12)
    # As many as meet it when it rests.
    still = cast(placed((spheres(center, 0.8),), matrix), origins - times[:, None] * (matrix[:3, :3] @ way), directions)
    assert ((still.table == 0) != met).sum() <= 4
