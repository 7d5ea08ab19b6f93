"""Real lenses: rays through glass, flat glass and the stop, total reflection, focus, the pupil; and lens cameras."""

import math
from itertools import product

import numpy as np

from raytracer.optics.lens_system.first_order import cardinal_points
from raytracer.optics.lens_system.focusing import image_distance
from raytracer.optics.lens_system.ray_tracing import intersect_sphere, trace
from raytracer.plugins.cameras.thin_lens import ThinLens
from raytracer.scene.assets.lenses import read_lens
from raytracer.scene.load import build
from raytracer.scene.pack.scene import pack
from raytracer.util.errors import SceneError
from tests.hard_cases.harness import ROUNDING, hard_case
from tests.optics.lens_system.brute_force import by_brute_force
from tests.optics.lens_system.kernels import DOUBLE_GAUSS, Surface, lens_of, pack_surfaces
from tests.plugins.cameras.kernels import weighted_rays
from tests.repository import SCENES
from tests.vectorised import rows, vectorised

LENSES = SCENES / "lenses"

_SCENE = """
camera: {{type: lens, lens: '{lens}', look_from: [0, 0, 0], look_at: [0, 0, -1], sensor: full_frame, dispersion: false,
  {keys}}}
film: {{width: 360, height: 240}}
objects: [{{type: sphere, center: [0, 0, -9], radius: 1}}]
"""


def _camera(lens, keys):
    """The packed camera with a shipped lens, looking along -z from the origin."""
    return pack(build(_SCENE.format(lens=LENSES / f"{lens}.yaml", keys=keys), "case.yaml")).scene.camera


def _traced(lens, origins, directions, *, towards_film=True):
    """Weights (n,), last points and directions (n, 3) of rays (n, 3) through a lens."""
    starts, ways = np.broadcast_arrays(np.atleast_2d(origins), directions)
    return vectorised(trace)(lens, rows(starts), rows(ways), towards_film, None)


def _walk(surfaces, origins, directions, dtype, offset=0.0):
    """Last points and directions (n, 3) of rays through spheres of these radii, by the quadratic of a textbook.

    offset : how far each ray starts off the surface along the normal, times 1 + the largest coordinate.
    """
    p, d = (np.array(np.broadcast_to(array, np.shape(origins)), dtype) for array in (origins, directions))
    place, near = dtype(0), dtype(1)
    for radius, thickness, ior, _ in surfaces:
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


def _on_film(points, directions, film):
    """Find the points x and y (n, 2) where rays meet the plane z = film."""
    return points[:, :2] + ((film - points[:, 2]) / directions[:, 2])[:, None] * directions[:, :2]


_ISSUE_OFFSET = 1500.0 * 2.0**-24


@hard_case(17, "mitsuba3 issue 219", "glass_lens", quick=2000, thorough=200_000)
def lens_elements_without_an_offset(rays):
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
    weights, points, onward = _traced(lens, starts, directions)
    assert weights.all(), "the truth knows no rims"

    film = cardinal_points(lens).rear_focus
    truth = _on_film(*_walk(DOUBLE_GAUSS, starts, directions, np.longdouble), film)
    naive = _on_film(*_walk(DOUBLE_GAUSS, starts, directions, np.float64, _ISSUE_OFFSET), film)
    errors = (np.hypot(*(found - truth).T) for found in (naive, _on_film(points, onward, film)))
    yield "error on the film (mm)", *errors, 16.0 * len(DOUBLE_GAUSS) * film * ROUNDING


