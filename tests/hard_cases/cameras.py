"""Cameras at their limits: no aperture, focus nowhere, the widest and the smallest openings and angles."""

import math

import numpy as np

from raytracer.analysis.explain import explain
from raytracer.plugins.cameras.pinhole import Pinhole
from raytracer.plugins.cameras.thin_lens import ThinLens
from raytracer.scene.load import load
from tests.hard_cases.at_load import PINHOLE, is_taken, packed, point
from tests.hard_cases.harness import ROUNDING, SCENES, hard_case
from tests.plugins.cameras.kernels import camera_rays, weighted_rays

# Along -z, so that depths are distances along -z.
_LOOK = {"look_from": (0.0, 0.0, 0.0), "look_at": (0.0, 0.0, -10.0)}
_BALL = "type: sphere, center: [0, 0, -3], radius: 1"


def _film(count, seed, width=40, height=30):
    """Places all over the film."""
    rng = np.random.default_rng(seed)
    return rng.uniform(0.0, width, count), rng.uniform(0.0, height, count)


def _unit(vectors):
    return vectors / np.sqrt((vectors * vectors).sum(axis=1, dtype=vectors.dtype))[:, None]


@hard_case(23, "pbrt-v4 and Cycles (both branch)", "no_aperture", quick=20_000, thorough=2_000_000)
def no_aperture_is_the_pinhole(rays):
    """Rays of a lens whose aperture is 0, against those of the pinhole, bit for bit.

    A lens that is only very small still aims at its plane of focus: normalize(F d) is another number than normalize(d)
    for half of all rays, and a sequence of random numbers goes to the lens.  With no aperture ours has no lens.
    """
    x, y = _film(rays, 23)
    views = ({"vfov": 40.0}, 10.0), ({"vfov": 40.0}, 10.0), ({"focal_length": 50.0}, math.inf)
    stops = {"aperture": 0.0}, {"defocus_angle": 0.0}, {"f_number": math.inf}
    for (view, focus), stop in zip(views, stops, strict=True):
        starts, expected = camera_rays(Pinhole(**view, **_LOOK).pack(40, 30), x, y)
        lens = ThinLens(**_LOOK, focus_distance=focus, **view, **stop)
        origins, directions = camera_rays(lens.pack(40, 30), x, y)
        yield "rays that differ", 0, ((directions != expected) | (origins != starts)).any(axis=1)
    _, straight = camera_rays(Pinhole(vfov=40.0, **_LOOK).pack(40, 30), x, y)
    yield "rays that differ", (_unit(10.0 * straight / -straight[:, 2:]) != straight).any(axis=1), 0


@hard_case(24, "IEEE 754: 0 * inf and inf - inf are no numbers", "infinity", 20_000, 2_000_000)
def focus_at_infinity(rays):
    """Rays through a lens of 50 mm that is focused at infinity.

    The point in focus is o + inf d: no number, for all rays.  Ours aims at d - shift / F, which is d.  And what is
    focused far away is nearly so: at F the directions differ by the lens's radius over F and some roundings.
    """
    x, y = _film(rays, 24)
    keys = {"vfov": 40.0, "aperture": 50.0, **_LOOK}
    origins, directions = camera_rays(ThinLens(focus_distance=math.inf, **keys).pack(40, 30), x, y)
    _, straight = camera_rays(Pinhole(vfov=40.0, **_LOOK).pack(40, 30), x, y)
    beyond = np.hypot(origins[:, 0], origins[:, 1]) > 0.025 * (1.0 + 4.0 * ROUNDING)
    naive = np.isnan(_unit(math.inf * straight - origins)).any(axis=1)
    yield "rays that are no numbers, or not parallel", naive, (directions != straight).any(axis=1) | beyond

    # Focused ever farther away, by the point in focus and by the product's form.
    for focus in (1e3, 1e9, 1e15, 1e30):
        found, towards = camera_rays(ThinLens(focus_distance=focus, **keys).pack(40, 30), x, y)
        aim = np.asarray(focus * straight / -straight[:, 2:], np.float32)
        aimed = _unit(aim - found.astype(np.float32)).astype(np.float64)
        expected = _unit(straight / -straight[:, 2:] - found / focus)
        naive = np.where(np.isnan(aimed), 2.0, aimed - expected)
        yield "error of directions, focused 1e3 to 1e30 m away", naive, towards - expected, 16.0 * ROUNDING


