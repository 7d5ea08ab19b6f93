"""The Embree binding: finding the library, errors, lifetimes, and hits against two other answers.

Those are the `embreex` wheel's own binding of the same library, for triangles, and a plain float64 search in NumPy.
"""

import gc
import weakref

import numpy as np
import pytest
from numpy.typing import NDArray

from raytracer.core import embree
from raytracer.core.compiler.dispatch import entry
from raytracer.core.embree import Accel, Device, InstanceArray
from raytracer.core.embree_library import EmbreeError, find_library
from raytracer.core.geometry import Geometry, Primitive, pad_buffer
from raytracer.core.primitives.base.interface import geometry, row_of
from raytracer.core.primitives.discs import Discs
from raytracer.core.primitives.parallelograms import Parallelograms
from raytracer.core.primitives.spheres import Spheres
from raytracer.core.primitives.triangles import Triangles
from raytracer.rendering.statistics import peak_rss_bytes
from tests.plugins.shapes.kernels import built, cast, occluded, uniform_directions, unit

Array = NDArray[np.float64]


# ---- The library


@pytest.mark.parametrize(
    "file", ["embreex.libs/libembree4-2e5b4d5c.so.4", "embreex/.dylibs/libembree4.4.dylib", "embreex.libs/embree4.dll"]
)
def test_library_is_found_where_each_wheel_puts_it(tmp_path, file):
    # The layouts of embreex 4.4.0.post1 for Linux, macOS and Windows; TBB lies beside and is not it.
    library = tmp_path / file
    library.parent.mkdir(parents=True)
    for name in (library.name, "libtbb-1234.so.12", "tbb12.dll"):
        (library.parent / name).touch()
    assert find_library(tmp_path) == library


def test_missing_library_is_an_error(tmp_path):
    (tmp_path / "embreex.libs").mkdir()
    (tmp_path / "embreex.libs" / "libtbb.so").touch()
    with pytest.raises(EmbreeError, match="holds no Embree 4 library"):
        find_library(tmp_path)


