"""Spheres: far, large, touched, met from within and from on them, and as lights."""

import math

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import entry
from raytracer.core.embree import Accel
from raytracer.core.geometry import OFFSET_ULPS
from raytracer.core.primitives.spheres import Spheres
from raytracer.core.vec import normalize
from tests.hard_cases.harness import Measured, hard_case
from tests.plugins.shapes.kernels import built, cast, sample, spawn, uniform_directions, unit

Array = NDArray[np.float64]

_ULP32, _ULP64 = 2.0**-23, 2.0**-52


def _spheres(center: object, radius: object) -> Spheres:
    centers = np.atleast_2d(np.asarray(center, np.float64))
    return Spheres(centers, np.atleast_1d(np.asarray(radius, np.float64)), np.zeros(len(centers), np.int32))


def _roots(origins: object, directions: object, center: object, radius: float, dtype: type = np.float32) -> Array:
    """Both roots (2, n) of |o + t d - c|^2 = r^2 as the textbook has them, NaN for a miss."""
    o, d, c = (np.asarray(rows, dtype) for rows in (origins, directions, center))
    oc = o - c
    a, b = (d * d).sum(axis=-1), (oc * d).sum(axis=-1)
    k = (oc * oc).sum(axis=-1) - dtype(radius) * dtype(radius)
    with np.errstate(invalid="ignore", divide="ignore"):
        root = np.sqrt(b * b - a * k)
        return np.array([(-b - root) / a, (-b + root) / a], np.float64)


def _first(roots: Array, beyond: float = 0.0) -> Array:
    """The nearer root beyond a distance, NaN if there is none."""
    near, far = roots
    return np.where(near > beyond, near, np.where(far > beyond, far, np.nan))


def _against(normals: Array, directions: Array) -> Array:
    """Directions turned to the outside of these normals."""
    return directions * np.where((directions * normals).sum(axis=1) < 0.0, -1.0, 1.0)[:, None]


