"""Primitives that move, against the same primitives where they are at the ray's time."""

from functools import partial

import numpy as np
import pytest
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.embree import Accel
from raytracer.core.geometry import pad_buffer
from raytracer.core.primitives.base.interface import areas, concatenate, geometry, group_key, reproject_at_time_any
from raytracer.core.primitives.discs import Discs
from raytracer.core.primitives.parallelograms import Parallelograms
from raytracer.core.primitives.spheres import Spheres
from raytracer.core.primitives.translated import translate_table
from raytracer.core.primitives.triangles import DeformingSmoothTriangles, DeformingTriangles, SmoothTriangles, Triangles
from tests.plugins.shapes.kernels import Stage, leave, sample_on, trace, uniform_directions, unit
from tests.vectorised import rows, vectorised

Array = NDArray[np.float64]

SHIFT = np.array([3.0, -1.0, 0.5])
ROW = np.zeros(1, np.int32)
CORNERS = np.array([[0.1, 0.0, 0.2], [1.1, 0.5, 0.2], [0.1, 1.0, 0.5]])
BENT = unit([[0.1, 0, 1], [-0.3, 0.2, 1], [0, 0.4, 1]])


def sphere(offset=(0, 0, 0), radius=0.8):
    return Spheres(np.add([[0.3, 0.2, -0.1]], offset), np.array([radius]), ROW)


def quad(offset=(0, 0, 0)):
    return Parallelograms(
        np.add([[-0.5, -0.5, 0.2]], offset), np.array([[1.0, 0.5, 0.0]]), np.array([[0.0, 1.0, 0.3]]), ROW
    )


def disc(offset=(0, 0, 0)):
    return Discs(np.add([[0.1, 0.2, 0.3]], offset), unit([1, 2, -2]), np.array([0.9]), ROW)


def triangle(offset=(0, 0, 0)):
    return Triangles(pad_buffer(CORNERS + offset, np.float32), pad_buffer(np.array([[0, 1, 2]]), np.uint32), ROW)


def smooth(offset=(0, 0, 0)):
    return SmoothTriangles(*triangle(offset), np.ascontiguousarray(BENT, np.float32))


KINDS = {"sphere": sphere, "quad": quad, "disc": disc, "triangle": triangle, "smooth triangle": smooth}
NUMBERS = {kind: number for number, kind in enumerate(KINDS)}
RESTING = tuple(make() for make in KINDS.values())


STEPS = 5
FRAMES = np.stack([CORNERS + step * np.array([[0.3, 0, 0], [0, 0.2, 0.1], [0.1, 0, -0.3]]) for step in range(STEPS)])
FRAMES[2] += [0.0, 0.4, 0.2]
FACE = pad_buffer(np.array([[0, 1, 2]]), np.uint32)
NORMALS = np.stack([unit(BENT + 0.1 * step) for step in range(STEPS)]).astype(np.float32)


def deforming(frames=FRAMES):
    return DeformingTriangles(pad_buffer(frames, np.float32), FACE, ROW)


DEFORMING = (deforming(), DeformingSmoothTriangles(*deforming(), NORMALS))
FLAT, BENDING = len(RESTING), len(RESTING) + 1


def moving_by(shift):
    """A table of each kind, and the deforming triangles, so that one compiled loop serves all tests."""
    # As a vector: of a single number the table could be written to, which is another type.
    return tuple(translate_table(table, np.broadcast_to(shift, 3)) for table in RESTING) + DEFORMING


def shooter(shift, number):
    """`trace` at one of the tables."""
    tables = moving_by(shift)
    return partial(trace, Stage(tables), Accel({number: geometry(tables[number])}))


@kernel
def _carried(tables, number, primitive, hit):
    # Of a module: machine code of what is made within a function is not kept on disk.
    return reproject_at_time_any(tables, number, primitive, hit, 1.0)


def later(number, hits):
    """Where the points that were met are at the end of the shutter's time."""
    hit = type(hits.hit)(*map(rows, map(np.nan_to_num, hits.hit)))
    return vectorised(_carried)(moving_by(SHIFT), number, rows(hits.primitive), hit)


