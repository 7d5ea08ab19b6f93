"""The path tracer: one loop for every scene, specialised by the scene's type when it is compiled.

It names no kind of anything.  What a scene lacks is None in it, and the functions called on None compile to nothing.
Paths of one pixel go in step, a packet at a time, so that camera rays and shadow rays reach Embree together.

References: Kajiya 1986, "The Rendering Equation"; Veach 1997, thesis, ch. 9 (multiple importance sampling) and
sec. 10.4 (Russian roulette).
"""

import math
from typing import Any, NamedTuple

import numpy as np

from raytracer import embree
from raytracer.accumulation import accumulate
from raytracer.cameras.interface import (
    FILTER,
    Together,
    film_corner,
    lane_ray,
    place_in_view,
    rays_together,
    set_lane,
    trace_lanes,
)
from raytracer.embree import GEOMETRY, MISS, PACKET, TFAR
from raytracer.filters.interface import sample_filter
from raytracer.geometry import Site, leaks, spawn_point
from raytracer.hues import (
    PLACES,
    LensSpectrum,
    Spectrum,
    gain,
    goes_again,
    mattering,
    meet_hue,
    part_hues,
    ray_wavelength,
    shaded,
    share_hues,
    start_again,
    start_hue,
    tinted,
    turns,
    wavelengths_of,
    with_hue,
)
from raytracer.instances import meet
from raytracer.interior import (
    boundary_of,
    clear_within,
    go_through,
    keep_within,
    kept,
    start_shadow,
)
from raytracer.jit import entry, generic, kernel, share
from raytracer.lights.interface import Lights, Unaimed, sample_lights, surroundings, weight_aimed, weight_emitted
from raytracer.materials.interface import (
    BLACK,
    ROULETTE,
    SLOTS,
    WHITE,
    Draws,
    absorbed,
    emission_at,
    evaluate_at,
    scatter_at,
    select_at,
)
from raytracer.media.interface import (
    NONE,
    Media,
    evaluate_phase_at,
    fly_at,
    scatter_phase_at,
)
from raytracer.origin import as_written
from raytracer.pathlog import (
    note_again,
    note_aim,
    note_emission,
    note_flight,
    note_leaving,
    note_round,
    note_scatter,
    note_start,
    note_surface,
)
from raytracer.paths import (
    drop_lost,
    fill_space,
    found_in,
    gather,
    goes_straight,
    keep_time,
    load3,
    mark_start,
    mark_vertex,
    rounds,
    sample_time,
    seen_from,
    segment_of,
    set_shadow_space,
    set_time,
    store3,
    time_of,
    travelled,
)
from raytracer.primitives.interface import expect_any
from raytracer.sampling import pixel_key, sample_1d, sample_2d
from raytracer.shadows import aim, resolve_shadows
from raytracer.submersion import look_around
from raytracer.vec import Vec3, dot, is_black, madd, max_component, mul, neg, scale


class Scene(NamedTuple):
    """A packed scene.  Its type is the list of its effects; sizes, depth and seed are values.

    accel, address of the built Embree scene; accuracy, geometry.Exact or None; primitives, a tuple of one table a kind;
    instances; materials, a tuple of one table a kind; selectors, materials that name others; passage, if light may pass
    through surfaces; relief, bump and normal maps; textures, lights, environment, media; camera; shutter, if anything
    moves; filter and sampler; depth, the largest number of path segments; roulette, the number of segments before
    Russian roulette starts; clamp, how bright a sample may be; origin, origin.Origin of a scene that was written far
    from its own; interior, solids that have priorities; spectrum, if anything disperses.  All but the tuples named,
    camera, filter, sampler and numbers may be None.
    """

    accel: int
    accuracy: Any
    primitives: tuple[Any, ...]
    instances: Any
    materials: tuple[Any, ...]
    selectors: Any
    passage: Any
    relief: Any
    textures: Any
    lights: Any
    environment: Any
    media: Any
    camera: Any
    shutter: Any
    filter: Any
    sampler: Any
    depth: int
    roulette: int
    clamp: Any = None
    origin: Any = None
    interior: Any = None
    spectrum: Any = None


