"""What is far from the origin, what is large, and what turns fast."""

from collections.abc import Sequence
from typing import Any
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from raytracer.analysis.compare import z_test
from raytracer.core.geometry import OFFSET_ULPS
from raytracer.core.primitives.spheres import Spheres
from raytracer.core.world_origin import Origin
from raytracer.scene.load import load
from raytracer.scene.pack.layout import Layout
from raytracer.scene.pack.scene import PackedScene, pack
from raytracer.scene.spec import SceneSpec
from tests.core.motion.kernels import poses
from tests.hard_cases.harness import SCENES, Measured, hard_case
from tests.moving import Picture, checked, document, moved, pictured
from tests.plugins.shapes.kernels import cast, unit

Array = NDArray[np.float64]

_ODDS = 1e-4
"""With which noise alone may be called an error."""


def _spheres(centers: Any, radii: Any) -> Spheres:
    return Spheres(np.array(centers, np.float64), np.array(radii, np.float64), np.zeros(len(radii), np.int32))


def _true_distance(origins: Any, directions: Any, center: Any, radius: float) -> NDArray[np.longdouble]:
    """The nearer distance to a sphere in extended precision, by the form that does not cancel; NaN for a miss."""
    to = np.asarray(center, np.longdouble) - np.asarray(origins, np.longdouble)
    ways = np.asarray(directions, np.longdouble)
    ways = ways / np.sqrt((ways * ways).sum(axis=1))[:, None]
    along = (to * ways).sum(axis=1)
    across = to - along[:, None] * ways
    c = (to * to).sum(axis=1) - np.longdouble(radius) ** 2
    with np.errstate(invalid="ignore"):
        root = np.sqrt(np.longdouble(radius) ** 2 - (across * across).sum(axis=1))
    return np.asarray(c / (along + np.copysign(root, along)))


# ---- 4


@hard_case(
    4,
    "RayTracing/raytracing.github.io, the ground sphere of every scene; Haines et al. 2019, Ray Tracing Gems ch. 7",
    quick=4000,
    thorough=400_000,
    scene="04_large_ground.yaml",
)
def large_ground(rays: int) -> list[Measured]:
    """Ground spheres of radius 1 km to 1000 km, seen from 2 m above: by how much hits are above or below the ground.

    Embree's float32 puts hits off by an ulp of the radius, 0.12 m for the largest.  Solved again in float64, the
    closest approach and half the chord are each known to a few roundings of 2^-53 of |c| + R, eight in all, and an
    error of the distance counts off the ground times the cosine.
    """
    rng = np.random.default_rng(4)
    result = []
    for radius in (1e3, 1e4, 1e5, 1e6):
        table = _spheres([[0.0, -radius, 0.0]], [radius])
        origins = np.column_stack([rng.uniform(-5, 5, rays), np.full(rays, 2.0), rng.uniform(-5, 5, rays)])
        # Down, by up to 60 degrees off the vertical.
        sine, turn = np.sin(np.arccos(1.0 - 0.5 * rng.random(rays))), rng.uniform(0.0, 2.0 * np.pi, rays)
        directions = np.column_stack([sine * np.cos(turn), -np.sqrt(1.0 - sine**2), sine * np.sin(turn)])
        truth = _true_distance(origins, directions, table.center[0], radius)
        height = []
        for exact in (False, True):
            hits = cast((table,), origins, directions, exact=exact)
            # Embree's own distance is what a program has that takes its hits as they are.
            reached = np.linalg.norm(hits.point - origins, axis=1) if exact else hits.near
            off = np.abs(np.where(hits.table < 0, np.inf, reached) - truth)
            height.append(float((off * np.abs(directions[:, 1])).max()))
        tolerance = 8.0 * 2.0**-53 * 2.0 * radius
        result.append(Measured(f"hits off the ground, R = {radius:.0e} m (m)", height[0], height[1], tolerance))
    return result


# ---- 16


def _unmoved(spec: SceneSpec, layout: Layout, assets: Any) -> tuple[Layout, Origin]:
    """Pack a scene where it was written; its type is that of a scene that is moved."""
    return layout, Origin((0.0, 0.0, 0.0), None)


def _naive(spec: SceneSpec) -> PackedScene:
    with patch("raytracer.scene.pack.world.shift_origin", _unmoved):
        return pack(spec)


def _largest_z(first: Picture, second: Picture) -> tuple[float, int]:
    """The largest difference of two pictures' tiles, in standard deviations, and how many there are."""
    found = z_test(first.radiance, first.variance, second.radiance, second.variance).tile_z
    return float(np.abs(found).max()), found.size


def _first_hits(
    packed: PackedScene, written: Sequence[Any], origins: Array, directions: Array, *, exact: bool
) -> Array:
    """Measure the errors (n,) of a packed scene's hits, for rays (n, 3) of the scene as written."""
    (table,) = packed.scene.primitives
    assert len(written) == len(table.radius)
    truth = np.array([_true_distance(origins, directions, item.center, item.radius) for item in written])
    hits = cast((table,), origins + packed.shift, directions, exact=exact)
    reached = np.linalg.norm(hits.point - (origins + packed.shift), axis=1) if exact else hits.near
    own = truth[hits.primitive, np.arange(len(origins))]
    return np.asarray(np.abs(np.where(hits.table < 0, np.inf, reached) - own), np.float64)