def sample(shift, number, reference, u, time):
    return sample_on(Stage(moving_by(shift)), reference, u, table=number, time=time)


def random_times(count, seed):
    return np.random.default_rng(seed).random(count).astype(np.float32).astype(np.float64)


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_translated_is_met_as_the_resting_one_is_from_a_place_that_moves_along(kind):
    number, times = NUMBERS[kind], random_times(2000, 1)
    origins = 4.0 * uniform_directions(len(times), 1)
    directions = unit(0.6 * uniform_directions(len(times), 2) - origins)
    gone = times[:, None] * SHIFT
    moving = shooter(SHIFT, number)(origins + gone, directions, times=times)
    resting = shooter(0.0, number)(origins, directions)

    # At an edge, float32 may decide either way.
    same = moving.table == resting.table
    assert same.mean() > 0.999
    met = same & (moving.table == number)
    assert met.sum() > 100
    np.testing.assert_allclose(moving.point[met] - gone[met], resting.point[met], atol=1e-12)
    np.testing.assert_allclose(moving.normal[met], resting.normal[met], atol=1e-12)
    np.testing.assert_allclose(moving.shading_normal[met], resting.shading_normal[met], atol=1e-12)

    # Textures stick, and a point is carried to where it will be.
    np.testing.assert_allclose(moving.local[met], resting.point[met], atol=1e-12)
    np.testing.assert_allclose(later(number, moving)[met], resting.point[met] + SHIFT, atol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_points_on_what_is_translated_have_the_density_that_is_said(kind):
    time, reference = 0.75, np.array([2.0, 3.0, 4.0])
    u = np.random.default_rng(3).random((500, 2))
    moving = sample(SHIFT, NUMBERS[kind], reference, u, time)
    resting = sample(0.0, NUMBERS[kind], reference - time * SHIFT, u, time)
    np.testing.assert_allclose(moving.point, resting.point + time * SHIFT, atol=1e-12)
    np.testing.assert_allclose(moving.local, resting.point, atol=1e-12)
    np.testing.assert_allclose(moving.pdf, resting.pdf, rtol=1e-12)
    seen = moving.pdf > 0
    np.testing.assert_allclose(moving.twin[seen], moving.pdf[seen], rtol=1e-9)
    assert np.all(moving.gap >= resting.gap)


@pytest.mark.parametrize(
    ("number", "shift", "middle"),
    [
        *((NUMBERS[kind], shift, 0.0) for kind in ("sphere", "quad", "triangle") for shift in (1e-3, 1.0, 1e3)),
        (FLAT, 0.0, [0.5, 0.8, 0]),
    ],
)
def test_rays_that_leave_what_moves_do_not_meet_it_again(number, shift, middle):
    """The error is that of the coordinates at both ends of the way (hard case 1, with motion)."""
    n, way = 20_000, shift * unit([1, 2, -0.5])[0]
    times = random_times(n, 5)
    origins = 3.0 * uniform_directions(n, 6)
    directions = unit(0.5 * uniform_directions(n, 7) - origins)
    starts = origins + middle + times[:, None] * way
    again = leave(shooter(way, number), starts, directions, uniform_directions(n, 8), times)
    assert (again >= 0).sum() > n / 20
    assert (again == 1).sum() == 0


def test_translated_tables_join_with_their_shifts():
    one, other = translate_table(triangle(), SHIFT), translate_table(triangle((0, 0, 5)), -SHIFT)
    joined = concatenate(one, [one, other])
    buffers = geometry(joined)
    assert len(buffers.vertices) == 2
    np.testing.assert_allclose(buffers.vertices[1][:3], CORNERS + SHIFT, rtol=1e-6)
    np.testing.assert_allclose(buffers.vertices[1][3:], np.add(CORNERS, [0, 0, 5]) - SHIFT, rtol=1e-6)
    assert list(joined.material) == [0, 0]
    np.testing.assert_allclose(areas(joined), areas(triangle())[0], rtol=1e-6)
    keys = [group_key(table) for table in (one, translate_table(smooth(), SHIFT), triangle())]
    assert group_key(one) == group_key(other)
    assert len(set(keys)) == 3
    assert sorted(keys)


# ---- Frames


def at(frames, time):
    """Interpolate between two frames, which are float32 numbers."""
    where = time * (STEPS - 1)
    step = min(int(where), STEPS - 2)
    low, high = (frames[i].astype(np.float32).astype(np.float64) for i in (step, step + 1))
    return np.asarray(low + (where - step) * (high - low))


@pytest.mark.parametrize("bent", [False, True], ids=["flat", "smooth"])
def test_a_deforming_triangle_is_the_triangle_between_its_frames(bent):
    rng = np.random.default_rng(2)
    for time in (0.0, 0.25, 0.1015625, 0.7421875, 1.0):
        corners = at(FRAMES, time)
        weights = rng.dirichlet([1, 1, 1], 200)
        aims = weights @ corners
        origins = aims + 2.0 * unit(np.add(uniform_directions(200, 4), [0, 0, 1.5]))
        number = BENDING if bent else FLAT
        hits = shooter(SHIFT, number)(origins, unit(aims - origins), times=time)
        met = hits.table == number
        assert met.mean() > 0.98
        np.testing.assert_allclose(hits.point[met], aims[met], atol=2e-6)
        normal = unit(np.cross(corners[1] - corners[0], corners[2] - corners[0]))[0]
        np.testing.assert_allclose(hits.normal[met], np.broadcast_to(normal, aims.shape)[met], atol=1e-13)
        np.testing.assert_allclose((hits.point[met] - corners[0]) @ normal, 0.0, atol=1e-13)
        np.testing.assert_allclose(hits.local[met], weights[met] @ at(FRAMES, 0.0), atol=4e-6)
        np.testing.assert_allclose(later(number, hits)[met], weights[met] @ at(FRAMES, 1.0), atol=4e-6)
        if bent:
            between = unit(weights @ at(NORMALS, time))
            agree = np.linalg.norm(hits.shading_normal[met] - between[met], axis=1) < 1e-5
            # Where it would be on the face's inside, the face's own normal is used.
            np.testing.assert_array_equal(agree, (between @ normal > 0.0)[met])
            np.testing.assert_allclose(
                hits.shading_normal[met][~agree], np.tile(normal, ((~agree).sum(), 1)), atol=1e-12
            )
            assert agree.mean() > 0.5


def test_points_on_a_deforming_triangle_lie_in_it_at_the_time():
    time, reference = 0.6328125, [1.0, 2.0, 5.0]
    points = sample(SHIFT, FLAT, reference, np.random.default_rng(3).random((300, 2)), time)
    corners = at(FRAMES, time)
    u = np.linalg.lstsq((corners[1:] - corners[0]).T, (points.point - corners[0]).T, rcond=None)[0]
    assert u.min() > -1e-12
    assert u.sum(axis=0).max() < 1 + 1e-12
    np.testing.assert_allclose(points.twin, points.pdf, rtol=1e-12)
    way = points.point - reference
    area = 0.5 * np.linalg.norm(np.cross(corners[1] - corners[0], corners[2] - corners[0]))
    expected = np.linalg.norm(way, axis=1) ** 3 / (np.abs(np.sum(way * points.normal, axis=1)) * area)
    np.testing.assert_allclose(points.pdf, expected, rtol=1e-12)


def test_deforming_tables_join_if_their_steps_agree():
    one, other = deforming(), deforming(np.add(FRAMES, [0, 0, 7]))
    joined = concatenate(one, [one, other])
    assert joined.vertices.shape == (STEPS, 6, 3)
    np.testing.assert_array_equal(joined.vertices[:, 3:], other.vertices)
    np.testing.assert_array_equal(joined.faces, [[0, 1, 2], [3, 4, 5]])
    assert len(geometry(joined).vertices) == STEPS
    assert group_key(one) == group_key(other) != group_key(deforming(FRAMES[:3]))
    moved = geometry(translate_table(joined, SHIFT)).vertices
    np.testing.assert_allclose(moved[-1], joined.vertices[-1] + SHIFT, rtol=1e-6)
    np.testing.assert_allclose(moved[1], joined.vertices[1] + SHIFT / 4, rtol=1e-6)
