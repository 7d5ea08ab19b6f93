"""What a path carries along besides its ray: the room of a packet of paths, and their times, media and passages.

A path's time is there only where something moves, its medium where space is filled, the count of surfaces that it
went straight through where some let it; the functions here, called on None, compile to nothing.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer import embree, hues
from raytracer.cameras.interface import TIME
from raytracer.embree import DIRECTION, GEOMETRY, INSTANCE, ORIGIN, PACKET, PLACEMENT, PRIMITIVE, Packet
from raytracer.embree import TIME as EMBREE_TIME
from raytracer.instances import find
from raytracer.jit import generic, kernel
from raytracer.materials.interface import PASS, SLOTS, WHITE, Draws
from raytracer.media.interface import NONE, Media, crossed, transmittance_at
from raytracer.primitives.interface import row_of_any
from raytracer.sampling import sample_1d
from raytracer.shutter import Shutter, draw_time
from raytracer.vec import dot, madd, mul, norm, normalize, sub


class Workspace(NamedTuple):
    """What one thread needs to trace a packet of paths.

    rays, shadows; path (PACKET, 10) float64: origin, direction, throughput, pdf of the direction; sample (PACKET,)
    int64, which sample of the packet a lane works for; radiance (PACKET, 4) float64, gathered by sample, and its
    weight; unshadowed (PACKET, 3) float64, and shadow_sample (PACKET,) int64, what each shadow ray carries;
    shadow_goal (PACKET, 4) float64, where it ends: a point and 1, or, at infinity, a direction and 0.

    By sample, and used where the scene calls for it: time (PACKET,) float64; medium (PACKET,) int64, in which the path
    is; vertex (PACKET, 3) float64, where it last scattered; passed (PACKET,) int64, how many surfaces it went straight
    through; features (PACKET, 48) float64, what the camera ray met; within (PACKET, solids) int32, how many objects
    of each rank it is in.  By shadow ray: shadow_space (PACKET, 2) int64, the medium in which it is, and how
    many random numbers it took there; shadow_within, as within.

    hues (PACKET, 37) float64: the wavelengths that the path is of, as `hues` has them.

    lens (57, PACKET) float64: the packet's rays within a camera's lens, as `lenses.packets` has them; the same rays at
    two other wavelengths; what each of the three counts for; and places on the film.

    log, where a path is written down (pathlog.PathLog), or None.
    """

    rays: Packet
    shadows: Packet
    path: NDArray[np.float64]
    sample: NDArray[np.int64]
    radiance: NDArray[np.float64]
    unshadowed: NDArray[np.float64]
    shadow_sample: NDArray[np.int64]
    shadow_goal: NDArray[np.float64]
    time: NDArray[np.float64]
    medium: NDArray[np.int64]
    vertex: NDArray[np.float64]
    passed: NDArray[np.int64]
    features: NDArray[np.float64]
    shadow_space: NDArray[np.int64]
    within: NDArray[np.int32]
    shadow_within: NDArray[np.int32]
    hues: NDArray[np.float64]
    lens: NDArray[np.float64]
    log: Any = None


def workspace(log: Any = None, *, solids: int = 0) -> Workspace:
    """Make a workspace for one thread.

    solids : how many ranks the solids of the scene have that is to be traced (`interior.ranks_of`).
    """

    def floats(*columns: int) -> NDArray[np.float64]:
        return np.zeros((PACKET, *columns))

    def integers() -> NDArray[np.int64]:
        return np.zeros(PACKET, np.int64)

    return Workspace(
        rays=embree.packet(),
        shadows=embree.packet(),
        path=floats(10),
        sample=integers(),
        radiance=floats(4),
        unshadowed=floats(3),
        shadow_sample=integers(),
        shadow_goal=floats(4),
        time=floats(),
        medium=integers(),
        vertex=floats(3),
        passed=integers(),
        features=floats(48),
        shadow_space=np.zeros((PACKET, 2), np.int64),
        within=np.zeros((PACKET, solids), np.int32),
        shadow_within=np.zeros((PACKET, solids), np.int32),
        hues=floats(hues.COLUMNS),
        lens=np.zeros((hues.LENS_ROWS, PACKET)),
        log=log,
    )


MOST_PASSED = 1024
"""How many surfaces a path may go straight through; a sample that meets more is dropped, and counted."""

PASS_STRIDE = 2**22
"""Between the random dimensions of a shadow ray's surfaces: more than the segments of a path take."""


class Passage(NamedTuple):
    """Light may go straight through surfaces: shadow rays are followed through them, and paths do not count them."""


@kernel
def load3(rows, lane, start):
    """Three columns of a row, from `start` on, as a vector."""
    return (rows[lane, start], rows[lane, start + 1], rows[lane, start + 2])


@kernel
def store3(rows, lane, start, value):
    """Write a vector into three columns of a row, from `start` on."""
    rows[lane, start] = value[0]
    rows[lane, start + 1] = value[1]
    rows[lane, start + 2] = value[2]