# ---- What a scene may lack


class Wandering(NamedTuple):
    """What a medium did on the way to the next surface.

    throughput, to the end of the way; scattered, whether it ended in the medium; goes_on, whether the path then does,
    from the lane that was to be filled; aimed, whether a shadow ray was set.
    """

    throughput: Vec3
    scattered: bool
    goes_on: bool
    aimed: bool


@generic
def wander(media, scene, work, lane, sample, survivors, shadows, near, throughput, segment, time, draws):
    """Travel through the medium that a lane's path is in, for the distance `near` at most: a Wandering.

    A path that scatters on the way is connected to a light by shadow ray `shadows`, and goes on in lane `survivors`.
    """
    raise NotImplementedError


@wander.register(type(None))
def _(media, scene, work, lane, sample, survivors, shadows, near, throughput, segment, time, draws):
    rest = tinted(scene.spectrum, work, sample, kept(scene.interior, work.within, sample, near))
    return Wandering(mul(throughput, rest), False, False, False)


@wander.register(Media)
def _(media, scene, work, lane, sample, survivors, shadows, near, throughput, segment, time, draws):
    medium = work.medium[sample]
    if medium == NONE:
        rest = tinted(scene.spectrum, work, sample, kept(scene.interior, work.within, sample, near))
        return Wandering(mul(throughput, rest), False, False, False)
    origin, direction = load3(work.path, lane, 0), load3(work.path, lane, 3)
    channels = mattering(scene.spectrum, work, sample, throughput)
    flight = fly_at(media, medium, origin, direction, near, channels, draws, 0)
    throughput = mul(throughput, tinted(scene.spectrum, work, sample, flight.weight))
    rest = kept(scene.interior, work.within, sample, min(near, flight.distance))
    throughput = mul(throughput, tinted(scene.spectrum, work, sample, rest))
    note_flight(work.log, work, lane, sample, medium, near, flight.distance, flight.weight, throughput)
    if is_black(throughput):
        return Wandering(throughput, True, False, False)
    if math.isinf(flight.distance):
        return Wandering(throughput, False, False, False)
    if segment == scene.depth:
        return Wandering(throughput, True, False, False)

    # Aim at a light from where the light scatters, and go on.
    point = madd(origin, flight.distance, direction)
    aimed = connect_within(
        scene.lights, scene, work, shadows, sample, medium, point, direction, throughput, time, draws
    )
    survival = survive(scene, gain(scene.spectrum, work, sample, throughput), segment, draws)
    waves = wavelengths_of(scene.spectrum, work, sample)
    if survival == 0.0:
        note_scatter(work.log, work, sample, BLACK, direction, WHITE, math.nan, throughput, survival, waves)
        return Wandering(throughput, True, False, aimed)
    outgoing, pdf = scatter_phase_at(media, medium, direction, draws)
    note_scatter(work.log, work, sample, BLACK, outgoing, WHITE, pdf, throughput, survival, waves)
    mark_vertex(scene.passage, work, sample, point)
    put_path(work, survivors, sample, point, outgoing, scale(1.0 / survival, throughput), pdf)
    return Wandering(throughput, True, True, aimed)


@generic
def shading_normal(relief, scene, hit, instance, reference, site, direction, front, time):
    """The normal that a surface is shaded with, turned against the incoming direction."""
    raise NotImplementedError


@shading_normal.register(type(None))
def _(relief, scene, hit, instance, reference, site, direction, front, time):
    return hit.shading_normal if front else neg(hit.shading_normal)


@generic
def scatter_from(relief, scene, hit, reference, site, direction, normal, front, draws):
    """`scatter_at` a surface; what would leak through it is absorbed."""
    raise NotImplementedError


@scatter_from.register(type(None))
def _(relief, scene, hit, reference, site, direction, normal, front, draws):
    out = scatter_at(scene, reference, site, direction, normal, front, draws)
    if leaks(hit, out.direction):
        return absorbed(direction)
    return out


@generic
def evaluate_from(relief, scene, hit, reference, site, direction, normal, front, outgoing):
    """`evaluate_at` a surface: zero for what would leak through it."""
    raise NotImplementedError