@hard_case(17, "mitsuba3 issue 219", quick=2000, thorough=200_000)
def rays_of_the_lens_camera_without_an_offset(rays):
    """Rays that the lens camera sends through a 50 mm lens, followed back to where they came from on the film.

    Their way back through the glass is that of longer numbers.  Each of the 11 surfaces adds some 16 roundings of
    lengths of up to 68 mm on the way out, and the way through the frame of the scene, in metres and back, 8 more.  By
    an offset of 1500 ulp of float32 they end where no film point is.
    """
    camera = _camera("double-gauss-50mm", "f_number: 4, focus_distance: 2")
    rng = np.random.default_rng(17)
    x, y = rng.uniform(60.0, 300.0, rays), rng.uniform(40.0, 200.0, rays)
    origins, directions, weights = weighted_rays(camera, x, y)
    passed = weights > 0.0
    assert passed.mean() > 0.5
    elements = read_lens(LENSES / "double-gauss-50mm.yaml").elements
    surfaces = [(1.0 / e.curvature if e.curvature else 0.0, e.thickness, float(e.glass.ior()), 0.0) for e in elements]
    # The scene's frame has x to the right and z towards the viewer; the lens's film is upside down in neither.
    frame = camera.frame
    axes = np.array([frame.right, frame.up, np.negative(frame.forward)])
    starts = 1e3 * (origins[passed] - frame.origin) @ axes.T
    starts[:, 2] += float(camera.pupil)
    ways = -directions[passed] @ axes.T
    starts -= 5.0 * ways
    film = float(camera.film.z)
    naive = _on_film(*_walk(surfaces, starts, ways, np.float64, _ISSUE_OFFSET), film)
    there = _on_film(*_walk(surfaces, starts, ways, np.longdouble), film)
    expected = np.stack([-(x[passed] - 180.0), y[passed] - 120.0], axis=1) * camera.film.pixel
    errors = (np.hypot(*(found - expected).T) for found in (naive, there))
    yield "error on the film (mm)", *errors, (16.0 * len(surfaces) + 8.0) * film * ROUNDING


# ---- Flat glass


@hard_case(32, "pbrt-v4 cameras.cpp (a radius of 0 is the stop); Feder 1951, JOSA 41(9)", quick=500, thorough=50_000)
def flat_and_weakly_curved_glass(rays):
    """Flat glass, which is no stop, and glass of a radius up to 1e6 m, whose sag is that of flat glass or nearly.

    By the table's custom a plano-convex lens is a surface and a stop, and its focus that inside of the glass.  By the
    quadratic of a sphere's centre, a hit at the vertex is the difference of numbers as large as the radius; with the
    curvature c it is f / (g + sqrt(g^2 - c f)), in which nothing cancels: some 8 roundings of the ray's way of 100 mm.
    """
    plano_convex = [Surface(1.0 / 50.0, 5.0, 1.5, 9.0), Surface(0.0, 0.0, 1.0, 9.0)]
    ours = cardinal_points(pack_surfaces(plano_convex)).focal_length
    # What is left of it when the flat side is taken for the stop.
    naive = cardinal_points(pack_surfaces(plano_convex[:1])).rear_focus
    errors = (found / (50.0 / (1.5 - 1.0)) - 1.0 for found in (naive, ours))
    yield "focal length of plano-convex glass, relative error", *errors, 4.0 * ROUNDING

    rng = np.random.default_rng(32)
    start = np.stack([np.zeros(rays), rng.uniform(-9.0, 9.0, rays), np.full(rays, -100.0)], axis=1)
    way = np.stack([np.zeros(rays), rng.uniform(-0.05, 0.05, rays), np.ones(rays)], axis=1)
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    for radius in (1e2, -1e4, 1e6, -1e9):
        truth = _to_sphere(start, way, radius, np.longdouble)
        found, _, cosines = vectorised(intersect_sphere)(1.0 / radius, 0.0, rows(start), rows(way), 1.0)
        assert (cosines > 0.0).all()
        errors = (_to_sphere(start, way, radius, np.float64) - truth, found - truth)
        yield "error of the way to the glass (mm)", *errors, 8.0 * 200.0 * ROUNDING


