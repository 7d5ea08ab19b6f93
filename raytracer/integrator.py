"""The path tracer: one loop for every scene, specialised by the scene's type when it is compiled.

It names no kind of anything.  What a scene lacks is None in it, and the functions called on None compile to nothing.
Paths of one pixel go in step, a packet at a time, so that camera rays and shadow rays reach Embree together.

References: Kajiya 1986, "The Rendering Equation"; Veach 1997, thesis, ch. 9 (multiple importance sampling) and
sec. 10.4 (Russian roulette).
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer import embree
from raytracer.cameras.interface import FILTER, camera_ray
from raytracer.embree import GEOMETRY, MISS, PACKET, PRIMITIVE, TFAR, Packet
from raytracer.environments.interface import background
from raytracer.filters.interface import sample_filter
from raytracer.jit import entry, generic, kernel
from raytracer.lights.interface import pdf_light, sample_light
from raytracer.materials.interface import ROULETTE, SLOTS, Draws, emission_at, evaluate_at, scatter_at
from raytracer.primitives.interface import expect_any, hit_any
from raytracer.sampling import pixel_key, sample_1d, sample_2d
from raytracer.vec import dot, is_black, madd, max_component, mul, neg, norm, scale, sub


class Scene(NamedTuple):
    """A packed scene.  Its type is the list of its effects; sizes, depth and seed are values.

    accel, address of the built Embree scene; accuracy, geometry.Exact or None; primitives and materials, tuples of one
    table a kind; lights and environment, or None; camera, filter and sampler; depth, the largest number of path
    segments; roulette, the number of segments before Russian roulette starts.
    """

    accel: int
    accuracy: Any
    primitives: tuple[Any, ...]
    materials: tuple[Any, ...]
    lights: Any
    environment: Any
    camera: Any
    filter: Any
    sampler: Any
    depth: int
    roulette: int


class FilmView(NamedTuple):
    """Where samples gather, for the pixels from (left, top) on.

    mean and m2 (height, width, 3) float64, the running mean and sum of squared differences from it; count
    (height, width) int64, samples taken; bad (height, width) int64, samples dropped because they were not finite.
    """

    mean: NDArray[np.float64]
    m2: NDArray[np.float64]
    count: NDArray[np.int64]  # type: ignore[assignment]  # takes the place of tuple.count
    bad: NDArray[np.int64]
    left: int
    top: int


class Workspace(NamedTuple):
    """What one thread needs to trace a packet of paths.

    rays, shadows; path (PACKET, 10) float64: origin, direction, throughput, pdf of the direction; sample (PACKET,)
    int64, which sample of the packet a lane works for; radiance (PACKET, 4) float64, gathered by sample, and its
    filter weight; unshadowed (PACKET, 3) float64, and shadow_sample (PACKET,) int64, what each shadow ray carries.
    """

    rays: Packet
    shadows: Packet
    path: NDArray[np.float64]
    sample: NDArray[np.int64]
    radiance: NDArray[np.float64]
    unshadowed: NDArray[np.float64]
    shadow_sample: NDArray[np.int64]


def workspace() -> Workspace:
    """A new workspace, for one thread."""
    lanes = (np.zeros((PACKET, 10)), np.zeros(PACKET, np.int64), np.zeros((PACKET, 4)), np.zeros((PACKET, 3)))
    return Workspace(embree.packet(), embree.packet(), *lanes, np.zeros(PACKET, np.int64))


@kernel
def power_heuristic(pdf, other):
    """Weight of a sample drawn with `pdf` that `other` might have drawn too; the ratio form cannot overflow to NaN.

    References: Veach 1997, eq. 9.11 with beta = 2.
    """
    ratio = other / pdf
    return 1.0 / (1.0 + ratio * ratio)


@kernel
def spawn_point(hit, direction):
    """Where a ray leaves a surface along `direction`: off it by the float32 error bound, to the direction's side."""
    return madd(hit.point, hit.offset if dot(direction, hit.normal) > 0.0 else -hit.offset, hit.normal)


