"""Spheres: far, large, touched, met from within and from on them, and as lights."""

import math

import numpy as np

from raytracer.core.geometry import OFFSET_ULPS
from raytracer.core.primitives.spheres import Spheres
from raytracer.core.vec import normalize
from tests.hard_cases.harness import ROUNDING, ULP32, hard_case
from tests.plugins.shapes.kernels import built, cast, sample, spawn, uniform_directions, unit
from tests.vectorised import rows, vectorised

ORIGIN = (0.0, 0.0, 0.0)


def spheres(center, radius):
    centers = np.atleast_2d(np.asarray(center, np.float64))
    return Spheres(centers, np.atleast_1d(np.asarray(radius, np.float64)), np.zeros(len(centers), np.int32))


def true_distance(origins, directions, center, radius):
    """The nearer distance to a sphere in extended precision, by the form that does not cancel; NaN for a miss."""
    to = np.asarray(center, np.longdouble) - np.asarray(origins, np.longdouble)
    ways = np.asarray(directions, np.longdouble)
    ways = ways / np.sqrt((ways * ways).sum(axis=1))[:, None]
    along = (to * ways).sum(axis=1)
    across = to - along[:, None] * ways
    c = (to * to).sum(axis=1) - np.longdouble(radius) ** 2
    root = np.sqrt(np.longdouble(radius) ** 2 - (across * across).sum(axis=1))
    return c / (along + np.copysign(root, along))


def _roots(origins, directions, center, radius, dtype=np.float32):
    """Both roots (2, n) of |o + t d - c|^2 = r^2 as the textbook has them, NaN for a miss."""
    o, d, c = (np.asarray(vectors, dtype) for vectors in (origins, directions, center))
    oc = o - c
    a, b = (d * d).sum(axis=-1), (oc * d).sum(axis=-1)
    k = (oc * oc).sum(axis=-1) - dtype(radius) * dtype(radius)
    root = np.sqrt(b * b - a * k)
    return np.array([(-b - root) / a, (-b + root) / a], np.float64)


def _first(roots, beyond=0.0):
    """The nearer root beyond a distance, NaN if there is none."""
    near, far = roots
    return np.where(near > beyond, near, np.where(far > beyond, far, np.nan))


def _against(normals, directions):
    """Directions turned to the outside of these normals."""
    return directions * np.where((directions * normals).sum(axis=1) < 0.0, -1.0, 1.0)[:, None]


def _across(vectors, seed):
    """Unit vectors at right angles to others."""
    aside = uniform_directions(len(vectors), seed)
    return unit(aside - (aside * vectors).sum(axis=1)[:, None] * vectors)