@hard_case(
    16,
    "Cozzi, Ring 2011, 3D Engine Design for Virtual Globes, sec. 5.2-5.4 (relative to centre); pbrt-v4 sec. 6.8",
    quick=96,
    thorough=4096,
    scene="16_far_from_origin.yaml",
)
def far_from_origin(samples: int) -> list[Measured]:
    """A still life a million metres from the origin in each direction, against the same at the origin.

    Packed where it was written, its balls of 0.05 to 0.5 m are put on a grid of 0.0625 m, and spawned rays leave by
    0.48 m, over the balls.  Moved in float64 first, which rounds nothing, hits are good to eight roundings of the way
    plus twice the ground's radius, over the cosine, which is 0.2 where the ground is farthest; rays leave by four ulp
    of the ground's extent; and the picture's tiles differ by noise alone.
    """
    path = SCENES / "16_far_from_origin.yaml"
    spec = load(path)
    ours, naive = pack(spec), _naive(spec)
    at_origin = _naive(checked(moved(document(path), (-1e6, 1e6, -1e6)), SCENES))

    # Rays from the camera, to each ball and to the ground.
    rng = np.random.default_rng(16)
    aims = np.concatenate(
        [np.array(item.center) + 0.5 * item.radius * unit(rng.normal(size=(64, 3))) for item in spec.objects[1:]]
    )
    ground = np.array([1e6, -1e6, 1e6]) + rng.uniform(-2.0, 2.0, (64, 3)) * [1.0, 0.0, 1.0]
    aims = np.concatenate([aims, ground])
    origins = np.broadcast_to(spec.camera.look_from, aims.shape)
    directions = unit(aims - origins)
    error = [_first_hits(found, spec.objects, origins, directions, exact=found is ours) for found in (naive, ours)]
    bound = 8.0 * 2.0**-53 * (2.0 * 1000.0 + 10.0) / 0.2
    leave = [
        float(cast(found.scene.primitives, origins + found.shift, directions).offset.max()) for found in (naive, ours)
    ]

    here = pictured(at_origin, spp=samples, seed=1)
    z = [_largest_z(pictured(found, spp=samples, seed=2), here) for found in (naive, ours)]
    most = float(norm.isf(0.5 * _ODDS / z[0][1]))
    return [
        Measured("first hits off, of 8 things (m)", float(np.nanmax(error[0])), float(error[1].max()), bound),
        Measured("what rays leave the surface by (m)", leave[0], leave[1], OFFSET_ULPS * 2020.0),
        Measured("largest z of a tile, against the scene at the origin", z[0][0], z[1][0], most),
    ]


# ---- 30


def _linear(time: Array, segments: int) -> Array:
    """Compute places (n, 2) of a point at (1, 0, 0) that goes round once in straight parts."""
    step = np.minimum(np.floor(time * segments), segments - 1)
    ends = [2.0 * np.pi * (step + k) / segments for k in (0, 1)]
    start, end = (np.column_stack([np.cos(angle), np.sin(angle)]) for angle in ends)
    fraction = (time * segments - step)[:, None]
    return np.asarray(start + fraction * (end - start))


@hard_case(
    30,
    "Embree 4 API reference, RTCQuaternionDecomposition; Shoemake 1985",
    quick=2000,
    thorough=200_000,
    scene="30_spin.yaml",
)
def spin(times: int) -> list[Measured]:
    """A lamp that goes round by 360 degrees while the shutter is open, on a circle of 1 m.

    Vertices that go straight from step to step draw it in by 1 - cos(180 deg / N): 29.3 % for a quarter turn in one
    step, 1.92 % for a turn in 16, 0.03 % in the 128 that there may be.  A trajectory of quaternions stays on the
    circle: between two steps a quaternion has the length 1 but for six roundings, its matrix, of products of two,
    doubles them twice, and applying it adds eight.  Embree's angles are good to 4e-6, so it meets all but the edge of
    the lamp.
    """
    packed = pack(load(SCENES / "30_spin.yaml"))
    instances = packed.scene.instances
    assert instances is not None
    assert instances.trajectories is not None
    time = np.random.default_rng(30).random(times).astype(np.float32).astype(np.float64)
    pose = poses(instances.trajectories, time)
    middle = pose[:, :, 0] + pose[:, :, 3]
    angle = 2.0 * np.pi * time
    round_ = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(times)])
    off = float(np.abs(np.linalg.norm(middle, axis=1) - 1.0).max())

    quarter = np.array([0.5]) / 4.0
    drawn_in = float(1.0 - np.linalg.norm(_linear(quarter, 4)))
    finest = float((1.0 - np.linalg.norm(_linear(time, 128), axis=1)).max())

    # Rays down on the lamp, 99 % of its radius out from its middle and in.
    accel = packed.build()
    lamp = next(number for number, table in enumerate(packed.scene.primitives) if isinstance(table, Spheres))
    missed = naive_missed = 0
    for out in (0.901, 1.099):
        for moment, place, straight in zip(time, out * round_, _linear(time, 16), strict=True):
            found = accel.cast([place[0], place[1], 4.0], [0.0, 0.0, -1.0], time=moment)
            missed += found is None or found.geometry != lamp
            naive_missed += bool(np.hypot(*(place[:2] - straight)) > 0.1)
    roundings = 32.0 * 2.0**-53
    return [
        Measured("drawn in: a quarter turn, by one straight step", drawn_in, off, roundings),
        Measured("drawn in: a turn, by 128 straight steps", finest, off, roundings),
        Measured("rays that miss the lamp; by 16 straight steps", naive_missed, missed, 0.0),
    ]