@evaluate_from.register(type(None))
def _(relief, scene, hit, reference, site, direction, normal, front, outgoing):
    if leaks(hit, outgoing):
        return BLACK, 0.0
    return evaluate_at(scene, reference, site, direction, normal, front, outgoing)


@generic
def observe(aovs, scene, work, sample, instance, table, primitive, hit, reference, site, normal, front, ray, time):
    """Record what a camera ray (origin, direction) met, after selectors, by sample."""
    raise NotImplementedError


@observe.register(type(None))
def _(aovs, scene, work, sample, instance, table, primitive, hit, reference, site, normal, front, ray, time):
    return


@generic
def observe_start(aovs, work, sample, origin, direction):
    """Forget what the sample before recorded, and record the camera ray of this one."""
    raise NotImplementedError


@observe_start.register(type(None))
def _(aovs, work, sample, origin, direction):
    return


@generic
def observe_again(aovs, work, sample):
    """Keep what is recorded of a path that is traced once more, for another wavelength."""
    raise NotImplementedError


@observe_again.register(type(None))
def _(aovs, work, sample):
    return


@generic
def observe_end(aovs, work, sample):
    """Add to what was kept of a path what was recorded when it was traced once more."""
    raise NotImplementedError


@observe_end.register(type(None))
def _(aovs, work, sample):
    return


@generic
def observe_direct(aovs, work, sample, done):
    """Record what a path of `done` segments has gathered by its first two: direct light."""
    raise NotImplementedError


@observe_direct.register(type(None))
def _(aovs, work, sample, done):
    return


# ---- Light


@generic
def connect(lights, scene, work, slot, sample, hit, reference, site, direction, normal, front, throughput, time, draws):
    """Aim at a light: fill shadow ray `slot` and what it would bring; True if there is such a ray."""
    raise NotImplementedError


@connect.register(type(None))
@connect.register(Unaimed)
def _(lights, scene, work, slot, sample, hit, reference, site, direction, normal, front, throughput, time, draws):
    return False


@connect.register(Lights)
def _(lights, scene, work, slot, sample, hit, reference, site, direction, normal, front, throughput, time, draws):
    light = sample_lights(lights, scene, hit.point, time, draws)
    if is_black(light.weight):
        return False
    value, pdf = evaluate_from(scene.relief, scene, hit, reference, site, direction, normal, front, light.direction)
    if is_black(value):
        return False
    value = shaded(scene.spectrum, work, sample, reference, value)
    weight = weight_aimed(lights.heuristic, light.pdf, pdf)
    start = spawn_point(hit, light.direction)
    start_shadow(scene.interior, scene, work, slot, sample, hit, direction, light.direction)
    arriving = scale(weight, mul(mul(throughput, value), tinted(scene.spectrum, work, sample, light.weight)))
    aim(scene, work, slot, sample, start, light, arriving, time)
    note_aim(work.log, work, slot, sample, start, light, value, pdf, weight, arriving)
    return True


@generic
def connect_within(lights, scene, work, slot, sample, medium, point, direction, throughput, time, draws):
    """As `connect`, from a point within a medium."""
    raise NotImplementedError


@connect_within.register(type(None))
@connect_within.register(Unaimed)
def _(lights, scene, work, slot, sample, medium, point, direction, throughput, time, draws):
    return False


@connect_within.register(Lights)
def _(lights, scene, work, slot, sample, medium, point, direction, throughput, time, draws):
    light = sample_lights(lights, scene, point, time, draws)
    if is_black(light.weight):
        return False
    phase = evaluate_phase_at(scene.media, medium, direction, light.direction)
    if phase == 0.0:
        return False
    set_shadow_space(work, slot, medium)
    keep_within(scene.interior, work, slot, sample)
    weight = weight_aimed(lights.heuristic, light.pdf, phase)
    arriving = scale(phase * weight, mul(throughput, tinted(scene.spectrum, work, sample, light.weight)))
    aim(scene, work, slot, sample, point, light, arriving, time)
    note_aim(work.log, work, slot, sample, point, light, (phase, phase, phase), phase, weight, arriving)
    return True