@hard_case(1, "mitsuba3 issue 512; Haines et al. 2019, Ray Tracing Gems ch. 7", "far_sphere", 20_000, 2_000_000)
def far_unit_sphere(rays):
    """A unit sphere seen from 10 to 100,000 m away.

    In float32, b^2 - c of the quadratic cancels: at 4100 m its error is the sphere's own size.  Embree must meet the
    sphere wherever the impact parameter b is below 0.9, and float64 solves the hit again: the closest approach is known
    to ten roundings of the way L, 10 * 2^-53 L, and half the chord h = sqrt(1 - b^2) to b / h of that, at most 2.1, so
    t to 16 * 2^-52 L, which is far below the 4 ulp of float32 that are asked for.
    """
    rng = np.random.default_rng(1)
    for distance in (10.0, 100.0, 1e3, 4.1e3, 8e3, 3e4, 1e5):
        b = 0.9 * np.sqrt(rng.random(rays // 7))
        away = uniform_directions(len(b), int(distance))
        origins = distance * away + b[:, None] * _across(away, int(distance) + 1)
        truth = distance - np.sqrt(1.0 - b * b)
        hits = cast((spheres(ORIGIN, 1.0),), origins, -away)
        naive = _first(_roots(origins, -away, ORIGIN, 1.0))
        yield "rays that miss, b < 0.9", np.isnan(naive), hits.table < 0
        errors = (np.nanmax(np.abs(naive - truth)), np.linalg.norm(hits.point - origins, axis=1) - truth)
        yield "error of the distance, in ulp of float32", *(error / distance / ULP32 for error in errors), 2.0**-25


def _ground_distance(degrees):
    """To a sphere of 1000 m below, from 1 m above it, so many degrees below the horizon; NaN for a miss.

    c / (b + sqrt(b^2 - c)), in longer numbers.
    """
    b = np.longdouble(1001.0) * np.sin(np.deg2rad(np.longdouble(degrees)))
    c = np.longdouble(1001.0) ** 2 - np.longdouble(1000.0) ** 2
    return float(c / (b + np.sqrt(b * b - c))) if b * b > c else math.nan


@hard_case(3, "Shirley et al., Ray Tracing in One Weekend, sec. 5: its ground", "ground")
def ground_of_one_weekend(_):
    """The ground sphere of 1000 m, seen from 1 m above it at 90, 10 and 3.75 degrees; at 2.5 it is not met.

    In float64 the closest approach is wrong by a few roundings of 1000 m, half the chord h by 1000 m / h of that, and
    so is the distance: 4 * 2^-52 * 1000^2 m^2 / h, which is 2e-11 m at 3.75 degrees, where h is 48 m.  Embree's own is
    wrong by as much as a grain of sand.
    """
    eye = [0.0, 1.0, 0.0]
    height = math.sqrt((1001.0 * math.sin(math.radians(3.75))) ** 2 - 2001.0)
    for degrees in (90.0, 10.0, 3.75, 2.5):
        angle, truth = math.radians(degrees), _ground_distance(degrees)
        hits = cast((spheres([0.0, -1000.0, 0.0], 1000.0),), eye, [math.cos(angle), -math.sin(angle), 0.0])
        assert (hits.table[0] < 0) == math.isnan(truth), "a hit in place of a miss, or the reverse"
        if not math.isnan(truth):
            ours = np.linalg.norm(hits.point[0] - eye) - truth
            yield "error of the distance (m)", hits.near - truth, ours, 8.0 * ROUNDING * 1e6 / height


_BOOK = "RayTracing/raytracing.github.io, the ground sphere of every scene; Haines et al. 2019, Ray Tracing Gems ch. 7"


@hard_case(4, _BOOK, "large_ground", quick=4000, thorough=400_000)
def large_ground(rays):
    """Ground spheres of radius 1 km to 1000 km, seen from 2 m above: by how much hits are above or below the ground.

    Embree's float32 puts hits off by an ulp of the radius, 0.12 m for the largest.  Solved again in float64, the
    closest approach and half the chord are each known to a few roundings of 2^-53 of |c| + R, eight in all, and an
    error of the distance counts off the ground times the cosine.
    """
    rng = np.random.default_rng(4)
    for radius in (1e3, 1e4, 1e5, 1e6):
        table = spheres([0.0, -radius, 0.0], radius)
        origins = np.column_stack([rng.uniform(-5, 5, rays), np.full(rays, 2.0), rng.uniform(-5, 5, rays)])
        # Down, by up to 60 degrees off the vertical.
        sine, turn = np.sin(np.arccos(1.0 - 0.5 * rng.random(rays))), rng.uniform(0.0, 2.0 * np.pi, rays)
        directions = np.column_stack([sine * np.cos(turn), -np.sqrt(1.0 - sine**2), sine * np.sin(turn)])
        truth = true_distance(origins, directions, table.center[0], radius)
        heights = []
        for exact in (False, True):
            hits = cast((table,), origins, directions, exact=exact)
            # Embree's own distance is what a program has that takes its hits as they are.
            reached = np.linalg.norm(hits.point - origins, axis=1) if exact else hits.near
            heights.append((np.where(hits.table < 0, np.inf, reached) - truth) * directions[:, 1])
        yield f"hits off the ground, R = {radius:.0e} m (m)", *heights, 16.0 * ROUNDING * radius


@hard_case(5, "hit-or-miss tests of every ray tracer; here Embree 4.4 and float64", quick=1000, thorough=1_000_000)
def eye_at_the_centre(rays):
    """An eye at the centre of a sphere sees it all round, one radius away, with the normal outwards.

    A program that takes the smaller root only sees nothing.  The hit point is projected onto the sphere: three
    roundings of a coordinate of at most 4 m.
    """
    center = np.array([1.0, 2.0, 3.0])
    directions = uniform_directions(rays, 5)
    hits = cast((spheres(center, 1.0),), np.tile(center, (rays, 1)), directions)
    near, _ = _roots(np.tile(center, (rays, 1)), directions, center, 1.0, np.float64)
    assert ((hits.normal * directions).sum(axis=1) > 0.0).all()
    yield "rays that miss", near <= 0.0, hits.table < 0
    naive = np.linalg.norm((near - 1.0)[:, None] * directions, axis=1)
    yield "error of the point (m)", naive, hits.point - center - directions, 3.0 * ROUNDING * 4.0


@hard_case(6, "tangents: Ericson 2005, Real-Time Collision Detection, sec. 5.3.2", quick=20_000, thorough=1_000_000)
def tangent_rays(rays):
    """Rays that touch a sphere: they meet it near the point of contact or miss it, and give numbers.

    What float32 meets, float64 may miss by a rounding: the root of what is negative is NaN.  A hit may lie
    sqrt(2 r e) along the ray from the contact, if the sphere is e = 4 ulp of float32 nearer than it seems.
    """
    contact = uniform_directions(rays, 7)
    way = _across(contact, 8)
    # A few ulp of float32 to both sides of the tangent.
    origins = (1.0 + np.random.default_rng(6).uniform(-4.0, 4.0, (rays, 1)) * ULP32) * contact - 5.0 * way
    hits = cast((spheres(ORIGIN, 1.0),), origins, way)
    met = hits.table == 0
    broken = ~(np.isfinite(hits.point) & np.isfinite(hits.normal) & np.isfinite(hits.uv[:, :1])).all(axis=1)
    off = np.linalg.norm(hits.point - contact, axis=1)[met]
    textbook = np.isnan(_first(_roots(origins, way, ORIGIN, 1.0, np.float64))) & met
    # At x = 1 and one ulp of float32 beyond, straight on: t = 5 or a miss, and a miss.
    beyond = float(np.nextafter(np.float32(1.0), np.float32(2.0)))
    straight = cast((spheres(ORIGIN, 1.0),), [[1.0, 0.0, 5.0], [beyond, 0.0, 5.0]], [[0.0, 0.0, -1.0]] * 2)
    assert straight.table[1] < 0
    assert straight.table[0] < 0 or abs(straight.point[0, 2]) < off.max()
    assert met.sum() > rays // 10
    yield "hits that are no numbers", textbook, broken & met
    naive = math.nan if textbook.any() else 0.0
    yield "distance from the contact (m)", naive, off, math.sqrt(2.0 * 4.0 * 6.0 * ULP32)


@hard_case(7, "shadow acne; Waechter, Binder 2019, Ray Tracing Gems ch. 6", quick=20_000, thorough=1_000_000)
def from_on_the_surface(rays):
    """Rays that start exactly on a sphere: those outwards meet nothing, those inwards the far side of the chord.

    Rounded to float32, half of the starting points lie within, and half without.
    """
    normals = uniform_directions(rays, 9)
    center = np.array([0.3, -0.7, 0.2])
    table = (spheres(center, 1.0),)
    accel = built(*table)
    on, onwards = center + normals, _against(normals, uniform_directions(rays, 10))
    again, across = (
        cast(table, spawn(table, center + 3.0 * normals, -normals, way, accel=accel), way, accel=accel)
        for way in (onwards, -onwards)
    )
    outwards, inwards = (_first(_roots(on, way, center, 1.0)) for way in (onwards, -onwards))
    yield "rays outwards that meet it again", ~np.isnan(outwards), again.table >= 0
    # A chord is told from nothing if it is longer than what the offset takes of it.
    cosine = (onwards * normals).sum(axis=1)
    long = cosine > math.sqrt(OFFSET_ULPS)
    short = (across.table < 0) | (np.linalg.norm(across.point - on, axis=1) < cosine)
    yield "rays inwards without a far side", ~(inwards > cosine) & long, short & long


@hard_case(8, "Embree 4.4: rays with long and short directions, measured", quick=2000, thorough=200_000)
def length_of_directions(rays):
    """Directions of 1e-20 to 1e20 m meet what unit ones do.

    In float32 their squares are 0 or infinite.  Ours are made unit vectors in float64 before Embree sees them, as
    cameras, materials and instances do.
    """
    directions = uniform_directions(rays, 11)
    lengths = 10.0 ** np.random.default_rng(12).uniform(-20.0, 20.0, (rays, 1))
    lengths[:2, 0] = 1e-20, 1e20
    origins, ways = np.zeros((rays, 3)), lengths * directions
    raw = _first(_roots(origins, ways, ORIGIN, 1.0)) * lengths[:, 0]
    hits = cast((spheres(ORIGIN, 1.0),), origins, vectorised(normalize)(rows(ways)))
    off = np.linalg.norm(hits.point - directions, axis=1)
    yield "rays that miss or err", ~(np.abs(raw - 1.0) < 1e-5), ~(off < 1e-12)


@hard_case(9, "pbrt-v4, shapes_test.cpp: Sphere.Reintersect", "all_sizes", quick=50, thorough=1000)
def spheres_of_all_sizes(count):
    """Spheres of 0.1 mm to 10 km, up to 1000 radii off: of 1000 rays that leave each, none meets it again.

    The offset of 4 ulp is that of |centre| + radius; without one, float32 puts half of the points inside.
    """
    rng = np.random.default_rng(13)
    for _ in range(count):
        radius = 10.0 ** rng.uniform(-4.0, 4.0)
        center = rng.uniform(-1.0, 1.0, 3) * radius * 10.0 ** rng.uniform(-1.0, 3.0)
        table = (spheres(center, radius),)
        accel = built(*table)
        normals = uniform_directions(1000, int(rng.integers(1 << 31)))
        onwards = _against(normals, uniform_directions(1000, int(rng.integers(1 << 31))))
        starts = spawn(table, center + 3.0 * radius * normals, -normals, onwards, accel=accel)
        left = ~np.isnan(starts[:, 0])
        assert left.mean() > 0.9
        naive = cast(table, center + radius * normals, onwards, accel=accel).table >= 0
        yield "rays that meet their own sphere", naive, cast(table, starts[left], onwards[left], accel=accel).table >= 0


@hard_case(10, "pbrt-v4, sec. 6.2.4: sampling spheres by their cone", "far_lamp", quick=1000, thorough=100_000)
def far_and_tiny_lamps(points):
    """A lamp of 1 m seen from 10 km, and one of 1 mm that is left.

    1 - cos of the cone is 0 in float32, which makes an infinite density; s^2 / (1 + sqrt(1 - s^2)) keeps all digits.
    The tolerance is four roundings: of s^2, the root, the sum and the quotient.  And a fixed least distance of 1 mm
    skips the far side of what is as small.
    """
    squared = np.longdouble(1e-4) ** 2
    truth = float(1.0 / (2.0 * np.longdouble(np.pi) * squared / (1.0 + np.sqrt(1.0 - squared))))
    drawn = sample((spheres(ORIGIN, 1.0),), 0, 0, [1e4, 0.0, 0.0], np.random.default_rng(14).random((points, 2)))
    cosine = np.sqrt(np.float32(1.0) - np.float32(1e-4) ** 2)
    naive = np.float32(1.0) / (np.float32(2.0 * np.pi) * (np.float32(1.0) - cosine))
    yield "relative error of the density", naive / truth - 1.0, drawn.pdf / truth - 1.0, 8.0 * ROUNDING

    # Into a sphere of 1 mm: the far end of the chord is 2 r cos away.
    center, radius = np.array([0.01, 0.02, 0.03]), 1e-3
    table = (spheres(center, radius),)
    accel = built(*table)
    normals = uniform_directions(points, 15)
    inwards = -_against(normals, uniform_directions(points, 16))
    starts = spawn(table, center + 3.0 * radius * normals, -normals, inwards, accel=accel)
    hits = cast(table, starts, inwards, accel=accel)
    chord = -2.0 * radius * (inwards * normals).sum(axis=1)
    on = center + radius * normals
    ways = (_first(_roots(on, inwards, center, radius), beyond=1e-3), np.linalg.norm(hits.point - on, axis=1))
    # Moved inwards by d, a ray at the cosine c goes on for d / c more: a tenth of its chord 2 r c if c^2 = 5 d / r.
    long = chord > 2.0 * radius * math.sqrt(5.0 * OFFSET_ULPS * (0.03 + radius) / radius)
    yield "wrong exits from 1 mm", *(~(np.abs(way - chord) < 0.1 * chord) & long for way in ways)
