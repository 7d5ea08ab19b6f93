"""Real lenses: rays through their glass, flat glass and the stop, total reflection, focus, and the pupil."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.optics.lens_system.first_order import cardinal_points
from raytracer.optics.lens_system.focusing import image_distance
from raytracer.optics.lens_system.surfaces import LensSurfaces
from raytracer.plugins.cameras.thin_lens import ThinLens
from tests.hard_cases.harness import Measured, hard_case
from tests.optics.lens_system.kernels import DOUBLE_GAUSS, Surface, lens_of, met, pack_surfaces, traced
from tests.plugins.cameras.kernels import weighted_rays

Array = NDArray[Any]

_ULP = 2.0**-53
"""Half the distance of float64 numbers, relative to them: the largest error of one operation."""


def _walk(rows: Any, origins: Any, directions: Any, dtype: type, offset: float = 0.0) -> tuple[Array, Array]:
    """Last points and directions (n, 3) of rays through spheres of these radii, by the quadratic of a textbook.

    offset : how far each ray starts off the surface along the normal, times 1 + the largest coordinate.
    """
    p, d = (np.array(np.broadcast_to(array, np.shape(origins)), dtype) for array in (origins, directions))
    place, near = dtype(0), dtype(1)
    for radius, thickness, ior, _ in rows:
        if radius == 0.0:
            place += dtype(thickness)
            continue
        r, center = dtype(radius), np.array([0, 0, place + dtype(radius)], dtype)
        oc = p - center
        b, c = (oc * d).sum(axis=1), (oc * oc).sum(axis=1) - r * r
        t = -b - np.copysign(np.sqrt(b * b - c), r)
        p = p + t[:, None] * d
        normal = (center - p) / r
        cos_i, eta = (normal * d).sum(axis=1), near / dtype(ior)
        cos_t = np.sqrt(1 - eta * eta * (1 - cos_i * cos_i))
        d = eta * d + (cos_t - eta * cos_i)[:, None] * normal
        p = p + (dtype(offset) * (1 + np.abs(p).max(axis=1)))[:, None] * normal
        place, near = place + dtype(thickness), dtype(ior)
    return p, d


@hard_case(17, "mitsuba3 issue 219", quick=2000, thorough=200_000, scene="17_glass_lens.yaml")
def lens_elements_without_an_offset(rays: int) -> list[Measured]:
    """Parallel light through a 50 mm lens of six elements, as it arrives on the film.

    A program that traces glass as it traces any surface starts each ray off it, by 1500 ulp of float32 of 1 + its
    largest coordinate in the issue: ten surfaces, each of which puts the ray aside by that times the sine of its angle
    to the normal.  In their known order they need no offset.  Of the 11 surfaces each adds some 16 roundings of lengths
    up to the lens and back focus together, 68 mm; the truth is the same walk in longer numbers.
    """
    lens = lens_of(DOUBLE_GAUSS)
    rng = np.random.default_rng(17)
    radius, turn, slope = 4.0 * np.sqrt(rng.random(rays)), 2.0 * math.pi * rng.random(rays), 0.1 * rng.random(rays)
    directions = np.stack([slope, np.zeros(rays), np.ones(rays)], axis=1)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    starts = np.stack([radius * np.cos(turn), radius * np.sin(turn), np.zeros(rays)], axis=1) - 5.0 * directions
    weights, points, onward = traced(lens, starts, directions)
    assert weights.all(), "the truth knows no rims"

    film = cardinal_points(lens).rear_focus
    truth = _on_film(*_walk(DOUBLE_GAUSS, starts, directions, np.longdouble), film)
    naive = _on_film(*_walk(DOUBLE_GAUSS, starts, directions, np.float64, 1500.0 * 2.0**-24), film)
    errors = [float(np.hypot(*(found - truth).T).max()) for found in (naive, _on_film(points, onward, film))]
    return [Measured("error on the film (mm)", *errors, 16.0 * len(DOUBLE_GAUSS) * film * _ULP)]


def _on_film(points: Array, directions: Array, film: float) -> Array:
    """Find the points x and y (n, 2) where rays meet the plane z = film."""
    return points[:, :2] + ((film - points[:, 2]) / directions[:, 2])[:, None] * directions[:, :2]


@hard_case(32, "pbrt-v4 cameras.cpp (a radius of 0 is the stop); Feder 1951, JOSA 41(9)", quick=500, thorough=50_000)
def flat_and_weakly_curved_glass(rays: int) -> list[Measured]:
    """Flat glass, which is no stop, and glass of a radius up to 1e6 m, whose sag is that of flat glass or nearly.

    By the table's custom a plano-convex lens is a surface and a stop, and its focus that inside of the glass.  By the
    quadratic of a sphere's centre, a hit at the vertex is the difference of numbers as large as the radius; with the
    curvature c it is f / (g + sqrt(g^2 - c f)), in which nothing cancels: some 8 roundings of the ray's way of 100 mm.
    """
    plano_convex = [Surface(1.0 / 50.0, 5.0, 1.5, 9.0), Surface(0.0, 0.0, 1.0, 9.0)]
    expected = 50.0 / (1.5 - 1.0)
    ours = cardinal_points(pack_surfaces(plano_convex)).focal_length
    # What is left of it when the flat side is taken for the stop.
    naive = cardinal_points(pack_surfaces(plano_convex[:1])).rear_focus

    rng = np.random.default_rng(32)
    start = np.stack([np.zeros(rays), rng.uniform(-9.0, 9.0, rays), np.full(rays, -100.0)], axis=1)
    way = np.stack([np.zeros(rays), rng.uniform(-0.05, 0.05, rays), np.ones(rays)], axis=1)
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    worst, naive_worst = 0.0, 0.0
    for radius in (1e2, -1e4, 1e6, -1e9):
        truth = _to_sphere(start, way, radius, np.longdouble)
        found, cosines = met(1.0 / radius, start, way)
        assert (cosines > 0.0).all()
        worst = max(worst, float(np.abs(found - truth).max()))
        naive_worst = max(naive_worst, float(np.abs(_to_sphere(start, way, radius, np.float64) - truth).max()))
    wrong, off = naive / expected - 1.0, abs(ours / expected - 1.0)
    return [
        Measured("focal length of plano-convex glass, relative error", wrong, off, 4.0 * _ULP),
        Measured("error of the way to the glass (mm)", naive_worst, worst, 8.0 * 200.0 * _ULP),
    ]


def _to_sphere(origins: Array, directions: Array, radius: float, dtype: type) -> Array:
    """Distances (n,) to the near side of a sphere of this radius with its vertex at 0, from the sphere's centre.

    In longer numbers the root is taken that does not cancel.
    """
    p, d = np.asarray(origins, dtype), np.asarray(directions, dtype)
    r = dtype(radius)
    oc = p - np.array([0, 0, r], dtype)
    b = (oc * d).sum(axis=1)
    if dtype is np.longdouble:
        # |o|^2 - 2 o_z r is |oc|^2 - r^2 without its difference.
        c = (p * p).sum(axis=1) - 2 * p[:, 2] * r
        return np.asarray(c / (-b + np.copysign(np.sqrt(b * b - c), r)))
    c = (oc * oc).sum(axis=1) - r * r
    return np.asarray(-b - np.copysign(np.sqrt(b * b - c), r))


@hard_case(33, "Snell's law; Kolb, Mitchell, Hanrahan 1995, SIGGRAPH", quick=2000, thorough=200_000)
def total_reflection_in_an_element(rays: int) -> list[Measured]:
    """Light that enters the flat side of a half ball of glass, and leaves through the round one or not at all.

    It is totally reflected where n h exceeds the radius.  A program that takes the root of what is then negative goes
    on with a ray that is no number; ours has the weight 0, and no ray that passes is wrong.
    """
    n, radius = 1.5, 10.0
    heights = np.linspace(0.0, 9.999, rays)
    passes = n * heights / radius < 1.0
    lens = pack_surfaces([Surface(0.0, radius, n, radius), Surface(-1.0 / radius, 0.0, 1.0, radius)])
    weights, points, directions = traced(lens, np.stack([0 * heights, heights, 0 * heights - 5.0], axis=1), (0, 0, 1))
    wrong = (weights != passes) | ~np.isfinite(np.concatenate([points, directions], axis=1)).all(axis=1)
    with np.errstate(invalid="ignore"):
        naive = np.sqrt(1.0 - (n * heights / radius) ** 2)
    return [Measured("rays that are wrong, or no numbers", int(np.isnan(naive).sum()), int(wrong.sum()), 0.0)]


_STOPS = (8.55, 1.0, 0.1, 0.01)
_DISTANCES = (math.inf, 1e4, 500.0, 150.0, 60.0, 30.0, 10.0)
_TRAVEL = 60.0
_PATIENCE = 500


@hard_case(34, "pbrt-v3 pull requests 122 and 123", scene="34_pupil.yaml")
def near_focus_with_a_small_aperture(trials: int) -> list[Measured]:
    """A 50 mm lens, stopped down to 0.02 mm, focused as near as 10 mm, where it makes no image at all.

    A search that shoots a ray from the film at a fixed part of the rear element meets nothing but the stop's blades,
    and goes on moving the film: it ends with the first film that a ray gets through from, or never.  Ours follows one
    ray, through a part of what is open, from the plane to the film, so that there is nothing to search; and what is
    nearer than the film's travel allows is found by a ray the other way.  Right is what is within 2 % of Newton's
    equation, which is more than the spherical aberration of this lens at f/2 shifts.
    """
    stuck, wrong = 0, 0
    for stop in _STOPS:
        lens = lens_of(DOUBLE_GAUSS, stop=stop)
        for distance in _DISTANCES:
            stuck += _film_by_search(lens, distance) is None
            wrong += not _is_right(lens, distance)
    return [Measured("requests that are neither met nor refused", stuck, wrong, 0.0)]


def _is_right(lens: LensSurfaces, distance: float) -> bool:
    """Tell if a plane (mm before the lens) is focused where Newton's equation says, or refused as too near."""
    points = cardinal_points(lens)
    back, away = points.rear_focus - float(lens.vertex[-1]), distance + points.front_focus
    expected = back + points.focal_length**2 / away if away > 0.0 else math.inf
    # What is sharp with the film as far away as it goes is the nearest plane.
    if not distance >= image_distance(lens, _TRAVEL, towards_film=False):
        return expected > _TRAVEL
    found = image_distance(lens, distance, towards_film=True)
    return expected <= _TRAVEL and abs(found / expected - 1.0) <= 0.02


