"""The state of a batch of paths: a record of each path, the queues of what is traced next, and the buffers of both.

What a path carries besides its ray is there only where the scene calls for it; in all others the field is None.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core import embree
from raytracer.core.compiler.dispatch import kernel, optional
from raytracer.core.embree import PACKET, TIME, RayPackets, store_float
from raytracer.core.shutter.table import Shutter
from raytracer.core.vec import Vec3, load_vector, store_vector
from raytracer.kernel.hero_wavelength import wavelength_rows
from raytracer.kernel.lens_dispersion import LENS_ROWS, WAVELENGTHS_PER_RAY
from raytracer.kernel.packed_scene import Scene
from raytracer.kernel.path_rows import load_number, load_vector_row, store_number, store_vector_row
from raytracer.plugins.materials.base.interface import Draws

BATCH_PIXELS = 256
"""Pixels whose paths advance together; a packet of samples of each.

Of single pixels, packets of rays get emptier with each bounce: the million-triangle box took 1.08 of the time.  By 64
it takes 1.01.
"""

BATCH = BATCH_PIXELS * PACKET
"""Paths that advance together."""

AOV_COLUMNS = 54
"""Columns of a sample for AOVs: eight of their own (`aovs.base.layers`), and what the channels of all of them take."""


class Path(NamedTuple):
    """A path, before its next segment.

    Attributes
    ----------
    sample : the number, in the batch, of the sample that it is traced for.
    depth : the number of that segment, from 1 on; by the rounds of the batch, so it is not stored.
    origin (m), direction : the ray.
    throughput : by channel, or by wavelength where the path carries single wavelengths.
    pdf (1/sr) : of the direction; infinite for the one possible direction of a camera, a mirror or glass.
    time : the fraction of the exposure; None where nothing moves.
    medium : the medium that it is in; None where space is empty.
    vertex (m) : the point at which it scattered last; None where that is the origin, since no surface is transparent.
    passthroughs : the number of surfaces that it went straight through; None likewise.
    """

    sample: int
    depth: int
    origin: Vec3
    direction: Vec3
    throughput: Vec3
    pdf: float
    time: Any
    medium: Any
    vertex: Any
    passthroughs: Any


class Queue(NamedTuple):
    """Samples to trace next, in the order in which it was pushed.

    Attributes
    ----------
    samples : int64 (BATCH,), the sample of each entry.
    size : int64 (1,), the number of entries.
    """

    samples: NDArray[np.int64]
    size: NDArray[np.int64]


RAY_ROW = np.dtype([("origin", "f8", 3), ("direction", "f8", 3), ("throughput", "f8", 3), ("pdf", "f8")])
"""The fields that all paths have, as one record: they lie side by side, at places that the compiler knows."""


SAMPLE_ROW = np.dtype([("key", "u8"), ("index", "i8")])
"""The source of a sample's random numbers: the key of its pixel, and the sample's index in the pixel."""


class PathRows(NamedTuple):
    """The paths of a batch, a row a sample: arrays of the fields of `Path`, and the solids that each is in.

    Attributes
    ----------
    draws : SAMPLE_ROW (BATCH,), what random numbers the path takes.
    ray : RAY_ROW (BATCH,), the fields that all paths have.
    time, medium, vertex, passthroughs : arrays of the others, or None.
    inside_counts : int32 (BATCH, ranks), objects of each rank that the path is in; None without nested dielectrics.
    """

    draws: NDArray[Any]
    ray: NDArray[Any]
    time: Any
    medium: Any
    vertex: Any
    passthroughs: Any
    inside_counts: Any


class ShadowRays(NamedTuple):
    """The shadow rays of a batch, a row a slot of their queue.

    Attributes
    ----------
    rays : the rays, as Embree has them, a lane a slot.
    queue : the Queue of them.
    radiance : float64 (BATCH, 3), what each brings if nothing is in its way.
    target : float64 (BATCH, 4), the end of each, a point and 1 or, at infinity, a direction and 0; None where no
        surface is transparent.
    medium : int64 (BATCH,), the medium that each is in; None without media.
    medium_numbers : int64 (BATCH,), the random numbers used in media; None likewise.
    inside_counts : int32 (BATCH, ranks), as of `PathRows`.
    """

    rays: RayPackets
    queue: Queue
    radiance: NDArray[np.float64]
    target: Any
    medium: Any
    medium_numbers: Any
    inside_counts: Any


class Workspace(NamedTuple):
    """The buffers in which one thread traces a batch of paths.

    Attributes
    ----------
    rays : the rays of the paths in the queue, a lane an entry, as Embree has them.
    queue : the Queue of paths that go on.
    paths : the PathRows.
    shadows : the ShadowRays.
    radiance : float64 (BATCH, 3), by sample: the radiance gathered.
    weight : float64 (BATCH,), by sample: what that is multiplied by in the picture.
    wavelengths : (BATCH,) rows of `hero_wavelength`, by sample; None where nothing disperses.
    lens : float64 (LENS_ROWS, PACKET), the rays of one packet within a camera's lens (`lens_dispersion`).
    lens_weights : float64 (BATCH, WAVELENGTHS_PER_RAY), the weight of each wavelength of a camera ray.
    aov_values : float64 (BATCH, AOV_COLUMNS), by sample: what AOVs recorded of the camera ray and its hit.
    log : the PathLog that records a path, or None.
    """

    rays: RayPackets
    queue: Queue
    paths: PathRows
    shadows: ShadowRays
    radiance: NDArray[np.float64]
    weight: NDArray[np.float64]
    wavelengths: NDArray[Any] | None
    lens: NDArray[np.float64]
    lens_weights: NDArray[np.float64]
    aov_values: NDArray[np.float64]
    log: Any = None


def workspace(scene: Scene | None = None, log: Any = None) -> Workspace:
    """Make a workspace for one thread, with what the paths of a scene carry; by default, nothing but a ray."""
    moves, space, transparency, nested, spectrum = (
        (None,) * 5
        if scene is None
        else (scene.shutter, scene.media, scene.transparency, scene.nested_dielectrics, scene.spectrum)
    )

    def rows(*columns: int, of: Any = ..., dtype: Any = np.float64) -> Any:
        return None if of is None else np.zeros((BATCH, *columns), dtype)

    def queue() -> Queue:
        return Queue(np.zeros(BATCH, np.int64), np.zeros(1, np.int64))

    ranks = 0 if nested is None else len(nested.surface)
    paths = PathRows(
        draws=rows(dtype=SAMPLE_ROW),
        ray=rows(dtype=RAY_ROW),
        time=rows(of=moves),
        medium=rows(of=space, dtype=np.int64),
        vertex=rows(3, of=transparency),
        passthroughs=rows(of=transparency, dtype=np.int64),
        inside_counts=rows(ranks, of=nested, dtype=np.int32),
    )
    shadows = ShadowRays(
        rays=embree.ray_packets(BATCH),
        queue=queue(),
        radiance=rows(3),
        target=rows(4, of=transparency),
        medium=rows(of=space, dtype=np.int64),
        medium_numbers=rows(of=space, dtype=np.int64),
        inside_counts=rows(ranks, of=nested, dtype=np.int32),
    )
    return Workspace(
        rays=embree.ray_packets(BATCH),
        queue=queue(),
        paths=paths,
        shadows=shadows,
        radiance=rows(3),
        weight=rows(),
        wavelengths=wavelength_rows(spectrum, BATCH),
        lens=np.zeros((LENS_ROWS, PACKET)),
        lens_weights=rows(WAVELENGTHS_PER_RAY),
        aov_values=rows(AOV_COLUMNS),
        log=log,
    )


# ---- Queues


@kernel
def push(queue, sample):
    """Add an entry to a queue; returns its number."""
    entry = queue.size[0]
    queue.samples[np.uintp(entry)] = sample
    queue.size[0] = entry + 1
    return entry


@kernel
def take_all(queue):
    """Empty a queue, whose entries can be read until as many are pushed; returns how many there were."""
    size = queue.size[0]
    queue.size[0] = 0
    return size


# ---- Paths


@kernel
def _segment_number(rounds, passthroughs):
    """Return the number of a path's segment after so many rounds of its batch: straight passages are none."""
    if passthroughs is None:
        return rounds + 1
    return rounds + 1 - passthroughs


