"""Tables placed by matrices or moved along trajectories, and rays at them."""

from typing import Any, NamedTuple

import numpy as np

from raytracer.core.embree import Accel, InstanceArray
from raytracer.core.geometry import Exact
from raytracer.core.instancing import Instances
from raytracer.core.motion.interpolation import pack_trajectories
from raytracer.core.primitives.base.interface import geometry
from tests.plugins.shapes.kernels import Array, Hits, Stage, trace

__all__ = ["Scenery", "Stage", "cast", "moving", "placed"]

_STILL = np.eye(1, 16, dtype=np.float64)


class Scenery(NamedTuple):
    """What kernels and Embree need of a scene."""

    stage: Stage
    accel: Accel


def _scenery(tables: Any, only: Any, pose: Array, paths: Any, steps: Any, material: Any, exact: bool) -> Scenery:
    count = len(steps[0])
    # Nothing of what is there or not is None, so that all have one type.
    own = np.full(count, -1, np.int32) if material is None else np.array(material, np.int32)
    shown = range(len(tables)) if only is None else [only]
    instances = Instances(
        group=np.zeros(count, np.int32),
        pose=pose,
        trajectories=pack_trajectories(paths or [_STILL]),
        material=own,
        rows=np.zeros((1, len(tables)), np.int32),
        arrays=np.zeros(1, np.int32),
        base=len(tables),
        emissive=None,
    )
    accel = Accel(
        {},
        [{number: geometry(tables[number]) for number in shown}],
        [InstanceArray(np.zeros(count, np.uint32), tuple(np.ascontiguousarray(step, np.float32) for step in steps))],
        first_instance=len(tables),
    )
    return Scenery(Stage(tables, Exact() if exact else None, instances), accel)


def placed(tables: Any, matrices: Any, *, only: Any = None, material: Any = None, exact: bool = True) -> Scenery:
    """A group of tables, or of `only` one of them, placed by matrices (n, 4, 4)."""
    poses = np.ascontiguousarray(np.asarray(matrices, np.float64).reshape(-1, 4, 4)[:, :3])
    return _scenery(tables, only, poses, None, [poses.reshape(-1, 12)], material, exact)


def moving(tables: Any, trajectories: Any, *, only: Any = None) -> Scenery:
    """A group of tables, or of `only` one of them, moved along trajectories (steps, 16) of as many steps each."""
    steps = np.stack(list(trajectories), axis=1)
    return _scenery(tables, only, np.empty((0, 3, 4)), trajectories, steps, None, exact=True)


def cast(scenery: Scenery, origins: Any, directions: Any, onwards: Any = (0.0, 0.0, 1.0), times: Any = 0.0) -> Hits:
    """Trace rays (n, 3) and solve their hits."""
    return trace(scenery.stage, scenery.accel, origins, directions, onwards, times)