def _film_by_search(lens: LensSurfaces, distance: float) -> float | None:
    """Find the film position at which a plane is sharp, by moving it in steps until the plane is passed.

    None for a search that has not ended after so many steps; the ray leaves at a tenth of the rear's radius.
    """
    last, travel = float(lens.vertex[-1]), cardinal_points(lens).rear_focus - float(lens.vertex[-1])
    for _ in range(_PATIENCE):
        way = np.array([0.0, 0.1 * lens.radius[-1], -travel])
        weight, point, onward = traced(lens, [0, 0, last + travel], way / np.linalg.norm(way), towards_film=False)
        sharp = math.inf
        if weight[0] > 0.0 and onward[0, 1] * point[0, 1] < 0.0:
            sharp = -float(point[0, 2] - point[0, 1] * onward[0, 2] / onward[0, 1])
        if sharp < distance:
            return travel
        travel *= 1.005
    return None


_PLACES = 96


@hard_case(34, "pbrt-v3 issue 162", quick=2000, thorough=200_000, scene="34_pupil.yaml")
def pupil_without_rings(rays: int) -> list[Measured]:
    """How bright the film is at 96 distances from its middle, behind a rim that vignettes.

    The share of the pupil that is seen is the area in which two circles overlap.  A program that draws from the bounds
    of what is seen, one for each of 16 rings of the film, must weigh by their areas: without, each ring is as bright as
    its bounds are full, with a step to the next.  Ours draws from the whole opening, so each place is a binomial
    count, off by 5 of its standard deviations in 5e-5 of all runs; and the radial profile of the blur itself, in 64
    rings of equal area, by as much.
    """
    spec = ThinLens(vfov=60.0, focus_distance=math.inf, aperture=40.0, vignetting={"diameter": 44.0, "distance": 60.0})
    packed = spec.pack(200, 200)
    places = np.linspace(0.0, 100.0, _PLACES)
    _, _, weights = weighted_rays(packed, np.repeat(100.0 + places, rays), 100.0)
    seen = weights.reshape(_PLACES, rays).mean(axis=1)
    aside = 60.0 * np.tan(math.radians(30.0)) * places / 100.0
    expected = _overlap(20.0, 22.0, aside) / (math.pi * 20.0**2)

    # The bounds of a ring of the film: those at its inner edge, between the two circles' edges and as high as the lens.
    ring = np.floor(places / 100.0 * 16) / 16 * 60.0 * math.tan(math.radians(30.0))
    width = np.minimum(20.0, 22.0 - ring) + 20.0
    naive = _overlap(20.0, 22.0, aside) / (width * 40.0)

    origins, _, _ = weighted_rays(packed, np.full(rays, 100.0), 100.0)
    squares = ((origins / 0.02) ** 2).sum(axis=1)
    # In 64 rings of equal area are equal counts; by a radius that is drawn evenly, far more in the middle.
    uneven = np.random.default_rng(34).random(rays) ** 2
    film = (_most_sigmas(share, expected, rays) for share in (naive, seen))
    blur = (_most_sigmas(_rings(found), 1.0 / 64, rays) for found in (uneven, squares))
    return [
        Measured("brightness of the film, in sigma", *film, 5.0),
        Measured("profile of the blur, in sigma", *blur, 5.0),
    ]