def _to_sphere(origins, directions, radius, dtype):
    """Distances (n,) to the near side of a sphere of this radius with its vertex at 0, from the sphere's centre.

    In longer numbers the root is taken that does not cancel.
    """
    p, d, r = np.asarray(origins, dtype), np.asarray(directions, dtype), dtype(radius)
    oc = p - np.array([0, 0, r], dtype)
    b = (oc * d).sum(axis=1)
    # |o|^2 - 2 o_z r is |oc|^2 - r^2 without its difference.
    longer = dtype is np.longdouble
    c = (p * p).sum(axis=1) - 2 * p[:, 2] * r if longer else (oc * oc).sum(axis=1) - r * r
    root = np.copysign(np.sqrt(b * b - c), r)
    return c / (root - b) if longer else -b - root


@hard_case(32, "pbrt-v4 cameras.cpp (a radius of 0 is the stop)")
def a_lens_camera_with_flat_glass(_):
    """Where the lens camera's film is behind a plano-convex lens whose flat side is first, focused at infinity.

    Light through the zone of the pupil that halves its area is in focus: back focus(h) of camera truths, at f/10 with
    h = 5 mm sqrt(1/2).  With the flat side taken for the stop there is one surface in air alone, and a focus of R.
    """
    lens = read_lens(LENSES / "plano-convex-100mm.yaml")
    camera = _camera("plano-convex-100mm", "f_number: 10, focus_distance: .inf")
    (round_side,) = [element for element in lens.elements if element.curvature != 0.0]
    radius, n = abs(1.0 / round_side.curvature), max(float(element.glass.ior()) for element in lens.elements)
    height = math.sqrt(0.5) * radius / (n - 1.0) / 20.0
    bent = math.asin(n * height / radius) - math.asin(height / radius)
    expected = height / math.tan(bent) - (radius - math.sqrt(radius**2 - height**2))
    found = float(camera.film.z - camera.surfaces.vertex[-1])
    # Not even that: what is left of the lens is a surface between air and air.
    yield "error of the film's place (mm)", radius - expected, found - expected, 1e-3 * height


# ---- Total reflection


@hard_case(33, "Snell's law; Kolb, Mitchell, Hanrahan 1995, SIGGRAPH", quick=2000, thorough=200_000)
def total_reflection_in_an_element(rays):
    """Light that enters the flat side of a half ball of glass, and leaves through the round one or not at all.

    It is totally reflected where n h exceeds the radius.  A program that takes the root of what is then negative goes
    on with a ray that is no number; ours has the weight 0, and no ray that passes is wrong.
    """
    n, radius = 1.5, 10.0
    heights = np.linspace(0.0, 9.999, rays)
    passes = n * heights / radius < 1.0
    lens = pack_surfaces([Surface(0.0, radius, n, radius), Surface(-1.0 / radius, 0.0, 1.0, radius)])
    starts = np.stack([0 * heights, heights, 0 * heights - 5.0], axis=1)
    weights, points, directions = _traced(lens, starts, (0.0, 0.0, 1.0))
    wrong = (weights != passes) | ~np.isfinite(np.concatenate([points, directions], axis=1)).all(axis=1)
    naive = np.sqrt(1.0 - (n * heights / radius) ** 2)
    yield "rays that are wrong, or no numbers", np.isnan(naive), wrong


@hard_case(33, "Snell's law; Kolb, Mitchell, Hanrahan 1995, SIGGRAPH", quick=500, thorough=20_000)
def no_picture_of_what_is_totally_reflected(rays):
    """All shipped lenses, wide open, from all of the film and beyond: every ray is of numbers, or weighs 0.

    By the square root of what is negative, a naive program's rays are no numbers where they are totally reflected, or
    miss a surface.
    """
    rng = np.random.default_rng(33)
    x, y = rng.uniform(-180.0, 540.0, rays), rng.uniform(-120.0, 360.0, rays)
    for path in sorted(LENSES.glob("*.yaml")):
        origins, directions, weights = weighted_rays(_camera(path.stem, "focus_distance: .inf"), x, y)
        lost = weights == 0.0
        finite = np.isfinite(np.concatenate([origins, directions], axis=1)).all(axis=1)
        unit = np.abs(np.linalg.norm(directions, axis=1) - 1.0) < 1e-12
        yield "rays that are wrong, or no numbers", lost, ~(weights >= 0.0) | ~(lost | (finite & unit))