@kernel
def film_sample(scene, x, y, draws):
    """A film position of pixel (x, y), and its weight."""
    u1, u2 = sample_2d(draws.sampler, draws.key, draws.index, FILTER)
    dx, dy, weight = sample_filter(scene.filter, u1, u2)
    left, top = film_corner(scene.camera, x, y)
    return left + 0.5 + dx, top + 0.5 + dy, weight


@generic
def prepare_lanes(together, scene, work, key, x, y, first, count):
    """Make the camera rays of a packet, where the camera makes them together."""
    raise NotImplementedError


@prepare_lanes.register(type(None))
def _(together, scene, work, key, x, y, first, count):
    return


@prepare_lanes.register(Together)
def _(together, scene, work, key, x, y, first, count):
    for lane in range(count):
        draws = Draws(scene.sampler, key, first + lane, 0)
        film_x, film_y, weight = film_sample(scene, x, y, draws)
        work.lens[PLACES, lane], work.lens[PLACES + 1, lane], work.lens[PLACES + 2, lane] = film_x, film_y, weight
        set_lane(scene.camera, work.lens, lane, film_x, film_y, draws)
    trace_lanes(scene.camera, work.lens)
    share_hues(scene.spectrum, scene.camera, work, x, y, count)


@generic
def film_place(together, scene, work, lane, x, y, draws):
    """As `film_sample`, of a lane that may have been prepared."""
    raise NotImplementedError


@film_place.register(type(None))
def _(together, scene, work, lane, x, y, draws):
    return film_sample(scene, x, y, draws)


@film_place.register(Together)
def _(together, scene, work, lane, x, y, draws):
    return work.lens[PLACES, lane], work.lens[PLACES + 1, lane], work.lens[PLACES + 2, lane]


@kernel
def start_paths(scene, aovs, work, key, x, y, first, count):
    """Camera rays of samples first .. first + count - 1 of pixel (x, y); returns how many of them see anything."""
    live = 0
    together = rays_together(scene.camera)
    prepare_lanes(together, scene, work, key, x, y, first, count)
    for lane in range(count):
        draws = Draws(scene.sampler, key, first + lane, 0)
        film_x, film_y, weight = film_place(together, scene, work, lane, x, y, draws)
        place_x, place_y = place_in_view(scene.camera, film_x, film_y)
        time, rate = sample_time(scene.shutter, place_x, place_y, draws)
        origin, direction, importance = lane_ray(scene.camera, work.lens, lane, film_x, film_y, time, draws)
        store3(work.radiance, lane, 0, BLACK)
        # Not into the throughput: what a ray counts for says nothing of whether its path should go on.
        work.radiance[lane, 3] = weight * rate * importance
        observe_start(aovs, work, lane, origin, direction)
        start_hue(scene.spectrum, work, lane, draws, origin, direction)
        note_start(
            work.log,
            work,
            lane,
            film_x,
            film_y,
            time,
            origin,
            direction,
            (weight, rate, importance),
            ray_wavelength(scene.spectrum, work, lane),
        )
        if importance == 0.0:
            continue
        keep_time(scene.shutter, work, lane, time)
        fill_space(scene.media, work, lane)
        clear_within(scene.interior, work, lane)
        mark_start(scene.passage, work, lane, origin)
        # The camera had no choice of direction that a light sample could share.
        put_path(work, live, lane, origin, direction, WHITE, math.inf)
        live += 1
    return live


@kernel
def start_paths_again(scene, aovs, work, count, turn):
    """Camera rays of those samples whose wavelengths have parted, for another of these; returns how many there are."""
    live = 0
    for sample in range(count):
        if goes_again(work, sample):
            observe_again(aovs, work, sample)
            origin, direction = start_again(work, sample, turn)
            note_again(work.log, work, sample)
            fill_space(scene.media, work, sample)
            clear_within(scene.interior, work, sample)
            mark_start(scene.passage, work, sample, origin)
            put_path(work, live, sample, origin, direction, WHITE, math.inf)
            live += 1
    return live


