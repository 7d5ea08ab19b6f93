"""Log the path of one sample as it is traced, an event a row.

The path tracer calls `record` once a step, with an event; without a PathLog in the workspace that compiles to nothing.
So a logged path has the vertices and the random numbers of the same path in a picture.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core import embree
from raytracer.core.compiler.dispatch import generic, kernel, optional
from raytracer.core.geometry import Interaction
from raytracer.core.vec import Vec3, load_vector, norm, sub
from raytracer.kernel.path_rows import load3, store3
from raytracer.kernel.path_state import BATCH

# Kinds of events, in the first column of a row.
START, SURFACE, ESCAPE, MEDIUM, EMISSION, SCATTER = range(6)
SHADOW_RAY, UNOCCLUDED, OCCLUDED, PASSED_THROUGH, FINISHED, RETRACE = range(6, 12)

# Columns of every event: the round of the batch, and the radiance that the path has gathered by then.  FIRST is the
# first column that depends on the kind.
ROUND, RADIANCE, FIRST = 1, 2, 5

COLUMNS = 40


class PathLog(NamedTuple):
    """The log of one sample's path.

    Attributes
    ----------
    sample : number of the sample in its batch.
    rows : float64 (n, COLUMNS), the events; those beyond n are counted only.
    state : int64 (2,), rows so far, and the batch's round.
    ends : float64 (BATCH,), the length (m) of each shadow ray.
    probe : packets for the ray that finds what occludes a shadow ray.
    """

    sample: int
    rows: NDArray[np.float64]
    state: NDArray[np.int64]
    ends: NDArray[np.float64]
    probe: embree.RayPackets


def path_log(sample: int, events: int) -> PathLog:
    """Make an empty log of at most `events` events of a sample of a batch."""
    return PathLog(sample, np.zeros((events, COLUMNS)), np.zeros(2, np.int64), np.zeros(BATCH), embree.ray_packets())


# ---- What the path tracer calls


@optional
def record(log, work, sample, event):
    """Record an event of a sample's path."""


@record.register(PathLog)
def record_path_log(log, work, sample, event):
    if sample != log.sample:
        return
    # In a full log the last row is written again.
    row = min(log.state[0], len(log.rows) - 1)
    log.state[0] += 1
    log.rows[row, ROUND] = log.state[1]
    store3(log.rows, row, RADIANCE, load3(work.radiance, sample, 0))
    kind, numbers = describe_event(event, log, work)
    log.rows[row, 0] = kind
    for column in range(len(numbers)):
        log.rows[row, FIRST + column] = numbers[column]


@optional
def begin_round(log, number):
    """Set the number of the batch's round, which later events happen in."""


@begin_round.register(PathLog)
def begin_round_path_log(log, number):
    log.state[1] = number


# ---- Events


@generic
def describe_event(event, log, work):
    """Return the kind of an event, and what it holds: one or more numbers, for the columns from FIRST on."""


class CameraRay(NamedTuple):
    """A camera ray.

    Attributes
    ----------
    film_x, film_y (px) : where it is on the film.
    time : the fraction of the exposure, or None.
    factors : three by which its radiance is multiplied: the filter's, the shutter's, the camera's.
    wavelength (nm) : of the ray in the camera's lens, or NaN.
    """

    film_x: float
    film_y: float
    time: Any
    origin: Vec3
    direction: Vec3
    factors: Vec3
    wavelength: float


@kernel
def _time_or_nan(time):
    if time is None:
        return math.nan
    return time


@describe_event.register(CameraRay)
def describe_event_camera_ray(event, log, work):
    place = (event.film_x, event.film_y, _time_or_nan(event.time))
    return START, (*place, *event.origin, *event.direction, *event.factors, event.wavelength)


class Retrace(NamedTuple):
    """A path is traced again, from the camera on, for its wavelength of this `number`."""

    number: int


@describe_event.register(Retrace)
def describe_event_retrace(event, log, work):
    return RETRACE, (float(event.number),)


@kernel
def _logged_ray(log, work):
    """Return the ray, throughput and pdf of the path as they were before the medium on the way."""
    ray = work.paths.ray[log.sample]
    return (*load_vector(ray.origin), *load_vector(ray.direction), *load_vector(ray.throughput), ray.pdf)


class Escape(NamedTuple):
    """A path leaves the scene with this throughput; `radiance` is that of the environment there."""

    throughput: Vec3
    radiance: Vec3


@describe_event.register(Escape)
def describe_event_escape(event, log, work):
    return ESCAPE, (*_logged_ray(log, work), *event.throughput, *event.radiance)


class MediumFlight(NamedTuple):
    """A path goes through a medium.

    Attributes
    ----------
    medium : reference of the medium.
    surface_distance (m) : to the next surface.
    distance (m) : to the point where it scatters; inf if it comes to the surface.
    weight : by channel, what its throughput is multiplied by.
    throughput : after that.
    """

    medium: int
    surface_distance: float
    distance: float
    weight: Vec3
    throughput: Vec3