# ---- Focus

_TRAVEL = 60.0
_PATIENCE = 500


@hard_case(34, "pbrt-v3 pull requests 122 and 123", "pupil")
def near_focus_with_a_small_aperture(_):
    """A 50 mm lens, stopped down to 0.02 mm, focused as near as 10 mm, where it makes no image at all.

    A search that shoots a ray from the film at a fixed part of the rear element meets nothing but the stop's blades,
    and goes on moving the film: it ends with the first film that a ray gets through from, or never.  Ours follows one
    ray, through a part of what is open, from the plane to the film, so that there is nothing to search; and what is
    nearer than the film's travel allows is found by a ray the other way.  Right is what is within 2 % of Newton's
    equation, which is more than the spherical aberration of this lens at f/2 shifts.
    """
    for stop in (8.55, 1.0, 0.1, 0.01):
        lens = lens_of(DOUBLE_GAUSS, stop=stop)
        for distance in (math.inf, 1e4, 500.0, 150.0, 60.0, 30.0, 10.0):
            stuck = _film_by_search(lens, distance) is None
            yield "requests that are neither met nor refused", stuck, not _is_right(lens, distance)


def _is_right(lens, distance):
    """Tell if a plane (mm before the lens) is focused where Newton's equation says, or refused as too near."""
    points = cardinal_points(lens)
    back, away = points.rear_focus - float(lens.vertex[-1]), distance + points.front_focus
    expected = back + points.focal_length**2 / away if away > 0.0 else math.inf
    # What is sharp with the film as far away as it goes is the nearest plane.
    if not distance >= image_distance(lens, _TRAVEL, towards_film=False):
        return expected > _TRAVEL
    found = image_distance(lens, distance, towards_film=True)
    return expected <= _TRAVEL and abs(found / expected - 1.0) <= 0.02


def _film_by_search(lens, distance):
    """Find the film position at which a plane is sharp, by moving it in steps until the plane is passed.

    None for a search that has not ended after so many steps; the ray leaves at a tenth of the rear's radius.
    """
    last, first = float(lens.vertex[-1]), cardinal_points(lens).rear_focus - float(lens.vertex[-1])
    travels = first * 1.005 ** np.arange(_PATIENCE)
    ways = np.stack([0.0 * travels, np.full(_PATIENCE, 0.1 * lens.radius[-1]), -travels], axis=1)
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    starts = np.stack([0.0 * travels, 0.0 * travels, last + travels], axis=1)
    weight, point, onward = _traced(lens, starts, ways, towards_film=False)
    met = (weight > 0.0) & (onward[:, 1] * point[:, 1] < 0.0)
    sharp = np.where(met, point[:, 1] * onward[:, 2] / onward[:, 1] - point[:, 2], math.inf)
    passed = np.flatnonzero(sharp < distance)
    return travels[passed[0]] if len(passed) else None


@hard_case(34, "pbrt-v3 pull requests 122 and 123", quick=7, thorough=1)
def the_lens_camera_is_focused_or_refuses(step):
    """All shipped lenses as cameras, by distances down to 10 mm and stops down to f/64.

    A quick run takes one of `step` of these requests, so that each lens, stop and distance is in some.
    What cannot be is one sentence that names the nearest distance; nothing hangs.
    """
    what = "requests that are neither met nor refused"
    paths = sorted(LENSES.glob("*.yaml"))
    for path, f_number, distance in list(product(paths, (16, 64), (".inf", "10", "1", "0.1", "0.01")))[::step]:
        try:
            camera = _camera(path.stem, f"f_number: {f_number}, focus_distance: {distance}")
            yield what, 0, not math.isfinite(camera.film.z)
        except SceneError as error:
            yield what, 0, "nearest" not in str(error)
    for path in paths:
        lens = read_lens(path)
        if lens.is_round() and abs(length := cardinal_points(lens.packed()).focal_length) < 200.0:
            # A search that moves the film from where a lens of this focal length has it.
            narrow = lens.packed(stop_radius=1e-2 * lens.elements[lens.stop()].radius)
            yield what, _film_by_search(narrow, 0.3 * length) is None, 0