@kernel
def put_path(work, lane, sample, origin, direction, throughput, pdf):
    """Let a path go on from `origin`, in this lane."""
    store3(work.path, lane, 0, origin)
    store3(work.path, lane, 3, direction)
    store3(work.path, lane, 6, throughput)
    work.path[lane, 9] = pdf
    work.sample[lane] = sample


@kernel
def survive(scene, throughput, done, draws):
    """With which probability the path was let go on by Russian roulette, after `done` segments; 0 if it ends."""
    if is_black(throughput):
        return 0.0
    if done < scene.roulette:
        return 1.0
    survival = min(1.0, max_component(throughput))
    if sample_1d(draws.sampler, draws.key, draws.index, draws.dimension + ROULETTE) >= survival:
        return 0.0
    return survival


@kernel
def trace_paths(scene, aovs, work, key, first, live):
    """Follow the packet's paths to their ends, gathering radiance by sample; returns the number of rays traced."""
    rays = 0
    for segment in range(rounds(scene.passage, scene.depth)):
        if live == 0:
            break
        note_round(work.log, segment)
        # Trace all paths that still go on.
        for lane in range(live):
            embree.set_ray(work.rays, lane, load3(work.path, lane, 0), load3(work.path, lane, 3), math.inf)
            set_time(scene.shutter, work.rays, lane, time_of(scene.shutter, work, work.sample[lane]))
        embree.intersect(scene.accel, work.rays, live)
        rays += live

        # Let the cache misses of the whole packet overlap: a mesh of a million triangles renders 10 % faster.
        for lane in range(live):
            table = work.rays.ints[GEOMETRY, lane]
            if table != MISS:
                expect_any(scene.primitives, table, found_in(scene, work.rays, lane)[1])
        survivors = 0
        shadows = 0
        for lane in range(live):
            origin, direction = load3(work.path, lane, 0), load3(work.path, lane, 3)
            throughput, pdf = load3(work.path, lane, 6), work.path[lane, 9]
            sample = work.sample[lane]
            time = time_of(scene.shutter, work, sample)
            draws = Draws(scene.sampler, key, first + sample, (segment + 1) * SLOTS)
            done = segment_of(scene.passage, work, sample, segment) + 1

            # Travel through what fills space.
            near = np.float64(work.rays.floats[TFAR, lane])
            way = wander(
                scene.media, scene, work, lane, sample, survivors, shadows, near, throughput, done, time, draws
            )
            throughput = way.throughput
            if way.scattered:
                observe_direct(aovs, work, sample, done)
                shadows += way.aimed
                survivors += way.goes_on
                continue

            # Leave the scene.
            table = work.rays.ints[GEOMETRY, lane]
            if table == MISS:
                radiance = tinted(scene.spectrum, work, sample, surroundings(scene.lights, scene, direction, pdf))
                gather(scene.spectrum, work, sample, throughput, radiance)
                note_leaving(work.log, work, lane, sample, throughput, radiance)
                continue

            # Meet a surface.
            instance, primitive = found_in(scene, work.rays, lane)
            hit = meet(scene.instances, scene, instance, table, primitive, origin, direction, near, time)
            local = as_written(scene.origin, scene.instances, instance, hit.local)
            site = Site(local, hit.u, hit.v, travelled(scene.passage, work, sample, near, hit.point), None)
            front = dot(direction, hit.normal) < 0.0
            reference = select_at(scene.selectors, scene, hit.material, front, site, draws)
            reference = boundary_of(scene.interior, work.within, sample, hit.material, reference, front)
            note_surface(
                work.log,
                work,
                lane,
                sample,
                instance,
                table,
                primitive,
                near,
                hit,
                front,
                reference,
                throughput,
                wavelengths_of(scene.spectrum, work, sample),
            )
            if goes_straight(scene.passage, work, sample, reference):
                go_through(scene.interior, scene, work, sample, hit, direction, direction)
                put_path(work, survivors, sample, spawn_point(hit, direction), direction, throughput, pdf)
                survivors += 1
                continue
            normal = shading_normal(scene.relief, scene, hit, instance, reference, site, direction, front, time)
            throughput = meet_hue(scene.spectrum, work, sample, reference, throughput)
            site = with_hue(scene.spectrum, work, sample, site)
            if done == 1:
                ray = (seen_from(scene.passage, work, sample, origin), direction)
                observe(
                    aovs,
                    scene,
                    work,
                    sample,
                    instance,
                    table,
                    primitive,
                    hit,
                    reference,
                    site,
                    normal,
                    front,
                    ray,
                    time,
                )

            # Take what it emits.
            emitted = emission_at(scene, reference, front, site)
            if not is_black(emitted):
                vertex = seen_from(scene.passage, work, sample, origin)
                weight = weight_emitted(
                    scene.lights, scene, instance, table, primitive, vertex, hit.point, hit.normal, time, pdf
                )
                emitted = tinted(scene.spectrum, work, sample, emitted)
                gather(scene.spectrum, work, sample, scale(weight, throughput), emitted)
                note_emission(work.log, work, sample, emitted, weight)
            observe_direct(aovs, work, sample, done)
            if done == scene.depth:
                continue

            # Aim at a light.
            if connect(
                scene.lights,
                scene,
                work,
                shadows,
                sample,
                hit,
                reference,
                site,
                direction,
                normal,
                front,
                throughput,
                time,
                draws,
            ):
                shadows += 1

            # Go on where the material sends the path.
            out = scatter_from(scene.relief, scene, hit, reference, site, direction, normal, front, draws)
            weight = shaded(scene.spectrum, work, sample, reference, out.weight)
            throughput = mul(throughput, weight)
            throughput = part_hues(scene.spectrum, work, sample, reference, normal, out.direction, throughput)
            survival = survive(scene, gain(scene.spectrum, work, sample, throughput), done, draws)
            waves = wavelengths_of(scene.spectrum, work, sample)
            note_scatter(work.log, work, sample, normal, out.direction, weight, out.pdf, throughput, survival, waves)
            if survival == 0.0:
                continue
            go_through(scene.interior, scene, work, sample, hit, direction, out.direction)
            mark_vertex(scene.passage, work, sample, hit.point)
            start = spawn_point(hit, out.direction)
            put_path(work, survivors, sample, start, out.direction, scale(1.0 / survival, throughput), out.pdf)
            survivors += 1
        rays += resolve_shadows(scene.lights, scene, work, shadows, key, first, segment)
        live = survivors
    drop_lost(scene.passage, work, work.sample, live)
    return rays