@kernel
def leaks(hit, outgoing):
    """Whether a direction is on different sides of the true and of the shading surface, so that light would leak."""
    return dot(outgoing, hit.normal) * dot(outgoing, hit.shading_normal) <= 0.0


@generic
def connect(lights, scene, work, slot, sample, hit, direction, normal, front, throughput, draws):
    """Aim at a light: fill shadow ray `slot` and what it would bring; True if there is such a ray."""
    raise NotImplementedError


@connect.register(type(None))
def _(lights, scene, work, slot, sample, hit, direction, normal, front, throughput, draws):
    return False


@connect.register(tuple)
def _(lights, scene, work, slot, sample, hit, direction, normal, front, throughput, draws):
    light = sample_light(lights, scene.primitives, scene.materials, hit.point, draws)
    if light.pdf == 0.0 or is_black(light.radiance) or leaks(hit, light.direction):
        return False
    value, pdf = evaluate_at(scene.materials, hit.material, direction, normal, front, light.direction)
    if is_black(value):
        return False
    weight = power_heuristic(light.pdf, pdf) / light.pdf
    arriving = mul(mul(throughput, value), scale(weight, light.radiance))
    start = spawn_point(hit, light.direction)
    way = sub(light.target, start)
    distance = norm(way)
    embree.set_ray(work.shadows, slot, start, scale(1.0 / distance, way), distance - light.gap)
    work.shadow_sample[slot] = sample
    for channel in range(3):
        work.unshadowed[slot, channel] = arriving[channel]
    return True


@generic
def resolve_shadows(lights, accel, work, count):
    """Trace the shadow rays, and add what arrives."""
    raise NotImplementedError


@resolve_shadows.register(type(None))
def _(lights, accel, work, count):
    return


@resolve_shadows.register(tuple)
def _(lights, accel, work, count):
    if count == 0:
        return
    embree.occluded(accel, work.shadows, count)
    for slot in range(count):
        if work.shadows.floats[TFAR, slot] >= 0.0:
            for channel in range(3):
                work.radiance[work.shadow_sample[slot], channel] += work.unshadowed[slot, channel]


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
def gather(work, sample, throughput, radiance):
    """Add to a sample the radiance that reaches the camera with this throughput."""
    for channel in range(3):
        work.radiance[sample, channel] += throughput[channel] * radiance[channel]


@kernel
def start_paths(scene, work, key, x, y, first, count):
    """Camera rays of samples first .. first + count - 1 of pixel (x, y)."""
    for lane in range(count):
        draws = Draws(scene.sampler, key, first + lane, 0)
        u1, u2 = sample_2d(draws.sampler, draws.key, draws.index, FILTER)
        dx, dy, weight = sample_filter(scene.filter, u1, u2)
        origin, direction = camera_ray(scene.camera, x + 0.5 + dx, y + 0.5 + dy, draws)
        store3(work.path, lane, 0, origin)
        store3(work.path, lane, 3, direction)
        store3(work.path, lane, 6, (1.0, 1.0, 1.0))
        # The camera had no choice of direction that a light sample could share.
        work.path[lane, 9] = math.inf
        work.sample[lane] = lane
        store3(work.radiance, lane, 0, (0.0, 0.0, 0.0))
        work.radiance[lane, 3] = weight


