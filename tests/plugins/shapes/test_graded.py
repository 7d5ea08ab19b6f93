"""Parallelograms so large that float32 blurs them near the eye are cut up, and stay one surface."""

import numpy as np
import pytest
from numpy.typing import NDArray

from raytracer.core.geometry import OFFSET_ULPS
from raytracer.core.primitives.base.interface import areas, geometry, subdivide_large
from raytracer.core.primitives.parallelograms import Parallelograms, extents
from raytracer.scene.load import build
from raytracer.scene.pack.scene import pack
from tests.plugins.shapes.kernels import built, cast, spawn, uniform_directions, unit

Array = NDArray[np.float64]
EYE = np.array([0.3, 1.5, -0.2])
SIZE = 1e6


EDGES = {"level": ((0.0, 0.0, SIZE), (SIZE, 0.0, 0.0)), "skewed": ((3e4, 0.0, 0.9 * SIZE), (0.8 * SIZE, 0.0, -1.1e5))}


def ground(kind):
    """A parallelogram of 1000 km, a metre below the origin."""
    u, v = np.array(EDGES[kind])
    corner = -0.41 * u - 0.73 * v - [0.0, 1.0, 0.0]
    return Parallelograms(corner[None], u[None], v[None], np.zeros(1, np.int32))


every_ground = pytest.mark.parametrize("kind", EDGES)


@every_ground
def test_parts_are_the_whole(kind):
    table = ground(kind)
    parts = subdivide_large(table, EYE)
    assert areas(parts).sum() == pytest.approx(areas(table).sum(), rel=1e-12)
    assert (areas(parts) > 0.0).all()
    normal = unit(np.cross(table.u, table.v))[0]
    np.testing.assert_allclose(unit(np.cross(parts.u, parts.v)), np.tile(normal, (len(parts.u), 1)), atol=1e-9)
    height = (parts.corner - table.corner) @ normal
    assert np.abs(height).max() <= 8.0 * 2.0**-50 * extents(table)[0]


@every_ground
def test_parts_share_their_corners_to_the_bit(kind):
    # A grid of n x m parts has (n + 1) (m + 1) corners; any that differed by a bit would add to them.
    parts = subdivide_large(ground(kind), EYE)
    vertices = np.unique(geometry(parts).vertices[0], axis=0)
    m = int(np.argmax((parts.u != parts.u[0]).any(axis=1)))
    n = len(parts.corner) // m
    assert len(parts.corner) == n * m > 1000
    assert len(vertices) == (n + 1) * (m + 1)


@every_ground
def test_rays_leave_as_near_as_the_eye_can_tell(kind):
    # At the eye's distance d the offset is below d / 256; the whole's would be 0.5 m and more.
    table = ground(kind)
    parts = subdivide_large(table, EYE)
    hits = cast((parts,), np.tile(EYE, (2000, 1)), unit(uniform_directions(2000, 1) - [0.0, 1.0, 0.0]))
    met = hits.table == 0
    assert met.mean() > 0.8
    distance = np.linalg.norm(hits.point[met] - EYE, axis=1)
    assert (hits.offset[met] < (distance + 2.0) / 256.0).all()
    assert hits.offset[met].min() < 1e-5
    assert OFFSET_ULPS * extents(table)[0] > 0.4