# ---- The pupil

_PLACES = 96


@hard_case(34, "pbrt-v3 issue 162", "pupil", quick=2000, thorough=200_000)
def pupil_without_rings(rays):
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
    naive = _overlap(20.0, 22.0, aside) / ((np.minimum(20.0, 22.0 - ring) + 20.0) * 40.0)
    film = (_sigmas(share, expected, rays) for share in (naive, seen))
    yield "brightness of the film, in sigma", *film, 5.0

    origins, _, _ = weighted_rays(packed, np.full(rays, 100.0), 100.0)
    # In 64 rings of equal area are equal counts; by a radius that is drawn evenly, far more in the middle.
    blurs = np.random.default_rng(34).random(rays) ** 2, ((origins / 0.02) ** 2).sum(axis=1)
    shares = (np.histogram(squares, 64, (0.0, 1.0))[0] / rays for squares in blurs)
    yield "profile of the blur, in sigma", *(_sigmas(share, 1.0 / 64, rays) for share in shares), 5.0


def _overlap(a, b, apart):
    """Area in which two discs of the radii a < b overlap.

    References: https://mathworld.wolfram.com/Circle-CircleIntersection.html, eq. 14.
    """
    d = np.maximum(apart, 1e-9)
    x, y = (d * d + a * a - b * b) / (2.0 * d), (d * d + b * b - a * a) / (2.0 * d)
    angles = a * a * np.arccos(np.clip(x / a, -1.0, 1.0)) + b * b * np.arccos(np.clip(y / b, -1.0, 1.0))
    lens = angles - x * np.sqrt(np.maximum(0.0, a * a - x * x)) - y * np.sqrt(np.maximum(0.0, b * b - y * y))
    return np.where(apart <= b - a, math.pi * a * a, np.where(apart >= a + b, 0.0, lens))


def _sigmas(shares, expected, count):
    """Deviations of shares of so many draws, in standard deviations, each of one draw at least."""
    sigma = np.maximum(np.sqrt(np.asarray(expected) * (1.0 - np.asarray(expected)) / count), 1.0 / count)
    return (shares - expected) / sigma


@hard_case(34, "pbrt-v3 issue 162", quick=4000, thorough=200_000)
def the_pupil_of_the_double_gauss_without_rings(rays):
    """How bright the film of the double Gauss is at f/2, at 96 distances from its middle, against brute force.

    A program that draws from bounds of 16 bins of the radius without weighing by their areas has steps between them.
    Each of our means is off by 5 of its standard deviations in 5e-5 of all runs; that of the brute force, a grid of
    600 x 600 points (at 48 distances 300 x 300 in a quick run), by 1e-3 of it.
    """
    camera = _camera("double-gauss-50mm", "f_number: 2, focus_distance: .inf, iso: 100, shutter: 1")
    places = np.linspace(0.0, 21.0, _PLACES if rays > 4000 else _PLACES // 2)
    expected = by_brute_force(camera, places, 600 if rays > 4000 else 300)
    pixels = places / camera.film.pixel
    x, y = 180.0 + pixels * 0.83, 120.0 + pixels * math.sqrt(1.0 - 0.83**2)
    weights = weighted_rays(camera, np.repeat(x, rays), np.repeat(y, rays))[2].reshape(-1, rays)
    spread = np.hypot(weights.std(axis=1) / math.sqrt(rays), 1e-3 * expected)
    # Every bin's bounds are as large as the pupil is at its inner edge, and as full as it is elsewhere.
    inner = np.floor(places / 21.0 * 16.0) / 16.0 * 21.0
    unweighted = expected * expected[0] / np.interp(inner, places, expected)
    errors = ((found - expected) / spread for found in (unweighted, weights.mean(axis=1)))
    yield "brightness of the film, in sigma", *errors, 5.0