@hard_case(25, "Gauss's equation: at the focal length the image is at infinity", quick=60, thorough=600)
def focused_at_its_focal_length(count):
    """Lenses focused at their focal length, or nearer.

    The naive image distance 1 / (1/f - 1/F) is infinite or negative there, and the picture black, mirrored or full of
    NaN.  Each of these must be an error.
    """
    rng = np.random.default_rng(25)
    focal = np.round(10.0 ** rng.uniform(-3.0, 0.0, count), 6)
    focus = focal * np.where(np.arange(count) % 2, 1.0, rng.uniform(0.1, 1.0, count))
    image = 1.0 / (1.0 / focal - 1.0 / focus)

    def is_lens(length, distance):
        keys = f"focal_length: {length!r} m, f_number: 2, focus_distance: {distance!r}"
        camera = f"type: thin_lens, look_at: [0, 0, -1], sensor: {{width: 36 mm, height: 27 mm}}, {keys}"
        return is_taken(_BALL, camera=camera)

    assert is_lens(0.05, 0.0501)
    taken = list(map(is_lens, focal.tolist(), focus.tolist()))
    yield f"of {count}, let through", ~np.isfinite(image) | (image < 0.0), taken


@hard_case(26, "Foote 1915, Bull. Bureau of Standards 12", "half", quick=20_000, thorough=2_000_000)
def the_fastest_lens(rays):
    """Light of radiance 1 through f/0.5 in the middle of the film, as from an even disc of light in the lens's place.

    E = pi L / (1 + 4 N^2): half of what a half space of light brings.  By the law for small openings, pi L / (4 N^2),
    it would be all.  The mean of the rays' weights is off by 5 of its standard deviations in 6e-7 of all runs.
    """
    keys = {"focal_length": 50.0, "focus_distance": math.inf, "iso": 100.0, "shutter": 1.0, **_LOOK}
    for n in (0.5, 1.0):
        lens = ThinLens(f_number=n, pupil="flat", **keys).pack(40, 30)
        _, _, weights = weighted_rays(lens, np.full(rays, 20.0), 15.0)
        expected = math.pi / (1.0 + 4.0 * n * n)
        errors = (found / expected - 1.0 for found in (math.pi / (4.0 * n * n), weights.mean()))
        yield "irradiance, relative error", *errors, 5.0 * weights.std() / math.sqrt(rays) / expected


@hard_case(26, "Airy 1835; Kingslake 1983, ch. 7", "thousand", quick=20_000, thorough=2_000_000)
def the_smallest_opening(rays):
    """A lens of 0.05 mm, f/1000, a kilometre from the world's origin, against the pinhole at half its focus distance.

    Its blur there is A (1 - z / F) = 0.025 mm, 0.005 pixels of 1200 x 800.  Numbers of float32 are 0.06 mm apart at a
    kilometre, so that a program that adds lens and camera in float32 blurs, or shifts, by more.  What it leaves out, an
    Airy disc of 1.34 mm, is said: diffraction is not simulated.
    """
    width, height, depth = 1200, 800, 5.0
    place = np.array([1000.3, 2.1, -700.7])
    look = {"look_from": tuple(place), "look_at": tuple(place - (0.0, 0.0, 10.0))}
    spec = ThinLens(f_number=1000.0, focus_distance=10.0, focal_length=50.0, **look)
    top = spec.optics(width, height).top
    pinhole = Pinhole(vfov=math.degrees(2.0 * math.atan(top)), **look)
    x, y = _film(rays, 26, width, height)
    origins, directions = camera_rays(spec.pack(width, height), x, y)
    _, straight = camera_rays(pinhole.pack(width, height), x, y)
    expected = place + straight * (-depth / straight[:, 2:])
    found = origins + directions * (-depth / directions[:, 2:])

    start = (place + (origins - place)).astype(np.float32)
    way = _unit((place + straight * (-10.0 / straight[:, 2:])).astype(np.float32) - start)
    naive = start + way * ((place[2] - depth - start[:, 2:]) / way[:, 2:])
    pixel = 2.0 * top / height * depth
    shifts = (np.linalg.norm((seen - expected)[:, :2], axis=1) / pixel for seen in (naive, found))
    yield "shift in the picture (px)", *shifts, 0.01

    said = explain(load(SCENES / "26_thousand.yaml")).warnings
    yield "limits that are not reported", 1, not any("diffraction is left out" in sentence for sentence in said)