def _rings(squares: Array) -> Array:
    """The share of points, by the squares of their distances from the middle of the unit disc, in 64 rings."""
    return np.asarray(np.histogram(squares, 64, (0.0, 1.0))[0] / len(squares))


def _overlap(a: float, b: float, apart: Array) -> Array:
    """Area in which two discs of the radii a < b overlap.

    References: https://mathworld.wolfram.com/Circle-CircleIntersection.html, eq. 14.
    """
    d = np.maximum(apart, 1e-9)
    x, y = (d * d + a * a - b * b) / (2.0 * d), (d * d + b * b - a * a) / (2.0 * d)
    angles = a * a * np.arccos(np.clip(x / a, -1.0, 1.0)) + b * b * np.arccos(np.clip(y / b, -1.0, 1.0))
    lens = angles - x * np.sqrt(np.maximum(0.0, a * a - x * x)) - y * np.sqrt(np.maximum(0.0, b * b - y * y))
    return np.where(apart <= b - a, math.pi * a * a, np.where(apart >= a + b, 0.0, lens))


def _most_sigmas(shares: Array, expected: Any, count: int) -> float:
    """The largest deviation of shares of so many draws, in standard deviations, each of one draw at least."""
    probability = np.broadcast_to(expected, shares.shape)
    sigma = np.maximum(np.sqrt(probability * (1.0 - probability) / count), 1.0 / count)
    return float((np.abs(shares - probability) / sigma).max())