@every_ground
def test_no_ray_passes_between_parts_nor_meets_them_again(kind):
    # From the eye and from far up, at the corners and edges of parts and anywhere; and on to any side.
    rng = np.random.default_rng(2)
    parts = subdivide_large(ground(kind), EYE)
    accel = built(parts)
    count = 100_000
    row = rng.integers(0, len(parts.corner), count)
    a, b = rng.random((2, count, 1))
    third = count // 3
    a[:third] = rng.integers(0, 2, (third, 1))
    b[third : 2 * third] = rng.integers(0, 2, (third, 1))
    targets = parts.corner[row] + a * parts.u[row] + b * parts.v[row]
    # Edges of the whole are no seams.
    corner, u, v = (column[0] for column in ground(kind)[:3])
    at = np.linalg.lstsq(np.stack([u, v], axis=1), (targets - corner).T, rcond=None)[0].T
    inner = ((at > 1e-6) & (at < 1.0 - 1e-6)).all(axis=1)
    up = unit(uniform_directions(count, 3) + np.array([0.0, 1.5, 0.0]))
    away = 10.0 ** rng.uniform(0.0, 1.0, (count, 1)) * np.maximum(1.0, np.linalg.norm(targets, axis=1, keepdims=True))
    origins = np.where(rng.random((count, 1)) < 0.5, EYE, targets + away * up)
    ways = unit(targets - origins)
    hits = cast((parts,), origins, ways, accel=accel)
    assert (hits.table[inner] == 0).all()

    grazing = rng.uniform(-1.0, 1.0, (count, 1)) * 10.0 ** -rng.uniform(0.0, 7.0, (count, 1))
    onwards = unit(uniform_directions(count, 4) * [1.0, 0.0, 1.0] + grazing * [0.0, 1.0, 0.0])
    starts = spawn((parts,), origins, ways, onwards, accel=accel)
    left = ~np.isnan(starts[:, 0])
    assert (cast((parts,), starts[left], onwards[left], accel=accel).table >= 0).sum() == 0


def test_what_is_no_larger_than_one_sees_is_left_alone():
    table = Parallelograms(
        np.array([[-5e3, 0.0, -5e3]]), np.array([[0.0, 0.0, 1e4]]), np.array([[1e4, 0.0, 0.0]]), np.zeros(1, np.int32)
    )
    assert subdivide_large(table, np.array([0.0, 2.0, 0.0])) is table
    assert len(subdivide_large(table, np.array([0.0, 0.5, 0.0])).corner) > 1
    # Seen from on it, at the origin, there is no distance to be exact at.
    assert subdivide_large(table, np.zeros(3)) is table
    # The corners of a tilted one are not equally high in float32.
    tilted = table._replace(u=table.u + np.array([0.0, 1e3, 0.0]), corner=table.corner - np.array([0.0, 500.0, 0.0]))
    assert subdivide_large(tilted, np.array([0.0, 0.5, 0.0])) is tilted
    # But a quarter turn leaves an ulp of the size.
    turned = table._replace(u=table.u + np.array([0.0, 1e-12, 0.0]))
    assert len(subdivide_large(turned, np.array([0.0, 0.5, 0.0])).corner) > 1


def _packed(objects):
    return pack(build(_HEAD + objects, "pebble.yaml"))


_HEAD = """
film: {width: 8, height: 8}
camera: {type: pinhole, look_from: [0, 1, 3], look_at: [0, 0, 0]}
"""

_GROUND = "{type: quad, corner: [-5e+5, 0, -5e+5], edges: [[0, 0, 1e+6], [1e+6, 0, 0]]"


def test_a_pebble_on_a_vast_ground_casts_its_shadow():
    # Of a centimetre, on 1000 km: rays that leave the ground beside it towards it must meet it, and not pass above.
    result = _packed(f"objects:\n  - {_GROUND}}}\n  - {{type: sphere, center: [0, 0.005, 0], radius: 0.005}}\n")
    tables = result.scene.primitives
    angle = np.random.default_rng(5).uniform(0.0, 2.0 * np.pi, 1000)
    beside = 0.02 * np.column_stack([np.cos(angle), np.zeros(1000), np.sin(angle)])
    origins = beside + np.array([0.0, 1.0, 0.0])
    onwards = unit([0.0, 0.005, 0.0] - beside)
    accel = result.build()
    starts = spawn(tables, origins, np.tile([0.0, -1.0, 0.0], (1000, 1)), onwards, accel=accel)
    hits = cast(tables, starts, onwards, accel=accel)
    names = [type(table).__name__ for table in tables]
    assert (hits.table == names.index("Spheres")).all()


def test_parts_belong_to_the_object_and_are_not_cut_where_textures_lie_on_them():
    result = _packed(f"objects:\n  - {_GROUND}}}\n")
    (owners,) = result.objects.owners
    assert owners.number.tolist() == [0]
    assert len(result.scene.primitives[0].material) > 100
    checked = _packed(f"objects:\n  - {_GROUND}, material: {{type: lambertian, albedo: {{type: checker}}}}}}\n")
    assert len(checked.scene.primitives[0].material) == 1