@kernel
def load_ray(packet, lane):
    """Origin and unit direction of a ray as Embree has it, in float64."""
    rows = packet.floats
    origin = (np.float64(rows[ORIGIN, lane]), np.float64(rows[ORIGIN + 1, lane]), np.float64(rows[ORIGIN + 2, lane]))
    x, y, z = rows[DIRECTION, lane], rows[DIRECTION + 1, lane], rows[DIRECTION + 2, lane]
    return origin, normalize((np.float64(x), np.float64(y), np.float64(z)))


@kernel
def found_in(scene, packet, lane):
    """The instance, -1 for none, and the row in its table of what a lane's ray has met."""
    ids = packet.ints
    table = ids[GEOMETRY, lane]
    primitive = row_of_any(scene.primitives, table, ids[PRIMITIVE, lane])
    return find(scene.instances, table, primitive, ids[INSTANCE, lane], ids[PLACEMENT, lane])


@generic
def gather(spectrum, work, sample, throughput, radiance):
    """Add to a sample the radiance that reaches the camera with this throughput."""
    raise NotImplementedError


@gather.register(type(None))
@gather.register(hues.LensSpectrum)
def _(spectrum, work, sample, throughput, radiance):
    for channel in range(3):
        work.radiance[sample, channel] += throughput[channel] * radiance[channel]


@gather.register(hues.Spectrum)
def _(spectrum, work, sample, throughput, radiance):
    if not hues.counts(work, sample):
        return
    light = hues.seen_as(spectrum, work, sample, mul(throughput, radiance))
    for channel in range(3):
        work.radiance[sample, channel] += light[channel]


@kernel
def set_shadow_space(work, slot, medium):
    """Start a shadow ray in a medium."""
    work.shadow_space[slot, 0] = medium
    work.shadow_space[slot, 1] = 0


# ---- Time


@generic
def sample_time(shutter, x, y, draws):
    """When the shutter lets light through to film position (x, y): a fraction of its whole time, or None; and a weight.

    The weight is of mean 1, and the constant 1 where no light has a time of its own.
    """
    raise NotImplementedError


@sample_time.register(type(None))
def _(shutter, x, y, draws):
    return None, 1.0


@sample_time.register(Shutter)
def _(shutter, x, y, draws):
    return draw_time(shutter.pulses, shutter, x, y, sample_1d(draws.sampler, draws.key, draws.index, TIME))


@generic
def keep_time(shutter, work, sample, time):
    """Remember the time of a sample."""
    raise NotImplementedError


@keep_time.register(type(None))
def _(shutter, work, sample, time):
    return


@keep_time.register(Shutter)
def _(shutter, work, sample, time):
    work.time[sample] = time


@generic
def time_of(shutter, work, sample):
    """The time of a sample, or None."""
    raise NotImplementedError


@time_of.register(type(None))
def _(shutter, work, sample):
    return None


@time_of.register(Shutter)
def _(shutter, work, sample):
    return work.time[sample]


@generic
def set_time(shutter, packet, lane, time):
    """Write a ray's time into a lane."""
    raise NotImplementedError


@set_time.register(type(None))
def _(shutter, packet, lane, time):
    return


@set_time.register(Shutter)
def _(shutter, packet, lane, time):
    packet.floats[EMBREE_TIME, lane] = time


# ---- Surfaces that light goes straight through


@generic
def rounds(passage, depth):
    """How often a packet is traced at most, for paths of `depth` segments."""
    raise NotImplementedError


@rounds.register(type(None))
def _(passage, depth):
    return depth


@rounds.register(Passage)
def _(passage, depth):
    return depth + MOST_PASSED


@generic
def segment_of(passage, work, sample, segment):
    """The number of the path's segment, in round `segment` of its packet."""
    raise NotImplementedError


@segment_of.register(type(None))
def _(passage, work, sample, segment):
    return segment


@segment_of.register(Passage)
def _(passage, work, sample, segment):
    return segment - work.passed[sample]


@generic
def seen_from(passage, work, sample, origin):
    """Where the path last scattered, for a ray from `origin`."""
    raise NotImplementedError


@seen_from.register(type(None))
def _(passage, work, sample, origin):
    return origin


@seen_from.register(Passage)
def _(passage, work, sample, origin):
    return load3(work.vertex, sample, 0)


@generic
def travelled(passage, work, sample, near, point):
    """How far `point`, which the ray met at distance `near`, is from where the path last scattered."""
    raise NotImplementedError


@travelled.register(type(None))
def _(passage, work, sample, near, point):
    return near


@travelled.register(Passage)
def _(passage, work, sample, near, point):
    return norm(sub(point, load3(work.vertex, sample, 0)))


@generic
def keep_goal(passage, work, slot, start, direction, length):
    """Remember where shadow ray `slot` ends."""
    raise NotImplementedError


@keep_goal.register(type(None))
def _(passage, work, slot, start, direction, length):
    return


@keep_goal.register(Passage)
def _(passage, work, slot, start, direction, length):
    finite = length < math.inf
    store3(work.shadow_goal, slot, 0, madd(start, length, direction) if finite else direction)
    work.shadow_goal[slot, 3] = 1.0 if finite else 0.0


@generic
def mark_start(passage, work, sample, origin):
    """Begin a path at the camera."""
    raise NotImplementedError


