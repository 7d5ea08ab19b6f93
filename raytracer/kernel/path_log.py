"""One path written down as it is traced: an event a row.

What writes is a part of the path tracer where a workspace holds a PathLog; the functions here, called on None, compile
to nothing.  So a path that is looked at takes the way, and the random numbers, of the same path in a picture.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer import embree
from raytracer.embree import DIRECTION, GEOMETRY, INSTANCE, ORIGIN, PLACEMENT, PRIMITIVE, TFAR, TIME, Packet
from raytracer.jit import generic, kernel
from raytracer.paths import load3
from raytracer.vec import norm, sub

# What a row tells of, in its first column.
START, SURFACE, LEAVES, FLIGHT, EMITS, SCATTERS, AIMS, ARRIVES, BLOCKED, PASSES, DONE, AGAIN = range(12)

# The round of the packet, the radiance that the path has gathered by then, and the first column of what depends on the
# kind.
ROUND, GATHERED, FIRST = 1, 2, 5

COLUMNS = 40


class PathLog(NamedTuple):
    """Where the path of one sample is written down.

    sample, which one of its packet; rows (n, COLUMNS) float64, those beyond n are counted only; state (2,) int64, rows
    so far, and the packet's round; ends (PACKET,) float64, how far each shadow ray was to go; probe, for a ray that
    finds what is in the way of one.
    """

    sample: int
    rows: NDArray[np.float64]
    state: NDArray[np.int64]
    ends: NDArray[np.float64]
    probe: Packet


def path_log(sample: int, events: int) -> PathLog:
    """An empty log with room for so many events of a sample of a packet."""
    return PathLog(sample, np.zeros((events, COLUMNS)), np.zeros(2, np.int64), np.zeros(embree.PACKET), embree.packet())


@kernel
def _put(log, row, column, value):
    for axis in range(3):
        log.rows[row, column + axis] = value[axis]


@kernel
def _row(log, work, kind):
    """A new row; where there is no room, the last one again."""
    row = min(log.state[0], len(log.rows) - 1)
    log.state[0] += 1
    log.rows[row, 0] = kind
    log.rows[row, ROUND] = log.state[1]
    _put(log, row, GATHERED, load3(work.radiance, log.sample, 0))
    return row


@kernel
def _put_met(log, row, column, packet, lane):
    """What a ray has met, as Embree names it: four columns."""
    log.rows[row, column] = packet.ints[GEOMETRY, lane]
    log.rows[row, column + 1] = packet.ints[PRIMITIVE, lane]
    log.rows[row, column + 2] = packet.ints[INSTANCE, lane]
    log.rows[row, column + 3] = packet.ints[PLACEMENT, lane]


@generic
def note_start(log, work, sample, film_x, film_y, time, origin, direction, factors, wavelength):
    """A camera ray; factors, three that its radiance is multiplied by: the filter's, the shutter's, the camera's.

    wavelength, that it has in the camera's lens (nm), or NaN.
    """
    raise NotImplementedError


@note_start.register(type(None))
def _(log, work, sample, film_x, film_y, time, origin, direction, factors, wavelength):
    return


@note_start.register(PathLog)
def _(log, work, sample, film_x, film_y, time, origin, direction, factors, wavelength):
    log.state[1] = 0
    if sample != log.sample:
        return
    row = _row(log, work, START)
    log.rows[row, FIRST] = film_x
    log.rows[row, FIRST + 1] = film_y
    log.rows[row, FIRST + 2] = math.nan if time is None else time
    _put(log, row, FIRST + 3, origin)
    _put(log, row, FIRST + 6, direction)
    _put(log, row, FIRST + 9, factors)
    log.rows[row, FIRST + 12] = wavelength


@generic
def note_again(log, work, sample):
    """A path is traced once more, from the camera on, for another of its wavelengths."""
    raise NotImplementedError


@note_again.register(type(None))
def _(log, work, sample):
    return


@note_again.register(PathLog)
def _(log, work, sample):
    log.state[1] = 0
    if sample == log.sample:
        _row(log, work, AGAIN)


@generic
def note_round(log, segment):
    """Another round of the packet begins."""
    raise NotImplementedError


@note_round.register(type(None))
def _(log, segment):
    return


@note_round.register(PathLog)
def _(log, segment):
    log.state[1] = segment


@generic
def note_surface(log, work, lane, sample, instance, table, primitive, near, hit, front, reference, throughput, waves):
    """A path met a surface, whose material is `reference` behind all selectors, and arrives with this throughput.

    waves, three wavelengths (nm) that it is of, each NaN if it is not; so too where it scatters.
    """
    raise NotImplementedError


@note_surface.register(type(None))
def _(log, work, lane, sample, instance, table, primitive, near, hit, front, reference, throughput, waves):
    return


@note_surface.register(PathLog)
def _(log, work, lane, sample, instance, table, primitive, near, hit, front, reference, throughput, waves):
    if sample != log.sample:
        return
    row = _row(log, work, SURFACE)
    rows = log.rows
    # Origin, direction, throughput and pdf, as before what fills space on the way.
    for column in range(10):
        rows[row, FIRST + column] = work.path[lane, column]
    rows[row, FIRST + 10] = near
    rows[row, FIRST + 11] = instance
    rows[row, FIRST + 12] = table
    rows[row, FIRST + 13] = primitive
    _put(log, row, FIRST + 14, hit.point)
    _put(log, row, FIRST + 17, hit.normal)
    _put(log, row, FIRST + 20, hit.shading_normal)
    rows[row, FIRST + 23] = hit.u
    rows[row, FIRST + 24] = hit.v
    rows[row, FIRST + 25] = hit.offset
    rows[row, FIRST + 26] = front
    rows[row, FIRST + 27] = hit.material
    rows[row, FIRST + 28] = reference
    _put(log, row, FIRST + 29, throughput)
    _put(log, row, FIRST + 32, waves)


@generic
def note_leaving(log, work, lane, sample, throughput, radiance):
    """A path left the scene, and met this radiance."""
    raise NotImplementedError


@note_leaving.register(type(None))
def _(log, work, lane, sample, throughput, radiance):
    return


@note_leaving.register(PathLog)
def _(log, work, lane, sample, throughput, radiance):
    if sample != log.sample:
        return
    row = _row(log, work, LEAVES)
    for column in range(10):
        log.rows[row, FIRST + column] = work.path[lane, column]
    _put(log, row, FIRST + 10, throughput)
    _put(log, row, FIRST + 13, radiance)


@generic
def note_flight(log, work, lane, sample, medium, near, distance, weight, throughput):
    """A path went through a medium, to where it scatters or, at the distance inf, to the next surface."""
    raise NotImplementedError


@note_flight.register(type(None))
def _(log, work, lane, sample, medium, near, distance, weight, throughput):
    return


@note_flight.register(PathLog)
def _(log, work, lane, sample, medium, near, distance, weight, throughput):
    if sample != log.sample:
        return
    row = _row(log, work, FLIGHT)
    for column in range(10):
        log.rows[row, FIRST + column] = work.path[lane, column]
    log.rows[row, FIRST + 10] = medium
    log.rows[row, FIRST + 11] = near
    log.rows[row, FIRST + 12] = distance
    _put(log, row, FIRST + 13, weight)
    _put(log, row, FIRST + 16, throughput)


@generic
def note_emission(log, work, sample, emitted, weight):
    """What a surface gives, and the weight that it counts with."""
    raise NotImplementedError


@note_emission.register(type(None))
def _(log, work, sample, emitted, weight):
    return


@note_emission.register(PathLog)
def _(log, work, sample, emitted, weight):
    if sample != log.sample:
        return
    row = _row(log, work, EMITS)
    _put(log, row, FIRST, emitted)
    log.rows[row, FIRST + 3] = weight


@generic
def note_scatter(log, work, sample, normal, outgoing, weight, pdf, throughput, survival, waves):
    """A path is sent on from a surface or, where the normal is zero, within a medium; survival 0 ends it."""
    raise NotImplementedError


@note_scatter.register(type(None))
def _(log, work, sample, normal, outgoing, weight, pdf, throughput, survival, waves):
    return


@note_scatter.register(PathLog)
def _(log, work, sample, normal, outgoing, weight, pdf, throughput, survival, waves):
    if sample != log.sample:
        return
    row = _row(log, work, SCATTERS)
    _put(log, row, FIRST, normal)
    _put(log, row, FIRST + 3, outgoing)
    _put(log, row, FIRST + 6, weight)
    log.rows[row, FIRST + 9] = pdf
    _put(log, row, FIRST + 10, throughput)
    log.rows[row, FIRST + 13] = survival
    _put(log, row, FIRST + 14, waves)


@generic
def note_aim(log, work, slot, sample, start, light, value, pdf, weight, arriving):
    """A shadow ray: to what LightSample, what is scattered its way with what pdf, and what it is to bring."""
    raise NotImplementedError


@note_aim.register(type(None))
def _(log, work, slot, sample, start, light, value, pdf, weight, arriving):
    return


@note_aim.register(PathLog)
def _(log, work, slot, sample, start, light, value, pdf, weight, arriving):
    if sample != log.sample:
        return
    row = _row(log, work, AIMS)
    rows = log.rows
    _put(log, row, FIRST, start)
    _put(log, row, FIRST + 3, light.direction)
    _put(log, row, FIRST + 6, light.target)
    _put(log, row, FIRST + 9, light.weight)
    rows[row, FIRST + 12] = light.pdf
    _put(log, row, FIRST + 13, value)
    rows[row, FIRST + 16] = pdf
    rows[row, FIRST + 17] = weight
    _put(log, row, FIRST + 18, arriving)
    log.ends[slot] = max(0.0, norm(sub(light.target, start)) - light.gap)
    rows[row, FIRST + 21] = log.ends[slot]


@generic
def note_arrival(log, work, sample, arriving):
    """A shadow ray brought this, which is gathered by now."""
    raise NotImplementedError


@note_arrival.register(type(None))
def _(log, work, sample, arriving):
    return


@note_arrival.register(PathLog)
def _(log, work, sample, arriving):
    if sample == log.sample:
        _put(log, _row(log, work, ARRIVES), FIRST, arriving)


@generic
def note_met(log, work, slot, sample, packet, is_through):
    """A shadow ray met a surface: it ends there, or goes on through it."""
    raise NotImplementedError


@note_met.register(type(None))
def _(log, work, slot, sample, packet, is_through):
    return


@note_met.register(PathLog)
def _(log, work, slot, sample, packet, is_through):
    if sample != log.sample:
        return
    row = _row(log, work, PASSES if is_through else BLOCKED)
    _put_met(log, row, FIRST, packet, slot)
    log.rows[row, FIRST + 4] = packet.floats[TFAR, slot]


@generic
def note_occluded(log, scene, work, slot):
    """A shadow ray met something or other, which is looked for anew."""
    raise NotImplementedError


@note_occluded.register(type(None))
def _(log, scene, work, slot):
    return


@note_occluded.register(PathLog)
def _(log, scene, work, slot):
    sample = work.shadow_sample[slot]
    if sample != log.sample:
        return
    for word in range(3):
        log.probe.floats[ORIGIN + word, 0] = work.shadows.floats[ORIGIN + word, slot]
        log.probe.floats[DIRECTION + word, 0] = work.shadows.floats[DIRECTION + word, slot]
    log.probe.floats[TIME, 0] = work.shadows.floats[TIME, slot]
    log.probe.floats[TFAR, 0] = log.ends[slot]
    embree.intersect(scene.accel, log.probe, 1)
    note_met(log, work, 0, sample, log.probe, False)


@generic
def note_value(log, work, sample, value, left, wavelength):
    """A sample is done: what it brings, and what a clamp leaves of that for its pixel, if it is finite.

    wavelength, of its ray in the camera's lens (nm), which gave it its hue, or NaN.
    """
    raise NotImplementedError


@note_value.register(type(None))
def _(log, work, sample, value, left, wavelength):
    return


@note_value.register(PathLog)
def _(log, work, sample, value, left, wavelength):
    if sample == log.sample:
        row = _row(log, work, DONE)
        _put(log, row, FIRST, left)
        log.rows[row, FIRST + 3] = work.radiance[sample, 3]
        _put(log, row, FIRST + 4, value)
        log.rows[row, FIRST + 7] = wavelength