def test_missing_package_is_an_error(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(EmbreeError, match="not installed"):
        find_library()


# ---- Errors


def _triangle(indices=None):
    vertices = pad_buffer(np.eye(3), np.float32)
    faces = pad_buffer(np.array([indices or [0, 1, 2]]), np.uint32)
    return Geometry(Primitive.TRIANGLE, (vertices,), faces)


def test_a_device_that_does_not_start_is_an_exception(monkeypatch):
    # rtcNewDevice returns NULL on a processor without SSE2; its error is then that of no device, 5.
    monkeypatch.setattr(embree, "_new_device", lambda config: None)
    monkeypatch.setattr(embree, "_device_error", lambda device: 5)
    with pytest.raises(EmbreeError, match="could not start: unsupported CPU"):
        Device()


def test_what_embree_refuses_is_an_exception_with_its_words():
    # A sphere wants four floats a vertex; given three, Embree calls back with an error.
    geometry = Geometry(Primitive.SPHERE, (pad_buffer(np.zeros((1, 3)), np.float32),))
    with pytest.raises(EmbreeError, match=r"Embree: invalid (argument|operation)"):
        Accel([geometry])


def test_an_error_does_not_stick():
    device = Device()
    with pytest.raises(EmbreeError):
        Accel([Geometry(Primitive.SPHERE, (pad_buffer(np.zeros((1, 3)), np.float32),))], device=device)
    device.check()
    Accel([_triangle()], device=device)
    # And what was refused is freed, too.
    finalizer = device._finalizer
    del device
    gc.collect()
    assert not finalizer.alive


@pytest.mark.parametrize("rows", [np.zeros((3, 3)), np.zeros((3, 6), np.float32)[:, ::2]], ids=["float64", "with gaps"])
def test_buffers_that_cannot_be_lent_are_refused(rows):
    with pytest.raises(EmbreeError, match="contiguous"):
        Accel([Geometry(Primitive.TRIANGLE, (rows,), pad_buffer(np.array([[0, 1, 2]]), np.uint32))])


# ---- Lifetimes


def test_scene_and_device_are_freed():
    accel = Accel([_triangle()])
    scene, device = accel._finalizer, accel.device._finalizer
    buffers = weakref.ref(accel._buffers[-1])
    assert scene.alive
    assert device.alive
    assert buffers() is not None
    del accel
    gc.collect()
    assert not scene.alive
    assert not device.alive
    assert buffers() is None


def test_scene_keeps_what_it_borrowed():
    table = _spheres(1000, 1)
    accel = built(table)
    gc.collect()
    _ = [np.full(4000, np.nan, np.float32) for _ in range(50)]
    origins, directions = _rays(500, 2)
    np.testing.assert_array_equal(
        cast((table,), origins, directions, accel=accel).near, cast((table,), origins, directions).near
    )


def test_many_scenes_take_no_more_memory_than_a_few():
    # A scene of 10,000 spheres takes over 0.5 MB; 60 of them that were not freed would take over 30.
    table = _spheres(10_000, 3)
    for _ in range(10):
        built(table)
    gc.collect()
    before = peak_rss_bytes()
    for _ in range(60):
        built(table)
    assert peak_rss_bytes() - before < 10e6


# ---- Hits


def _spheres(count, seed):
    rng = np.random.default_rng(seed)
    radius = rng.uniform(0.02, 0.3, count)
    return Spheres(rng.uniform(-2.0, 2.0, (count, 3)), radius, np.zeros(count, np.int32))


def _tables(count, seed):
    rng = np.random.default_rng(seed)
    corner, u, v = rng.uniform(-2.0, 2.0, (count, 3)), *rng.uniform(-0.7, 0.7, (2, count, 3))
    normal, radius, material = unit(np.cross(u, v)), rng.uniform(0.1, 0.5, count), np.zeros(count, np.int32)
    vertices = pad_buffer(np.stack([corner, corner + u, corner + v], axis=1).reshape(-1, 3), np.float32)
    return {
        "spheres": _spheres(count, seed),
        "parallelograms": Parallelograms(corner, u, v, material),
        "discs": Discs(corner, normal, radius, material),
        "triangles": Triangles(vertices, pad_buffer(np.arange(3 * count).reshape(-1, 3), np.uint32), material),
    }


TABLES = _tables(300, 4)


def _rays(count, seed):
    origins = 5.0 * uniform_directions(count, seed)
    targets = np.random.default_rng(seed).uniform(-2.0, 2.0, (count, 3))
    return origins, unit(targets - origins)


def _plane(origin, direction, points, normals):
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(((points - origin) * normals).sum(axis=1) / (normals @ direction))


def _distances(table, origin, direction):
    """Distance to each primitive of a table (n,), inf for a miss: by definition, in float64, one ray at a time."""
    if isinstance(table, Spheres):
        # Roots of |o + t d - c|^2 = r^2.
        to = origin - table.center
        b = to @ direction
        under = b * b - ((to * to).sum(axis=1) - table.radius**2)
        root = np.sqrt(np.maximum(under, 0.0))
        t = np.where(-b - root > 0.0, -b - root, -b + root)
        return np.where((under >= 0.0) & (t > 0.0), t, np.inf)
    if isinstance(table, Discs):
        t = _plane(origin, direction, table.center, table.normal)
        away = np.linalg.norm(origin + t[:, None] * direction - table.center, axis=1)
        return np.where((t > 0.0) & (away <= table.radius), t, np.inf)
    if isinstance(table, Parallelograms):
        a, u, v = table.corner, table.u, table.v
    else:
        a, b, c = (table.vertices[table.faces[:, i]].astype(np.float64) for i in range(3))
        u, v = b - a, c - a
    t = _plane(origin, direction, a, np.cross(u, v))
    q = origin + t[:, None] * direction - a
    # Coordinates in the edges by the normal equations.
    uu, uv, vv = ((x * y).sum(axis=1) for x, y in ((u, u), (u, v), (v, v)))
    qu, qv = (q * u).sum(axis=1), (q * v).sum(axis=1)
    determinant = uu * vv - uv * uv
    x, y = (vv * qu - uv * qv) / determinant, (uu * qv - uv * qu) / determinant
    inside = (x >= 0.0) & (y >= 0.0) & (x + y <= 1.0 if isinstance(table, Triangles) else (x <= 1.0) & (y <= 1.0))
    return np.where((t > 0.0) & inside, t, np.inf)


@pytest.mark.parametrize("kind", TABLES)
def test_hits_are_those_of_a_search_in_float64(kind):
    table = TABLES[kind]
    origins, directions = _rays(3000, 5)
    hits = cast((table,), origins, directions)
    distances = np.array([_distances(table, o, d) for o, d in zip(origins, directions, strict=True)])
    nearest = distances.min(axis=1)
    assert np.isfinite(nearest).mean() > 0.3

    # Hit or miss, but for rays that graze an edge within float32.
    disagree = (hits.table == 0) != np.isfinite(nearest)
    assert disagree.sum() <= 2

    # The same primitive, unless two lie within float32 of one another; and float64's own distance to it.
    both = (hits.table == 0) & np.isfinite(nearest)
    chosen = distances[np.arange(len(distances)), hits.primitive]
    assert (chosen[both] <= nearest[both] + 1e-5).mean() > 0.999
    same = both & (chosen == nearest)
    assert same.sum() > 0.999 * both.sum()
    distance = ((hits.point - origins) * directions).sum(axis=1)
    grazing = np.abs((hits.normal * directions).sum(axis=1))
    # The search subtracts squares of up to 50 to find chords of spheres, whose radii are as small as 0.02.
    rounding = 1e-13 if kind != "spheres" else 2.0**-52 * 50.0 / 0.02
    assert (np.abs(distance[same] - nearest[same]) <= rounding / grazing[same] ** 2).all()
    # Embree's own: a few ulps of the ray's origin and length, which reach 9; squared for the limbs of spheres.
    assert (np.abs(hits.near[same] - nearest[same]) <= 4.0 * 2.0**-20 / grazing[same] ** 2).all()


def test_triangles_are_hit_as_by_the_wheels_own_binding():
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    table = TABLES["triangles"]
    origins, directions = _rays(5000, 8)
    hits = cast((table,), origins, directions)
    theirs = EmbreeScene()
    TriangleMesh(theirs, np.asarray(table.vertices)[np.asarray(table.faces, np.int64)])
    result = theirs.run(origins.astype(np.float32), directions.astype(np.float32), output=True)
    their_primitive, their_distance = np.asarray(result["primID"]), np.asarray(result["tfar"])
    both = (hits.table == 0) & (their_primitive >= 0)
    assert both.sum() > 1500
    assert ((hits.table == 0) != (their_primitive >= 0)).sum() <= 2
    same = both & (hits.primitive == their_primitive)
    assert same.sum() >= both.sum() - 2
    # The robust flag, and another width of packet, change the last bits: a few ulps of the distances, which reach 9.
    cosine = np.abs((hits.normal * directions).sum(axis=1))
    assert (np.abs(hits.near[same] - their_distance[same]) <= 4.0 * 2.0**-20 / cosine[same]).all()


@pytest.mark.parametrize("kind", TABLES)
def test_occluded_agrees_with_intersect(kind):
    table = TABLES[kind]
    accel = built(table)
    origins, directions = _rays(5000, 10)
    hits = cast((table,), origins, directions, accel=accel)
    met = hits.table == 0
    assert (occluded(accel, origins, directions, np.inf) == met).all()
    near = np.where(met, hits.near, 1.0)
    assert not occluded(accel, origins, directions, near * (1.0 - 1e-4)).any()
    assert occluded(accel, origins, directions, near * (1.0 + 1e-4))[met].all()


@entry
def _packets(accel, packet, origins, directions, count, near, is_hit):
    for first in range(0, len(origins), count):
        for lane in range(count):
            ray = first + lane
            origin = (origins[ray, 0], origins[ray, 1], origins[ray, 2])
            embree.set_ray(packet, lane, origin, (directions[ray, 0], directions[ray, 1], directions[ray, 2]), np.inf)
        embree.intersect(accel, packet, count)
        for lane in range(count):
            near[first + lane] = embree.load_float(packet, lane, embree.TFAR)
            is_hit[first + lane] = embree.load_int(packet, lane, embree.GEOMETRY) != embree.MISS


@pytest.mark.parametrize("kind", TABLES)
def test_a_ray_does_not_depend_on_its_neighbours(kind):
    # Lanes are filled as paths live on, so bits must not depend on how many there are: determinism rests on it.
    table = TABLES[kind]
    accel = built(table)
    origins, directions = _rays(840, 12)
    answers = []
    for count in (1, 3, 7, embree.PACKET, 20, 420):
        near, is_hit = np.zeros(840), np.zeros(840, np.bool_)
        _packets(accel.address, embree.ray_packets(count), origins, directions, count, near, is_hit)
        answers.append((near, is_hit))
    for near, is_hit in answers[1:]:
        np.testing.assert_array_equal(near, answers[0][0])
        np.testing.assert_array_equal(is_hit, answers[0][1])


def test_packet_is_laid_out_as_embree_reads_it():
    # RTCRayHit8, embree4/rtcore_ray.h: rows of 8 words, 12 for the ray and at least 8 for the hit; 64-byte aligned.
    room = embree.ray_packets()
    assert room.floats.ctypes.data % 64 == 0
    assert room.valid.ctypes.data % 64 == 0
    assert room.floats.shape[2] == embree.PACKET == len(room.valid)
    assert np.shares_memory(room.floats, room.ints)
    assert (room.ints[:, embree.MASK] == 0xFFFFFFFF).all()
    assert room.floats.flags.c_contiguous
    names = "ORIGIN TNEAR DIRECTION TIME TFAR MASK RAY_ID FLAGS NORMAL U V PRIMITIVE GEOMETRY INSTANCE"
    assert [getattr(embree, name) for name in names.split()] == [0, 3, 4, 7, 8, 9, 10, 11, 12, 15, 16, 17, 18, 19]


@pytest.mark.parametrize("name", ["collinear", "point", "nan", "sliver"])
def test_broken_triangles_are_never_met(name):
    # Hard case 13: Embree is silent about them, and misses.
    corners = {
        "collinear": [[0, 0, 0], [1, 1, 1], [2, 2, 2]],
        "point": [[0.5, 0.5, 0.5]] * 3,
        "nan": [[0, 0, 0], [np.nan, 0, 0], [0, 1, 0]],
        "sliver": [[0, 0, 0], [1, 0, 0], [2, 1e-30, 0]],
    }[name]
    vertices = pad_buffer(np.array(corners, np.float64), np.float32)
    table = Triangles(vertices, pad_buffer(np.array([[0, 1, 2]]), np.uint32), np.zeros(1, np.int32))
    origins = 3.0 * uniform_directions(2000, 13)
    targets = np.random.default_rng(14).uniform(0.0, 1.0, (2000, 3))
    assert (cast((table,), origins, unit(targets - origins)).table == -1).all()


# ---- Single rays


@pytest.mark.parametrize("kind", TABLES)
def test_a_single_ray_meets_what_a_packet_meets(kind):
    table = TABLES[kind]
    accel = built(table)
    origins, directions = _rays(500, 14)
    hits = cast((table,), origins, directions, accel=accel)
    for ray, (origin, direction) in enumerate(zip(origins, directions, strict=True)):
        hit = accel.cast(origin, direction)
        assert (hit is not None) == (hits.table[ray] == 0)
        if hit is not None:
            assert row_of(table, hit.primitive) == hits.primitive[ray]
            assert (hit.geometry, hit.instance, hit.placement) == (0, -1, -1)
            assert hit.distance == pytest.approx(hits.near[ray], rel=1e-5)


def test_a_single_ray_can_go_on_behind_what_it_met():
    table = Spheres(np.array([[0.0, 0.0, -5.0], [0.0, 0.0, -9.0]]), np.ones(2), np.zeros(2, np.int32))
    accel = built(table)
    beyond, distances = 0.0, []
    while (hit := accel.cast((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), beyond=beyond)) is not None:
        distances.append(hit.distance)
        beyond = float(np.nextafter(np.float32(hit.distance), np.float32(np.inf)))
    np.testing.assert_allclose(distances, [4.0, 6.0, 8.0, 10.0], rtol=1e-6)


# ---- Placements


def _pose(steps):
    """The identity, as a matrix for one time step, and as a scale, a quaternion and a translation for more."""
    if steps == 1:
        return (np.eye(3, 4, dtype=np.float32).reshape(1, 12),)
    row = np.zeros((1, 16), np.float32)
    row[0, [0, 1, 2, 9]] = 1.0
    return (row,) * steps


@pytest.mark.parametrize("steps", [1, 2, 5])
@pytest.mark.parametrize("groups", [(0,), (1,), (2,), (1, 1), (2, 0), (0, 1, 2)])
def test_each_placement_shows_its_group(steps, groups):
    # Embree 4.4 has shown the first group in an array of one placement, whatever the index said.
    radii = (0.1, 0.2, 0.4)
    spheres = [{0: geometry(Spheres(np.zeros((1, 3)), np.array([radius]), np.zeros(1, np.int32)))} for radius in radii]
    poses = tuple(np.repeat(step, len(groups), axis=0) for step in _pose(steps))
    for number in range(len(groups)):
        column = {12: 3, 16: 13}[poses[0].shape[1]]
        for step in {id(pose): pose for pose in poses}.values():
            step[number, column] = 10.0 * number
    accel = Accel({}, spheres, [InstanceArray(np.array(groups, np.uint32), poses)], first_instance=1)
    for number, group in enumerate(groups):
        hit = accel.cast((10.0 * number, 0.0, 5.0), (0.0, 0.0, -1.0), time=0.5)
        assert hit is not None
        assert hit.distance == pytest.approx(5.0 - radii[group], abs=1e-5)
        assert hit[1:] == (0, 0, 1, number)