@generic
def trace_again(spectrum, scene, aovs, work, key, first, count, live):
    """`trace_paths`, as often as paths have wavelengths that go ways of their own; returns the number of rays."""
    raise NotImplementedError


@trace_again.register(type(None))
@trace_again.register(LensSpectrum)
def _(spectrum, scene, aovs, work, key, first, count, live):
    return trace_paths(scene, aovs, work, key, first, live)


@trace_again.register(Spectrum)
def _(spectrum, scene, aovs, work, key, first, count, live):
    rays = 0
    for turn in range(turns(spectrum.camera)):
        if turn > 0:
            live = start_paths_again(scene, aovs, work, count, turn)
            rays += look_around(scene.interior, scene, work, live)
        rays += trace_paths(scene, aovs, work, key, first, live)
        if turn > 0:
            for sample in range(count):
                if goes_again(work, sample):
                    observe_end(aovs, work, sample)
    return rays


@entry
def render_tile(scene, film, work, left, top, right, bottom, begin, end):
    """Samples begin .. end - 1 of the pixels left <= x < right, top <= y < bottom; returns the rays traced.

    Packets start at multiples of PACKET from `begin` on, so whoever calls with such a `begin` gets the same bits
    however the samples are split into calls.
    """
    tracing, room = share(scene), share(work)
    rays = 0
    for y in range(top, bottom):
        for x in range(left, right):
            key = pixel_key(scene.sampler, x, y)
            for first in range(begin, end, PACKET):
                count = min(PACKET, end - first)
                live = start_paths(tracing, film.aovs, room, key, x, y, first, count)
                rays += look_around(scene.interior, tracing, room, live)
                rays += trace_again(scene.spectrum, tracing, film.aovs, room, key, first, count, live)
                accumulate(scene.spectrum, scene.clamp, film, room, x - film.left, y - film.top, count)
    return rays