@kernel
def load_path(work, lane, rounds):
    """Load the path of a lane, after so many rounds of its batch."""
    paths, sample = work.paths, work.queue.samples[lane]
    passthroughs = load_number(paths.passthroughs, sample)
    ray = paths.ray[np.uintp(sample)]
    origin, direction, throughput = load_vector(ray.origin), load_vector(ray.direction), load_vector(ray.throughput)
    time, medium = load_number(paths.time, sample), load_number(paths.medium, sample)
    depth, vertex = _segment_number(rounds, passthroughs), load_vector_row(paths.vertex, sample)
    return Path(sample, depth, origin, direction, throughput, ray.pdf, time, medium, vertex, passthroughs)


@kernel
def store_path(work, path):
    """Store a path that goes on, and queue its next segment."""
    paths, sample = work.paths, path.sample
    ray = paths.ray[np.uintp(sample)]
    store_vector(ray.origin, path.origin)
    store_vector(ray.direction, path.direction)
    store_vector(ray.throughput, path.throughput)
    ray.pdf = path.pdf
    store_number(paths.time, sample, path.time)
    store_number(paths.medium, sample, path.medium)
    store_vector_row(paths.vertex, sample, path.vertex)
    store_number(paths.passthroughs, sample, path.passthroughs)
    push(work.queue, sample)