@hard_case(27, "tan(179.9 deg / 2) = 1145.915", "widest")
def widest_view(_):
    """A view of 179.9 degrees, and of none.

    The naive tangent in float32 is off by a part in 10^4, since the angle's own rounding is magnified by
    2 / sin(vfov) = 1146; in float64 by that many times an ulp of the angle and a few more of the result.  What is no
    angle of view must be an error; the naive program goes on with a flat, infinite or mirrored film.
    """
    half = math.radians(179.9) / 2.0
    exact = 1.0 / math.tan(math.radians(0.1) / 2.0)
    height = packed(_BALL, camera=PINHOLE.replace("40", "179.9")).spec.camera.optics(64, 48).top
    errors = (found / exact - 1.0 for found in (float(np.tan(np.float32(half))), height))
    tolerance = (2.0 / math.sin(2.0 * half) * half + 4.0) * 2.0 * ROUNDING
    yield "relative error of the film's half height", *errors, tolerance
    taken = [is_taken(_BALL, camera=PINHOLE.replace("40", text)) for text in ("0", "180", "-40", "270", ".nan", ".inf")]
    yield f"of {len(taken)} angles that are none, let through", len(taken), taken


@hard_case(28, "Gram-Schmidt twice is enough: Giraud, Langou, Rozloznik 2005", "up", quick=100, thorough=20_000)
def view_along_up(count):
    """Cameras that look along their up.

    It is parallel to the view, or 10^-6 rad from that.

    Parallel, there is no picture, and it must be an error; the naive frame is 0/0.  Nearly parallel, what is left of
    `up` after the view is taken out has lost digits in proportion, and a frame that is made in one go is skew by an ulp
    over the angle.  Ours must be orthonormal to 10^-12, which is what 10^-6 rad leave of float64 after one round, and a
    few ulp after two: 16.
    """
    rng = np.random.default_rng(28)
    for _ in range(count):
        forward = rng.normal(size=3)
        forward /= np.linalg.norm(forward)
        side = np.cross(forward, rng.normal(size=3))
        up = forward + 1e-6 * side / np.linalg.norm(side)
        frame = Pinhole(look_at=tuple(forward.tolist()), up=tuple(up.tolist()), vfov=40.0).frame()
        one = up / np.linalg.norm(up)
        across = one - forward * (one @ forward)
        across /= np.linalg.norm(across)
        frames = [np.cross(forward, across), across, forward], [frame.right, frame.up, frame.forward]
        skews = (np.array(axes) @ np.array(axes).T - np.eye(3) for axes in frames)
        yield "skewness of frames 1e-6 rad from parallel", *skews, 32.0 * ROUNDING
    axes = np.array([(1, 0, 0), (0, -2, 0), (0, 0, 5), (1, 2, 3), (-0.1, 0.7, 1e5)])
    parallel = (f"type: pinhole, look_at: {point(axis)}, up: {point(3.0 * axis)}, vfov: 40" for axis in axes)
    taken = [is_taken(_BALL.replace("-3", "-300"), camera=camera) for camera in parallel]
    yield f"of {len(axes)} views along up, let through", len(axes), taken