@hard_case(
    1,
    "mitsuba3 issue 512; Haines et al. 2019, Ray Tracing Gems ch. 7",
    quick=20_000,
    thorough=2_000_000,
    scene="01_far_sphere.yaml",
)
def far_unit_sphere(rays: int) -> list[Measured]:
    """A unit sphere seen from 10 to 100,000 m away.

    In float32, b^2 - c of the quadratic cancels: at 4100 m its error is the sphere's own size.  Embree must meet the
    sphere wherever the impact parameter b is below 0.9, and float64 solves the hit again: the closest approach is known
    to ten roundings of the way L, 10 * 2^-53 L, and half the chord h = sqrt(1 - b^2) to b / h of that, at most 2.1, so
    t to 16 * 2^-52 L, which is far below the 4 ulp of float32 that are asked for.
    """
    distances = (10.0, 100.0, 1e3, 4.1e3, 8e3, 3e4, 1e5)
    missed, naive_missed, error, naive_error = 0, 0, 0.0, 0.0
    count = max(1, rays // len(distances))
    rng = np.random.default_rng(1)
    for distance in distances:
        b = 0.9 * np.sqrt(rng.random(count))
        away, aside = uniform_directions(count, int(distance)), uniform_directions(count, int(distance) + 1)
        aside = unit(aside - (aside * away).sum(axis=1)[:, None] * away)
        origins = distance * away + b[:, None] * aside
        truth = distance - np.sqrt(1.0 - b * b)
        hits = cast((_spheres([0.0, 0.0, 0.0], 1.0),), origins, -away)
        missed += int((hits.table < 0).sum())
        error = max(error, float(np.abs(np.linalg.norm(hits.point - origins, axis=1) - truth).max()) / distance)
        naive = _first(_roots(origins, -away, [0.0, 0.0, 0.0], 1.0))
        naive_missed += int(np.isnan(naive).sum())
        naive_error = max(naive_error, float(np.nanmax(np.abs(naive - truth))) / distance)
    return [
        Measured("rays that miss, b < 0.9", naive_missed, missed, 0.0),
        Measured("error of the distance, in ulp of float32", naive_error / _ULP32, error / _ULP32, 16.0 * 2.0**-29),
    ]


def _ground_distance(degrees: float) -> float:
    """To a sphere of 1000 m below, from 1 m above it, so many degrees below the horizon; NaN for a miss.

    c / (b + sqrt(b^2 - c)), in longer numbers.
    """
    b = np.longdouble(1001.0) * np.sin(np.deg2rad(np.longdouble(degrees)))
    c = np.longdouble(1001.0) ** 2 - np.longdouble(1000.0) ** 2
    return float(c / (b + np.sqrt(b * b - c))) if b * b > c else math.nan


@hard_case(3, "Shirley et al., Ray Tracing in One Weekend, sec. 5: its ground", scene="03_ground.yaml")
def ground_of_one_weekend(_: int) -> list[Measured]:
    """The ground sphere of 1000 m, seen from 1 m above it at 90, 10 and 3.75 degrees; at 2.5 it is not met.

    In float64 the closest approach is wrong by a few roundings of 1000 m, half the chord h by 1000 m / h of that, and
    so is the distance: 4 * 2^-52 * 1000^2 m^2 / h, which is 2e-11 m at 3.75 degrees, where h is 48 m.  Embree's own is
    wrong by as much as a grain of sand.
    """
    center, radius, eye = [0.0, -1000.0, 0.0], 1000.0, [0.0, 1.0, 0.0]
    naive, ours = 0.0, 0.0
    wrong = 0
    for degrees in (90.0, 10.0, 3.75, 2.5):
        angle = math.radians(degrees)
        way = [math.cos(angle), -math.sin(angle), 0.0]
        truth = _ground_distance(degrees)
        hits = cast((_spheres(center, radius),), eye, way)
        wrong += (hits.table[0] < 0) != math.isnan(truth)
        if not math.isnan(truth):
            naive = max(naive, abs(float(hits.near[0]) - truth))
            ours = max(ours, float(abs(np.linalg.norm(hits.point[0] - eye) - truth)))
    height = math.sqrt((1001.0 * math.sin(math.radians(3.75))) ** 2 - 2001.0)
    assert not wrong, "a hit in place of a miss, or the reverse"
    return [Measured("error of the distance (m)", naive, ours, 4.0 * _ULP64 * 1e6 / height)]


@hard_case(5, "hit-or-miss tests of every ray tracer; here Embree 4.4 and float64", quick=1000, thorough=1_000_000)
def eye_at_the_centre(rays: int) -> list[Measured]:
    """An eye at the centre of a sphere sees it all round, one radius away, with the normal outwards.

    A program that takes the smaller root only sees nothing.  The hit point is projected onto the sphere: three
    roundings of a coordinate of at most 4 m.
    """
    center = np.array([1.0, 2.0, 3.0])
    directions = uniform_directions(rays, 5)
    hits = cast((_spheres(center, 1.0),), np.tile(center, (rays, 1)), directions)
    near, _ = _roots(np.tile(center, (rays, 1)), directions, center, 1.0, np.float64)
    off = float(np.abs(hits.point - center - directions).max()) if (hits.table == 0).all() else math.nan
    naive_off = np.linalg.norm(near[:, None] * directions - directions, axis=1).max()
    assert ((hits.normal * directions).sum(axis=1) > 0.0).all()
    return [
        Measured("rays that miss", int((near <= 0.0).sum()), int((hits.table < 0).sum()), 0.0),
        Measured("error of the point (m)", float(naive_off), off, 3.0 * 2.0**-53 * 4.0),
    ]


@hard_case(6, "tangents: Ericson 2005, Real-Time Collision Detection, sec. 5.3.2", quick=20_000, thorough=1_000_000)
def tangent_rays(rays: int) -> list[Measured]:
    """Rays that touch a sphere: they meet it near the point of contact or miss it, and give numbers.

    What float32 meets, float64 may miss by a rounding: the root of what is negative is NaN.  A hit may lie
    sqrt(2 r e) along the ray from the contact, if the sphere is e = 4 ulp of float32 nearer than it seems.
    """
    rng = np.random.default_rng(6)
    contact = uniform_directions(rays, 7)
    across = uniform_directions(rays, 8)
    way = across - (across * contact).sum(axis=1)[:, None] * contact
    way /= np.linalg.norm(way, axis=1)[:, None]
    # A few ulp of float32 to both sides of the tangent.
    aside = rng.uniform(-4.0, 4.0, (rays, 1)) * _ULP32
    origins = (1.0 + aside) * contact - 5.0 * way
    hits = cast((_spheres([0.0, 0.0, 0.0], 1.0),), origins, way)
    met = hits.table == 0
    broken = ~(np.isfinite(hits.point) & np.isfinite(hits.normal) & np.isfinite(hits.uv[:, :1])).all(axis=1)
    off = float(np.linalg.norm(hits.point - contact, axis=1)[met].max())
    textbook = np.isnan(_first(_roots(origins, way, [0.0, 0.0, 0.0], 1.0, np.float64)))
    # At x = 1 and one ulp of float32 beyond, straight on: t = 5 or a miss, and a miss.
    beyond = float(np.nextafter(np.float32(1.0), np.float32(2.0)))
    straight = cast((_spheres([0.0, 0.0, 0.0], 1.0),), [[1.0, 0.0, 5.0], [beyond, 0.0, 5.0]], [[0.0, 0.0, -1.0]] * 2)
    assert straight.table[1] < 0
    assert straight.table[0] < 0 or abs(straight.point[0, 2]) < off
    assert met.sum() > rays // 10
    return [
        Measured("hits that are no numbers", int((textbook & met).sum()), int((broken & met).sum()), 0.0),
        Measured(
            "distance from the contact (m)",
            math.nan if (textbook & met).any() else 0.0,
            off,
            math.sqrt(2.0 * 4.0 * 6.0 * _ULP32),
        ),
    ]


@hard_case(7, "shadow acne; Waechter, Binder 2019, Ray Tracing Gems ch. 6", quick=20_000, thorough=1_000_000)
def from_on_the_surface(rays: int) -> list[Measured]:
    """Rays that start exactly on a sphere: those outwards meet nothing, those inwards the far side of the chord.

    Rounded to float32, half of the starting points lie within, and half without.
    """
    normals = uniform_directions(rays, 9)
    center = np.array([0.3, -0.7, 0.2])
    table = _spheres(center, 1.0)
    accel = built(table)
    origins, onwards = center + 3.0 * normals, _against(normals, uniform_directions(rays, 10))
    outside = spawn((table,), origins, -normals, onwards, accel=accel)
    again = cast((table,), outside, onwards, accel=accel)
    inside = spawn((table,), origins, -normals, -onwards, accel=accel)
    across = cast((table,), inside, -onwards, accel=accel)
    cosine = (onwards * normals).sum(axis=1)
    # A chord is told from nothing if it is longer than what the offset takes of it.
    long = cosine > math.sqrt(OFFSET_ULPS)
    short = (across.table < 0) | (np.linalg.norm(across.point - (center + normals), axis=1) < cosine)
    on = center + normals
    outwards = _first(_roots(on, onwards, center, 1.0))
    inwards = _first(_roots(on, -onwards, center, 1.0))
    naive_short = ~(inwards > cosine)
    naive_again = int((~np.isnan(outwards)).sum())
    return [
        Measured("rays outwards that meet it again", naive_again, int((again.table >= 0).sum()), 0.0),
        Measured("rays inwards without a far side", int((naive_short & long).sum()), int((short & long).sum()), 0.0),
    ]


@entry
def _normalized(rows, out):
    for i in range(len(rows)):
        x, y, z = normalize((rows[i, 0], rows[i, 1], rows[i, 2]))
        out[i, 0], out[i, 1], out[i, 2] = x, y, z


@hard_case(8, "Embree 4.4: rays with long and short directions, measured", quick=2000, thorough=200_000)
def length_of_directions(rays: int) -> list[Measured]:
    """Directions of 1e-20 to 1e20 m meet what unit ones do.

    In float32 their squares are 0 or infinite.  Ours are made unit vectors in float64 before Embree sees them, as
    cameras, materials and instances do.
    """
    directions = uniform_directions(rays, 11)
    lengths = 10.0 ** np.random.default_rng(12).uniform(-20.0, 20.0, (rays, 1))
    lengths[:2, 0] = 1e-20, 1e20
    ways = np.ascontiguousarray(lengths * directions)
    origins = np.zeros((rays, 3))
    made = np.empty_like(ways)
    _normalized(ways, made)
    with np.errstate(over="ignore", under="ignore"):
        raw = _first(_roots(origins, ways, [0.0, 0.0, 0.0], 1.0)) * lengths[:, 0]
    hits = cast((_spheres([0.0, 0.0, 0.0], 1.0),), origins, made)
    off = np.linalg.norm(hits.point - directions, axis=1)
    return [
        Measured("rays that miss or err", int((~(np.abs(raw - 1.0) < 1e-5)).sum()), int((~(off < 1e-12)).sum()), 0.0)
    ]


@hard_case(9, "pbrt-v4, shapes_test.cpp: Sphere.Reintersect", quick=50, thorough=1000, scene="09_all_sizes.yaml")
def spheres_of_all_sizes(count: int) -> list[Measured]:
    """Spheres of 0.1 mm to 10 km, up to 1000 radii off: of 1000 rays that leave each, none meets it again.

    The offset of 4 ulp is that of |centre| + radius; without one, float32 puts half of the points inside.
    """
    rng = np.random.default_rng(13)
    ours, naive = 0, 0
    for _ in range(count):
        radius = 10.0 ** rng.uniform(-4.0, 4.0)
        center = rng.uniform(-1.0, 1.0, 3) * radius * 10.0 ** rng.uniform(-1.0, 3.0)
        table = _spheres(center, radius)
        accel: Accel = built(table)
        normals = uniform_directions(1000, int(rng.integers(1 << 31)))
        onwards = _against(normals, uniform_directions(1000, int(rng.integers(1 << 31))))
        starts = spawn((table,), center + 3.0 * radius * normals, -normals, onwards, accel=accel)
        left = ~np.isnan(starts[:, 0])
        assert left.mean() > 0.9
        ours += int((cast((table,), starts[left], onwards[left], accel=accel).table >= 0).sum())
        naive += int((cast((table,), center + radius * normals, onwards, accel=accel).table >= 0).sum())
    return [Measured("rays that meet their own sphere", naive, ours, 0.0)]


@hard_case(
    10, "pbrt-v4, sec. 6.2.4: sampling spheres by their cone", quick=1000, thorough=100_000, scene="10_far_lamp.yaml"
)
def far_and_tiny_lamps(points: int) -> list[Measured]:
    """A lamp of 1 m seen from 10 km, and one of 1 mm that is left.

    1 - cos of the cone is 0 in float32, which makes an infinite density; s^2 / (1 + sqrt(1 - s^2)) keeps all digits.
    The tolerance is four roundings: of s^2, the root, the sum and the quotient.  And a fixed least distance of 1 mm
    skips the far side of what is as small.
    """
    lamp = _spheres([0.0, 0.0, 0.0], 1.0)
    squared = np.longdouble(1e-4) ** 2
    truth = float(1.0 / (2.0 * np.longdouble(np.pi) * squared / (1.0 + np.sqrt(1.0 - squared))))
    drawn = sample((lamp,), 0, 0, [1e4, 0.0, 0.0], np.random.default_rng(14).random((points, 2)))
    cosine = np.sqrt(np.float32(1.0) - np.float32(1e-4) ** 2)
    with np.errstate(divide="ignore"):
        naive = float(np.float32(1.0) / (np.float32(2.0 * np.pi) * (np.float32(1.0) - cosine)))

    # Into a sphere of 1 mm: the far end of the chord is 2 r cos away.
    center, radius = np.array([0.01, 0.02, 0.03]), 1e-3
    table = _spheres(center, radius)
    accel = built(table)
    normals = uniform_directions(points, 15)
    inwards = -_against(normals, uniform_directions(points, 16))
    starts = spawn((table,), center + 3.0 * radius * normals, -normals, inwards, accel=accel)
    hits = cast((table,), starts, inwards, accel=accel)
    chord = -2.0 * radius * (inwards * normals).sum(axis=1)
    on = center + radius * normals
    reached = np.linalg.norm(hits.point - on, axis=1)
    textbook = _first(_roots(on, inwards, center, radius), beyond=1e-3)
    # Moved inwards by d, a ray at the cosine c goes on for d / c more: a tenth of its chord 2 r c if c^2 = 5 d / r.
    long = chord > 2.0 * radius * math.sqrt(5.0 * OFFSET_ULPS * (0.03 + radius) / radius)
    wrong, naive_wrong = (int((~(np.abs(way - chord) < 0.1 * chord))[long].sum()) for way in (reached, textbook))
    off = float(np.abs(drawn.pdf / truth - 1.0).max())
    return [
        Measured("relative error of the density", abs(naive / truth - 1.0), off, 4.0 * _ULP64),
        Measured("wrong exits from 1 mm", naive_wrong, wrong, 0.0),
    ]