@kernel
def store_draws(work, sample, key, index):
    """Store where the random numbers of a sample come from."""
    row = work.paths.draws[np.uintp(sample)]
    row.key = key
    row.index = index


@kernel
def sample_draws(scene, work, sample, dimension):
    """Return the random numbers of a sample from a dimension on."""
    row = work.paths.draws[np.uintp(sample)]
    return Draws(scene.sampler, row.key, row.index, dimension)


@kernel
def with_throughput(path, throughput):
    """Return a path with another throughput."""
    sample, depth, origin, direction, _, pdf, time, medium, vertex, passthroughs = path
    return Path(sample, depth, origin, direction, throughput, pdf, time, medium, vertex, passthroughs)


@optional
def _next_vertex(vertex, point):
    """Return the vertex of a path that scatters at `point`; None where paths keep none."""


@_next_vertex.register(tuple)
def _next_vertex_tuple(vertex, point):
    return point


@kernel
def scattered_path(path, point, origin, direction, throughput, pdf, medium):
    """Return a path that scattered at `point`, and goes on along a ray from `origin` within a medium.

    Its depth stays that of the segment before: the next is counted when it is loaded.
    """
    vertex = _next_vertex(path.vertex, point)
    return Path(
        path.sample, path.depth, origin, direction, throughput, pdf, path.time, medium, vertex, path.passthroughs
    )


@kernel
def path_time(work, sample):
    """Return the time of a sample's path, a fraction of the exposure; None where nothing moves."""
    return load_number(work.paths.time, sample)


@optional
def set_ray_time(shutter, rays, lane, time):
    """Write a ray's time into a lane."""


@set_ray_time.register(Shutter)
def set_ray_time_shutter(shutter, rays, lane, time):
    store_float(rays, lane, TIME, time)


@kernel
def last_vertex(vertex, origin):
    """Return the point at which a path scattered last, or left the camera, by its `vertex` and `origin`."""
    if vertex is None:
        return origin
    return vertex
