"""Cameras at their limits: no aperture, focus at infinity, the widest and the smallest openings."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.analysis.explain import explain
from raytracer.plugins.cameras.pinhole import Pinhole
from raytracer.plugins.cameras.thin_lens import ThinLens
from raytracer.scene.load import build
from tests.hard_cases.harness import SCENES, Measured, hard_case
from tests.plugins.cameras.kernels import camera_rays, weighted_rays

Array = NDArray[Any]

_ULP = 2.0**-53

# Along -z, so that depths are distances along -z.
_LOOK: dict[str, Any] = {"look_from": (0.0, 0.0, 0.0), "look_at": (0.0, 0.0, -10.0)}


def _film(count: int, seed: int, width: int = 40, height: int = 30) -> tuple[Array, Array]:
    """Places all over the film."""
    rng = np.random.default_rng(seed)
    return rng.uniform(0.0, width, count), rng.uniform(0.0, height, count)


def _unit(rows: Array) -> Array:
    return np.asarray(rows / np.sqrt((rows * rows).sum(axis=1, dtype=rows.dtype))[:, None])


@hard_case(23, "pbrt-v4 and Cycles (both branch)", quick=20_000, thorough=2_000_000, scene="23_no_aperture.yaml")
def no_aperture_is_the_pinhole(rays: int) -> list[Measured]:
    """Rays of a lens whose aperture is 0, against those of the pinhole, bit for bit.

    A lens that is only very small still aims at its plane of focus: normalize(F d) is another number than normalize(d)
    for half of all rays, and a sequence of random numbers goes to the lens.  With no aperture ours has no lens.
    """
    x, y = _film(rays, 23)
    pinhole = Pinhole(vfov=40.0, **_LOOK).pack(40, 30)
    _, straight = camera_rays(pinhole, x, y)
    differ = 0
    for keys in ({"aperture": 0.0}, {"defocus_angle": 0.0}, {"f_number": math.inf, "focal_length": 50.0}):
        angle = {} if "focal_length" in keys else {"vfov": 40.0}
        found = ThinLens(**_LOOK, focus_distance=10.0 if angle else math.inf, **angle, **keys)
        other = pinhole if angle else Pinhole(focal_length=50.0, **_LOOK).pack(40, 30)
        origins, directions = camera_rays(found.pack(40, 30), x, y)
        starts, expected = (straight * 0.0, straight) if angle else camera_rays(other, x, y)
        differ += int(((directions != expected) | (origins != starts)).any(axis=1).sum())
    naive = _unit(10.0 * straight / -straight[:, 2:])
    return [Measured("rays that differ", int((naive != straight).any(axis=1).sum()), differ, 0.0)]


@hard_case(
    24, "IEEE 754: 0 * inf and inf - inf are no numbers", quick=20_000, thorough=2_000_000, scene="24_infinity.yaml"
)
def focus_at_infinity(rays: int) -> list[Measured]:
    """Rays through a lens of 50 mm that is focused at infinity.

    The point in focus is o + inf d: no number, for all rays.  Ours aims at d - shift / F, which is d.  And what is
    focused far away is nearly so: at F the directions differ by the lens's radius over F and some roundings.
    """
    x, y = _film(rays, 24)
    keys: dict[str, Any] = {"vfov": 40.0, "aperture": 50.0, **_LOOK}
    origins, directions = camera_rays(ThinLens(focus_distance=math.inf, **keys).pack(40, 30), x, y)
    _, straight = camera_rays(Pinhole(vfov=40.0, **_LOOK).pack(40, 30), x, y)
    wrong = (directions != straight).any(axis=1) | (np.hypot(origins[:, 0], origins[:, 1]) > 0.025 * (1.0 + 4.0 * _ULP))
    with np.errstate(invalid="ignore"):
        naive = np.isnan(_unit(math.inf * straight - origins)).any(axis=1)

    # Focused ever farther away, by the point in focus and by the product's form.
    off, naive_off = 0.0, 0.0
    for focus in (1e3, 1e9, 1e15, 1e30):
        found, towards = camera_rays(ThinLens(focus_distance=focus, **keys).pack(40, 30), x, y)
        point = np.asarray(focus * straight / -straight[:, 2:], np.float32)
        with np.errstate(over="ignore", invalid="ignore"):
            aimed = _unit(point - found.astype(np.float32)).astype(np.float64)
        expected = straight / -straight[:, 2:] - found / focus
        expected /= np.linalg.norm(expected, axis=1, keepdims=True)
        off = max(off, float(np.abs(towards - expected).max()))
        naive_off = max(naive_off, float(np.where(np.isnan(aimed), 2.0, np.abs(aimed - expected)).max()))
    return [
        Measured("rays that are no numbers, or not parallel", int(naive.sum()), int(wrong.sum()), 0.0),
        Measured("error of directions, focused 1e3 to 1e30 m away", naive_off, off, 16.0 * _ULP),
    ]


@hard_case(26, "Foote 1915, Bull. Bureau of Standards 12", quick=20_000, thorough=2_000_000, scene="26_half.yaml")
def the_fastest_lens(rays: int) -> list[Measured]:
    """Light of radiance 1 through f/0.5 in the middle of the film, as from an even disc of light in the lens's place.

    E = pi L / (1 + 4 N^2): half of what a half space of light brings.  By the law for small openings, pi L / (4 N^2),
    it would be all.  The mean of the rays' weights is off by 5 of its standard deviations in 6e-7 of all runs.
    """
    worst, naive, tolerance = 0.0, 0.0, 0.0
    keys: dict[str, Any] = {"focal_length": 50.0, "focus_distance": math.inf, "iso": 100.0, "shutter": 1.0, **_LOOK}
    for f_number in (0.5, 1.0):
        spec = ThinLens(f_number=f_number, pupil="flat", **keys)
        _, _, weights = weighted_rays(spec.pack(40, 30), np.full(rays, 20.0), 15.0)
        expected = math.pi / (1.0 + 4.0 * f_number * f_number)
        worst = max(worst, abs(weights.mean() / expected - 1.0))
        naive = max(naive, math.pi / (4.0 * f_number * f_number) / expected - 1.0)
        tolerance = max(tolerance, 5.0 * weights.std() / math.sqrt(rays) / expected)
    return [Measured("irradiance, relative error", naive, worst, tolerance)]


@hard_case(26, "Airy 1835; Kingslake 1983, ch. 7", quick=20_000, thorough=2_000_000, scene="26_thousand.yaml")
def the_smallest_opening(rays: int) -> list[Measured]:
    """A lens of 0.05 mm, f/1000, a kilometre from the world's origin, against the pinhole at half its focus distance.

    Its blur there is A (1 - z / F) = 0.025 mm, 0.005 pixels of 1200 x 800.  Numbers of float32 are 0.06 mm apart at a
    kilometre, so that a program that adds lens and camera in float32 blurs, or shifts, by more.  What it leaves out, an
    Airy disc of 1.34 mm, is said: diffraction is not simulated.
    """
    width, height, depth = 1200, 800, 5.0
    place = np.array([1000.3, 2.1, -700.7])
    keys: dict[str, Any] = {"look_from": tuple(place), "look_at": tuple(place - (0.0, 0.0, 10.0)), "focal_length": 50.0}
    spec = ThinLens(f_number=1000.0, focus_distance=10.0, **keys)
    top = spec.optics(width, height).top
    pinhole = Pinhole(vfov=math.degrees(2.0 * math.atan(top)), **{k: v for k, v in keys.items() if k != "focal_length"})
    x, y = _film(rays, 26, width, height)
    pixel = 2.0 * top / height * depth
    origins, directions = camera_rays(spec.pack(width, height), x, y)
    _, straight = camera_rays(pinhole.pack(width, height), x, y)
    expected = place + straight * (-depth / straight[:, 2:])
    found = origins + directions * (-depth / directions[:, 2:])

    start = (place + (origins - place)).astype(np.float32)
    point = (place + straight * (-10.0 / straight[:, 2:])).astype(np.float32)
    way = _unit(point - start)
    naive = start + way * ((place[2] - depth - start[:, 2:]) / way[:, 2:])
    off, naive_off = (float(np.linalg.norm((seen - expected)[:, :2], axis=1).max()) / pixel for seen in (found, naive))

    said = explain(build((SCENES / "26_thousand.yaml").read_text(encoding="utf-8"), "26_thousand.yaml")).warnings
    silent = not any("diffraction is left out" in sentence for sentence in said)
    return [
        Measured("shift in the picture (px)", naive_off, off, 0.01),
        Measured("limits that are not reported", 1.0, float(silent), 0.0),
    ]