@mark_start.register(type(None))
def _(passage, work, sample, origin):
    return


@mark_start.register(Passage)
def _(passage, work, sample, origin):
    store3(work.vertex, sample, 0, origin)
    work.passed[sample] = 0


@generic
def mark_vertex(passage, work, sample, point):
    """Remember where the path scattered last."""
    raise NotImplementedError


@mark_vertex.register(type(None))
def _(passage, work, sample, point):
    return


@mark_vertex.register(Passage)
def _(passage, work, sample, point):
    store3(work.vertex, sample, 0, point)


@generic
def goes_straight(passage, work, sample, reference):
    """Whether what was met lets the path straight through; it is counted."""
    raise NotImplementedError


@goes_straight.register(type(None))
def _(passage, work, sample, reference):
    return False


@goes_straight.register(Passage)
def _(passage, work, sample, reference):
    straight = reference == PASS
    work.passed[sample] += straight
    return straight


@generic
def drop_lost(passage, work, samples, count):
    """Drop the samples of the first `count` of these rays, which went straight through more surfaces than are followed.

    Their weight becomes NaN, so the film counts them among those that are not finite.
    """
    raise NotImplementedError


@drop_lost.register(type(None))
def drop_lost_nowhere(passage, work, samples, count):
    """No ray is lost where none goes straight through."""
    return


@drop_lost.register(Passage)
def drop_lost_on_passage(passage, work, samples, count):
    """Drop them by their weights."""
    for lane in range(count):
        work.radiance[samples[lane], 3] = math.nan


# ---- Media


@generic
def fill_space(media, work, sample):
    """Start a path in the camera's medium."""
    raise NotImplementedError


@fill_space.register(type(None))
def _(media, work, sample):
    return


@fill_space.register(Media)
def _(media, work, sample):
    work.medium[sample] = media.camera


@generic
def cross(media, work, sample, reference, hit, direction, outgoing):
    """Change the path's medium where it goes through the boundary of one, at a surface of this material."""
    raise NotImplementedError


@cross.register(type(None))
def _(media, work, sample, reference, hit, direction, outgoing):
    return


@cross.register(Media)
def _(media, work, sample, reference, hit, direction, outgoing):
    if (dot(direction, hit.normal) < 0.0) == (dot(outgoing, hit.normal) < 0.0):
        work.medium[sample] = crossed(media, reference, work.medium[sample], dot(outgoing, hit.normal) < 0.0)


@generic
def fill_shadow(media, work, slot, sample, reference, hit, direction, outgoing):
    """Start a shadow ray in the medium on its side of a surface of this material, which the path met on its way."""
    raise NotImplementedError


@fill_shadow.register(type(None))
def _(media, work, slot, sample, reference, hit, direction, outgoing):
    return


@fill_shadow.register(Media)
def _(media, work, slot, sample, reference, hit, direction, outgoing):
    medium, enters = work.medium[sample], dot(outgoing, hit.normal) < 0.0
    if (dot(direction, hit.normal) < 0.0) == enters:
        medium = crossed(media, reference, medium, enters)
    set_shadow_space(work, slot, medium)


@generic
def stay_shadow(media, work, slot, sample):
    """Start a shadow ray in the medium that its path is in."""
    raise NotImplementedError


@stay_shadow.register(type(None))
def _(media, work, slot, sample):
    return


@stay_shadow.register(Media)
def _(media, work, slot, sample):
    set_shadow_space(work, slot, work.medium[sample])


@generic
def cross_shadow(media, work, slot, reference, enters):
    """Change a shadow ray's medium where it goes straight through a surface of this material."""
    raise NotImplementedError


@cross_shadow.register(type(None))
def _(media, work, slot, reference, enters):
    return


@cross_shadow.register(Media)
def _(media, work, slot, reference, enters):
    work.shadow_space[slot, 0] = crossed(media, reference, work.shadow_space[slot, 0], enters)


@generic
def veil(media, scene, work, slot, distance, key, first, segment):
    """The fraction of light that comes through the medium of a shadow ray, over `distance` from the ray's origin."""
    raise NotImplementedError


@veil.register(type(None))
def _(media, scene, work, slot, distance, key, first, segment):
    return WHITE


@veil.register(Media)
def _(media, scene, work, slot, distance, key, first, segment):
    medium = work.shadow_space[slot, 0]
    if medium == NONE:
        return WHITE
    origin, direction = load_ray(work.shadows, slot)
    draws = Draws(scene.sampler, key, first + work.shadow_sample[slot], (segment + 1) * SLOTS)
    numbers = work.shadow_space[slot, 1]
    through, numbers = transmittance_at(media, medium, origin, direction, distance, draws, numbers)
    work.shadow_space[slot, 1] = numbers
    return through


@generic
def move_shadow(media, work, slot, to):
    """Take what is known of a shadow ray's medium along, to the slot in which the ray goes on."""
    raise NotImplementedError


@move_shadow.register(type(None))
def _(media, work, slot, to):
    return


@move_shadow.register(Media)
def _(media, work, slot, to):
    for column in range(2):
        work.shadow_space[to, column] = work.shadow_space[slot, column]