@kernel
def trace_paths(scene, work, key, first, count):
    """Follow the packet's paths to their ends, gathering radiance by sample; returns the number of rays traced."""
    rays = 0
    live = count
    for segment in range(scene.depth):
        # Trace all paths that still go on.
        for lane in range(live):
            embree.set_ray(work.rays, lane, load3(work.path, lane, 0), load3(work.path, lane, 3), math.inf)
        embree.intersect(scene.accel, work.rays, live)
        rays += live

        # Let the cache misses of the whole packet overlap: a mesh of a million triangles renders 10 % faster.
        for lane in range(live):
            table = work.rays.ints[GEOMETRY, lane]
            if table != MISS:
                expect_any(scene.primitives, table, work.rays.ints[PRIMITIVE, lane])
        survivors = 0
        shadows = 0
        for lane in range(live):
            origin, direction = load3(work.path, lane, 0), load3(work.path, lane, 3)
            throughput, pdf = load3(work.path, lane, 6), work.path[lane, 9]
            sample = work.sample[lane]

            # Leave the scene.
            table = work.rays.ints[GEOMETRY, lane]
            if table == MISS:
                gather(work, sample, throughput, background(scene.environment, direction))
                continue

            # Meet a surface, and take what it emits.
            primitive = work.rays.ints[PRIMITIVE, lane]
            near = np.float64(work.rays.floats[TFAR, lane])
            hit = hit_any(scene.primitives, table, primitive, origin, direction, near, scene.accuracy)
            front = dot(direction, hit.normal) < 0.0
            emitted = emission_at(scene.materials, hit.material, front)
            if not is_black(emitted):
                by_light = pdf_light(scene.lights, scene.primitives, table, primitive, origin, hit.point, hit.normal)
                gather(work, sample, scale(power_heuristic(pdf, by_light), throughput), emitted)
            if segment + 1 == scene.depth:
                continue

            # Aim at a light.
            normal = hit.shading_normal if front else neg(hit.shading_normal)
            draws = Draws(scene.sampler, key, first + sample, (segment + 1) * SLOTS)
            if connect(scene.lights, scene, work, shadows, sample, hit, direction, normal, front, throughput, draws):
                shadows += 1

            # Go on where the material sends the path.
            out = scatter_at(scene.materials, hit.material, direction, normal, front, draws)
            throughput = mul(throughput, out.weight)
            if is_black(throughput) or leaks(hit, out.direction):
                continue
            if segment + 1 >= scene.roulette:
                survival = min(1.0, max_component(throughput))
                if sample_1d(draws.sampler, draws.key, draws.index, draws.dimension + ROULETTE) >= survival:
                    continue
                throughput = scale(1.0 / survival, throughput)
            store3(work.path, survivors, 0, spawn_point(hit, out.direction))
            store3(work.path, survivors, 3, out.direction)
            store3(work.path, survivors, 6, throughput)
            work.path[survivors, 9] = out.pdf
            work.sample[survivors] = sample
            survivors += 1
        resolve_shadows(scene.lights, scene.accel, work, shadows)
        rays += shadows
        live = survivors
        if live == 0:
            break
    return rays


@kernel
def accumulate(film, work, x, y, count):
    """Add a packet of samples to a pixel's running mean and sum of squares.

    References: Chan, Golub, LeVeque 1979, "Updating Formulae and a Pairwise Algorithm for Computing Sample Variances".
    """
    # Drop what is not finite, and count it.
    good = 0
    for sample in range(count):
        value = scale(work.radiance[sample, 3], load3(work.radiance, sample, 0))
        if math.isfinite(value[0] + value[1] + value[2]):
            store3(work.radiance, good, 0, value)
            good += 1
    film.bad[y, x] += count - good
    if good == 0:
        return
    total = film.count[y, x] + good
    film.count[y, x] = total
    for channel in range(3):
        mean = 0.0
        for sample in range(good):
            mean += work.radiance[sample, channel]
        mean /= good
        m2 = 0.0
        for sample in range(good):
            m2 += (work.radiance[sample, channel] - mean) ** 2
        difference = mean - film.mean[y, x, channel]
        film.mean[y, x, channel] += difference * (good / total)
        film.m2[y, x, channel] += m2 + difference * difference * (good * (total - good) / total)


@entry
def render_tile(scene, film, work, left, top, right, bottom, begin, end):
    """Samples begin .. end - 1 of the pixels left <= x < right, top <= y < bottom; returns the rays traced.

    Packets start at multiples of PACKET from `begin` on, so whoever calls with such a `begin` gets the same bits
    however the samples are split into calls.
    """
    rays = 0
    for y in range(top, bottom):
        for x in range(left, right):
            key = pixel_key(scene.sampler, x, y)
            for first in range(begin, end, PACKET):
                count = min(PACKET, end - first)
                start_paths(scene, work, key, x, y, first, count)
                rays += trace_paths(scene, work, key, first, count)
                accumulate(film, work, x - film.left, y - film.top, count)
    return rays
