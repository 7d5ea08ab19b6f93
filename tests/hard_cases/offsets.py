"""Rays that leave a surface, at all sizes."""

import numpy as np

from tests.hard_cases.harness import Measured, hard_case
from tests.plugins.shapes.kernels import built, cast, spawn, uniform_directions, unit
from tests.plugins.shapes.test_offsets import SCALES, flat

_NEAREST = 1e-3
_NUDGE = 1e-4


@hard_case(
    15,
    "Waechter, Binder 2019, Ray Tracing Gems ch. 6; pbrt-v4, sec. 6.8.6; measured with Embree 4.4",
    quick=10_000,
    thorough=1_000_000,
    scene="15_sizes.yaml",
)
def tilted_planes_of_all_sizes(rays: int) -> list[Measured]:
    """Rays that leave a tilted plane of 1 mm, 1 m, 1 km or 1000 km to either side: what is flat is not met twice.

    Lengths that suit one size, as a least distance of 1 mm or 0.1 mm along the normal, are too short for another;
    4 ulp of the plane's own coordinates suit all, and leave a plane of 1 mm in its place.
    """
    ours, bare, nearest, nudged = 0, 0, 0, 0
    for size in SCALES:
        table = (flat("parallelogram", size),)
        accel = built(*table)
        middle = size * (np.array([0.7, 0.3, -0.2]) + 0.5 * np.array([0.8, 1.2, 0.7]))
        origins = middle + 3.0 * size * uniform_directions(rays, 1)
        targets = middle + 0.5 * size * np.random.default_rng(2).uniform(-1.0, 1.0, (rays, 3))
        ways = unit(targets - origins)
        hits = cast(table, origins, ways, accel=accel)
        met = hits.table == 0
        onwards = uniform_directions(rays, 3)[met]
        starts = spawn(table, origins[met], ways[met], onwards, accel=accel)
        ours += int((cast(table, starts, onwards, accel=accel).table == 0).sum())
        again = cast(table, hits.point[met], onwards, accel=accel)
        bare += int((again.table == 0).sum())
        nearest += int(((again.table == 0) & (again.near > _NEAREST)).sum())
        side = np.sign((onwards * hits.normal[met]).sum(axis=1))[:, None]
        nudged += int(
            (cast(table, hits.point[met] + _NUDGE * side * hits.normal[met], onwards, accel=accel).table == 0).sum()
        )
    return [
        Measured("self-hits, against no offset", bare, ours, 0.0),
        Measured("self-hits, against a least distance of 1 mm", nearest, ours, 0.0),
        Measured("self-hits, against 0.1 mm along the normal", nudged, ours, 0.0),
    ]  # fmt: skip