@describe_event.register(MediumFlight)
def describe_event_medium_flight(event, log, work):
    flight = (float(event.medium), event.surface_distance, event.distance)
    return MEDIUM, (*_logged_ray(log, work), *flight, *event.weight, *event.throughput)


class SurfaceHit(NamedTuple):
    """A path meets a surface, with this throughput; wavelengths (nm) that it does not carry are NaN."""

    surface: Interaction
    throughput: Vec3
    wavelengths: Vec3


@describe_event.register(SurfaceHit)
def describe_event_surface_hit(event, log, work):
    surface, hit = event.surface, event.surface.hit
    ids = (float(surface.instance), float(surface.table), float(surface.primitive))
    materials = (1.0 if surface.front else 0.0, float(hit.material), float(surface.material))
    place = (*hit.point, *hit.normal, *hit.shading_normal, hit.u, hit.v, hit.offset)
    seen = (*_logged_ray(log, work), surface.distance, *ids, *place, *materials)
    return SURFACE, (*seen, *event.throughput, *event.wavelengths)


class Emission(NamedTuple):
    """A surface emits this radiance, which counts with this MIS weight."""

    radiance: Vec3
    weight: float


@describe_event.register(Emission)
def describe_event_emission(event, log, work):
    return EMISSION, (*event.radiance, event.weight)


class Scattering(NamedTuple):
    """A path scatters at a surface or, where the normal is zero, in a medium; a survival of 0 ends it there."""

    normal: Vec3
    outgoing: Vec3
    weight: Vec3
    pdf: float
    throughput: Vec3
    survival: float
    wavelengths: Vec3


@describe_event.register(Scattering)
def describe_event_scattering(event, log, work):
    scatter = (*event.normal, *event.outgoing, *event.weight, event.pdf)
    return SCATTER, (*scatter, *event.throughput, event.survival, *event.wavelengths)


class ShadowRay(NamedTuple):
    """A shadow ray is queued.

    Attributes
    ----------
    slot : the ray's in the queue.
    start (m) : its origin.
    light : the LightSample that it goes to.
    value, pdf : of the BSDF or the phase function.
    weight : the MIS weight.
    radiance : what it brings if nothing is in its way.
    """

    slot: int
    start: Vec3
    light: Any
    value: Vec3
    pdf: float
    weight: float
    radiance: Vec3


@describe_event.register(ShadowRay)
def describe_event_shadow_ray(event, log, work):
    light = event.light
    distance = max(0.0, norm(sub(light.target, event.start)) - light.gap)
    log.ends[event.slot] = distance
    sampled = (*event.start, *light.direction, *light.target, *light.weight, light.pdf)
    return SHADOW_RAY, (*sampled, *event.value, event.pdf, event.weight, *event.radiance, distance)


class Unoccluded(NamedTuple):
    """A shadow ray arrives with this radiance, which has been added to its sample."""

    radiance: Vec3


@describe_event.register(Unoccluded)
def describe_event_unoccluded(event, log, work):
    return UNOCCLUDED, event.radiance


class ShadowHit(NamedTuple):
    """The shadow ray of a slot meets a surface: it ends there, or goes on through it."""

    slot: int
    is_through: bool


@describe_event.register(ShadowHit)
def describe_event_shadow_hit(event, log, work):
    return PASSED_THROUGH if event.is_through else OCCLUDED, _logged_hit(work.shadows.rays, event.slot)


@kernel
def _logged_hit(rays, lane):
    """Return Embree's ids of a hit, and its distance."""
    part = (float(embree.load_int(rays, lane, embree.GEOMETRY)), float(embree.load_int(rays, lane, embree.PRIMITIVE)))
    array = float(embree.load_int(rays, lane, embree.INSTANCE))
    placement = float(embree.load_int(rays, lane, embree.PLACEMENT))
    return (*part, array, placement, np.float64(embree.load_float(rays, lane, embree.TFAR)))


class Occluded(NamedTuple):
    """The shadow ray of a slot is occluded, in the Embree scene of this address: by what, a ray of the log finds."""

    slot: int
    accel: int


@describe_event.register(Occluded)
def describe_event_occluded(event, log, work):
    probe, shadows = log.probe, work.shadows.rays
    # All of the ray that stands before its end.
    for field in range(embree.TFAR):
        embree.store_float(probe, 0, field, embree.load_float(shadows, event.slot, field))
    embree.store_float(probe, 0, embree.TFAR, log.ends[event.slot])
    embree.intersect(event.accel, probe, 1)
    return OCCLUDED, _logged_hit(probe, 0)


class Finished(NamedTuple):
    """The finished sample.

    Attributes
    ----------
    value, clamped : its value, and that after the clamp if it is finite.
    wavelength (nm) : of its ray in the camera's lens, or NaN.
    """

    value: Vec3
    clamped: Vec3
    wavelength: float


@describe_event.register(Finished)
def describe_event_finished(event, log, work):
    return FINISHED, (*event.clamped, work.weight[log.sample], *event.value, event.wavelength)
