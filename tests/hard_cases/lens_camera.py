"""Real lenses as cameras: what holds of rays through glass holds of pictures through it."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.optics.lens_system.first_order import cardinal_points
from raytracer.scene.assets.lenses import read_lens
from raytracer.scene.load import build
from raytracer.scene.pack.scene import pack
from raytracer.util.errors import SceneError
from tests.hard_cases.harness import Measured, hard_case
from tests.hard_cases.lens_glass import _film_by_search, _on_film, _walk
from tests.optics.lens_system.brute_force import by_brute_force
from tests.plugins.cameras.kernels import weighted_rays
from tests.repository import SCENES

Array = NDArray[Any]

LENSES = SCENES / "lenses"

_ULP = 2.0**-53

_SCENE = """
camera: {{type: lens, lens: '{lens}', look_from: [0, 0, 0], look_at: [0, 0, -1], sensor: full_frame, {keys}}}
film: {{width: 360, height: 240}}
objects: [{{type: sphere, center: [0, 0, -9], radius: 1}}]
"""


def _camera(lens: str, keys: str) -> Any:
    """The packed camera with a shipped lens, looking along -z from the origin."""
    return pack(build(_SCENE.format(lens=LENSES / f"{lens}.yaml", keys=keys), "case.yaml")).scene.camera


@hard_case(17, "mitsuba3 issue 219", quick=2000, thorough=200_000)
def rays_of_the_lens_camera_without_an_offset(rays: int) -> list[Measured]:
    """Rays that the lens camera sends through a 50 mm lens, followed back to where they came from on the film.

    Their way back through the glass is that of longer numbers.  Each of the 11 surfaces adds some 16 roundings of
    lengths of up to 68 mm on the way out, and the way through the frame of the scene, in metres and back, 8 more.  By
    an offset of 1500 ulp of float32 they end where no film point is.
    """
    camera = _camera("double-gauss-50mm", "f_number: 4, focus_distance: 2, dispersion: false")
    rng = np.random.default_rng(17)
    x, y = rng.uniform(60.0, 300.0, rays), rng.uniform(40.0, 200.0, rays)
    origins, directions, weights = weighted_rays(camera, x, y)
    passed = weights > 0.0
    assert passed.mean() > 0.5
    lens = read_lens(LENSES / "double-gauss-50mm.yaml")
    rows = [
        (1.0 / element.curvature if element.curvature else 0.0, element.thickness, float(element.glass.ior()), 0.0)
        for element in lens.elements
    ]
    # The scene's frame has x to the right and z towards the viewer; the lens's film is upside down in neither.
    frame = camera.frame
    axes = np.array([frame.right, frame.up, np.negative(frame.forward)])
    starts = 1e3 * (origins[passed] - frame.origin) @ axes.T
    starts[:, 2] += float(camera.pupil)
    ways = -directions[passed] @ axes.T
    starts -= 5.0 * ways
    film = float(camera.film.z)
    there = _on_film(*_walk(rows, starts, ways, np.longdouble), film)
    naive = _on_film(*_walk(rows, starts, ways, np.float64, 1500.0 * 2.0**-24), film)
    expected = np.stack([-(x[passed] - 180.0), y[passed] - 120.0], axis=1) * camera.film.pixel
    errors = [float(np.hypot(*(found - expected).T).max()) for found in (naive, there)]
    return [Measured("error on the film (mm)", *errors, (16.0 * len(rows) + 8.0) * film * _ULP)]


@hard_case(32, "pbrt-v4 cameras.cpp (a radius of 0 is the stop)")
def a_lens_camera_with_flat_glass(trials: int) -> list[Measured]:
    """Where the lens camera's film is behind a plano-convex lens whose flat side is first, focused at infinity.

    Light through the zone of the pupil that halves its area is in focus: back focus(h) of camera truths, at f/10 with
    h = 5 mm sqrt(1/2).  With the flat side taken for the stop there is one surface in air alone, and a focus of R.
    """
    lens = read_lens(LENSES / "plano-convex-100mm.yaml")
    camera = _camera("plano-convex-100mm", "f_number: 10, focus_distance: .inf, dispersion: false")
    (round_side,) = [element for element in lens.elements if element.curvature != 0.0]
    radius, n = abs(1.0 / round_side.curvature), max(float(element.glass.ior()) for element in lens.elements)
    height = math.sqrt(0.5) * radius / (n - 1.0) / 20.0
    bent = math.asin(n * height / radius) - math.asin(height / radius)
    expected = height / math.tan(bent) - (radius - math.sqrt(radius**2 - height**2))
    found = float(camera.film.z - camera.surfaces.vertex[-1])
    # Not even that: what is left of the lens is a surface between air and air.
    return [Measured("error of the film's place (mm)", abs(radius - expected), abs(found - expected), 1e-3 * height)]


@hard_case(33, "Snell's law; Kolb, Mitchell, Hanrahan 1995, SIGGRAPH", quick=500, thorough=20_000)
def no_picture_of_what_is_totally_reflected(rays: int) -> list[Measured]:
    """All shipped lenses, wide open, from all of the film and beyond: every ray is of numbers, or weighs 0.

    By the square root of what is negative, a naive program's rays are no numbers where they are totally reflected, or
    miss a surface.
    """
    wrong, naive = 0, 0
    rng = np.random.default_rng(33)
    x, y = rng.uniform(-180.0, 540.0, rays), rng.uniform(-120.0, 360.0, rays)
    for path in sorted(LENSES.glob("*.yaml")):
        camera = _camera(path.stem, "focus_distance: .inf, dispersion: false")
        origins, directions, weights = weighted_rays(camera, x, y)
        lost = weights == 0.0
        finite = np.isfinite(np.concatenate([origins, directions], axis=1)).all(axis=1)
        unit = np.abs(np.linalg.norm(directions, axis=1) - 1.0) < 1e-12
        wrong += int((~(weights >= 0.0) | ~(lost | (finite & unit))).sum())
        naive += int(lost.sum())
    return [Measured("rays that are wrong, or no numbers", naive, wrong, 0.0)]


@hard_case(34, "pbrt-v3 pull requests 122 and 123", quick=4, thorough=1)
def the_lens_camera_is_focused_or_refuses(step: int) -> list[Measured]:
    """All shipped lenses as cameras, by distances down to 10 mm and stops down to f/64.

    A quick run takes one of `step` of them.
    What cannot be is one sentence that names the nearest distance; nothing hangs.
    """
    stuck, wrong = 0, 0
    for path in sorted(LENSES.glob("*.yaml"))[::step]:
        for f_number in (16.0, 64.0):
            for distance in (".inf", "10", "1", "0.1", "0.01"):
                keys = f"f_number: {f_number}, focus_distance: {distance}"
                try:
                    film = float(_camera(path.stem, keys + ", dispersion: false").film.z)
                    wrong += not math.isfinite(film)
                except SceneError as error:
                    wrong += "nearest" not in str(error)
        lens = read_lens(path)
        if not lens.is_round():
            continue
        points = cardinal_points(lens.packed())
        # A search that moves the film from where a lens of this focal length has it.
        if abs(points.focal_length) < 200.0:
            stuck += _film_by_search(lens.packed(stop_radius=1e-2 * _widest(lens)), 0.3 * points.focal_length) is None
    return [Measured("requests that are neither met nor refused", stuck, wrong, 0.0)]


def _widest(lens: Any) -> float:
    return float(lens.elements[lens.stop()].radius)


@hard_case(34, "pbrt-v3 issue 162", quick=4000, thorough=200_000)
def the_pupil_of_the_double_gauss_without_rings(rays: int) -> list[Measured]:
    """How bright the film of the double Gauss is at f/2, at 96 distances from its middle, against brute force.

    A program that draws from bounds of 16 bins of the radius without weighing by their areas has steps between them.
    Each of our means is off by 5 of its standard deviations in 5e-5 of all runs; that of the brute force, a grid of
    600 x 600 points, by 1e-3 of it.
    """
    camera = _camera("double-gauss-50mm", "f_number: 2, focus_distance: .inf, iso: 100, shutter: 1, dispersion: false")
    places = np.linspace(0.0, 21.0, 96)
    expected = by_brute_force(camera, places, 600)
    pixels = places / camera.film.pixel
    x, y = 180.0 + pixels * 0.83, 120.0 + pixels * math.sqrt(1.0 - 0.83**2)
    weights = weighted_rays(camera, np.repeat(x, rays), np.repeat(y, rays))[2].reshape(len(places), rays)
    means, sigma = weights.mean(axis=1), weights.std(axis=1) / math.sqrt(rays)
    spread = np.hypot(sigma, 1e-3 * expected)
    # Every bin's bounds are as large as the pupil is at its inner edge, and as full as it is elsewhere.
    inner = np.floor(places / 21.0 * 16.0) / 16.0 * 21.0
    unweighted = expected * expected[0] / np.interp(inner, places, expected)
    ours, naive = (float(np.abs((found - expected) / spread).max()) for found in (means, unweighted))
    return [Measured("brightness of the film, in sigma", naive, ours, 5.0)]
