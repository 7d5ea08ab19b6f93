"""Poses, rays of cameras that move, rays at scenes with a time of their own, and the times of samples."""

from functools import partial
from typing import Any

import numpy as np

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.motion.interpolation import Trajectories, pack_trajectories, pose_at
from raytracer.core.sampling import SAMPLERS
from raytracer.core.shutter.table import Shutter
from raytracer.core.vec import madd
from raytracer.kernel.camera_rays import sample_time
from raytracer.plugins.cameras.base.interface import packet_rays, project
from raytracer.plugins.materials.base.interface import Draws
from tests.plugins.cameras.kernels import packet_rows, single_ray
from tests.plugins.shapes.kernels import Array, Stage, trace
from tests.vectorised import random_draws, rows, vectorised


def poses(trajectories: Any, times: Any, index: int = 0) -> Array:
    """Matrices (n, 3, 4) of a trajectory at times (n,)."""
    table = trajectories if isinstance(trajectories, Trajectories) else pack_trajectories([trajectories])
    return np.stack(vectorised(pose_at)(table, index, rows(np.array(times, np.float64, ndmin=1))), axis=1)


def shooter(packed: Any) -> Any:
    """`trace` in a packed scene."""
    scene = packed.scene
    return partial(trace, Stage(scene.primitives, scene.accuracy, scene.instances), packed.build())


@kernel
def _ray(camera, packet, x, y, time, draws):
    origin, direction, _ = single_ray(packet_rays(camera), camera, packet, x, y, time, draws)
    return origin, direction, project(camera, madd(origin, 2.0, direction), time)


def camera_rays(camera: Any, x: Any, y: Any, times: Any) -> tuple[Array, Array, Array]:
    """Origins and directions (n, 3) at film positions and times (n,), and what `project` makes of points on them."""
    places = (rows(np.array(np.broadcast_to(values, np.shape(x)), np.float64)) for values in (x, y, times))
    return vectorised(_ray)(camera, packet_rows(), *places, random_draws(len(x), dimension=0))


def drawn_times(
    shutter: Shutter, count: int, x: float = 0.5, y: float = 0.5, *, sampler: str = "sobol", pixel: int = 5
) -> tuple[Array, Array]:
    """The times (n,) of samples at a place of the film, and their weights."""
    draws = Draws(SAMPLERS[sampler](3, count), np.uint64(pixel), rows(np.arange(count)), 0)
    times, weights = vectorised(sample_time)(shutter, x, y, draws).T
    return times, weights
