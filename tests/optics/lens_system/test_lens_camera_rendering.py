"""The lens camera: a thin piece of glass is a thin lens, and light on the film is what brute force finds."""

import math

import numpy as np
import pytest

from raytracer.scene.load import build
from raytracer.scene.pack.scene import pack
from tests.optics.lens_system.brute_force import by_brute_force
from tests.optics.lens_system.lens_files import thin
from tests.plugins.cameras.kernels import weighted_rays
from tests.repository import SCENES

DOUBLE_GAUSS = SCENES / "lenses" / "double-gauss-50mm.yaml"

LOOK = "look_from: [0, 0, 0], look_at: [0, 0, -1]"

# At each place of the picture one, at several depths, so that it shows what is sharp and what is not: corner, edges
# (m), edge of its squares (m) and their radiances.
BOARDS = (
    ((-0.04, -0.04, -0.8), (0.036, 0.07), 0.008, (0.1, 1.0)),
    ((0.004, -0.08, -1.5), (0.05, 0.07), 0.01, (0.9, 0.1)),
    ((0.0, 0.0, -4.0), (0.3, 0.2), 0.04, (0.2, 0.5)),
)

SKY = """
environment: {type: constant, radiance: 1}
objects: [{type: sphere, center: [0, 0, 900], radius: 1, material: {type: lambertian, albedo: 0}}]
"""


def seen(origins, ways):
    """The radiance that rays (n, 3) bring from the boards, and from a sky of 0.2 beside them."""
    light = np.full(len(ways), 0.2)
    for (left, bottom, depth), edges, size, colors in BOARDS[::-1]:
        places = (origins + ways * ((depth - origins[:, 2:]) / ways[:, 2:]))[:, :2]
        within = (places - (left, bottom)) / edges
        odd = np.floor(places / size).sum(axis=1) % 2.0
        light = np.where(((within >= 0.0) & (within < 1.0)).all(axis=1), np.choose(odd.astype(int), colors), light)
    return light


def taken(camera, width, height, spp, seed):
    """The mean of each pixel's samples of the boards, and its variance (height, width)."""
    rows, columns = np.mgrid[:height, :width]
    down, across = np.random.default_rng(seed).random((2, spp, height, width)) + np.stack([rows, columns])[:, None]
    packed = packed_camera(camera, width, height)
    origins, ways, weights = weighted_rays(packed, across.ravel(), down.ravel(), seed=seed)
    samples = (weights * seen(origins, ways)).reshape(spp, height, width)
    return samples.mean(axis=0), samples.var(axis=0) / spp


def packed_camera(camera, width, height):
    text = f"camera: {{{LOOK}, {camera}}}\nfilm: {{width: {width}, height: {height}}}\n{SKY}"
    return pack(build(text, "test.yaml", allow_files="/")).scene.camera


@pytest.mark.parametrize("focus", ["1.5", ".inf"])
def test_a_thin_piece_of_glass_is_a_thin_lens(tmp_path, focus):
    """f/16 and 3 degrees: the glass's own errors are far below a pixel of 0.05 mm, and what is out of focus is not.

    Spherical aberration of equiconvex glass is 1.67 h^2 / f along the axis (Kingslake, Johnson 2010, sec. 6.3), 0.0025
    mm across it with h = 1.6 mm, and coma and astigmatism at 1.2 mm from the axis are less.
    """
    path = thin(tmp_path, 50.0, 8.0)
    film = f"sensor: {{width: 2.4, height: 1.6}}, f_number: 16, focus_distance: {focus}"
    real, spread = taken(f"type: lens, lens: '{path}', {film}", 48, 32, 256, seed=1)
    ideal, ideal_spread = taken(f"type: thin_lens, focal_length: 50, {film}", 48, 32, 256, seed=2)
    # Some rays in a hundred miss the pupil, which the bounds that they are drawn from are larger than: a pixel may have
    # none of these, and a variance of 0.
    missing = 0.006 * ideal**2 / 256.0
    difference, variance = real - ideal, np.maximum(spread, missing) + ideal_spread
    noisy = variance > 4.0 * missing
    assert 0.1 < noisy.mean() < 0.9
    z = difference[noisy] / np.sqrt(variance[noisy])
    # Of unit normal numbers, whose mean square is 1 +- sqrt(2 / n).
    assert (z**2).mean() == pytest.approx(1.0, abs=6.0 * math.sqrt(2.0 / len(z)) + 0.05)
    assert abs(z.mean()) < 6.0 / math.sqrt(len(z)) + 0.05
    # What is uniform is so, with that noise at most.
    rest = difference[~noisy] / np.sqrt(variance[~noisy])
    assert (rest**2).mean() < 1.3
    assert abs(rest.mean()) < 0.1


@pytest.mark.parametrize("f_number", [8.0, 16.0])
def test_exposure_of_thin_glass_is_that_of_the_thin_lens(tmp_path, f_number):
    """E = pi L / (4 N^2 (1 + m)^2) on the axis; close focus at 0.5 m: (1 + m)^2 = 1.2346."""
    path = thin(tmp_path, 50.0, 8.0)
    exposed = f"sensor: full_frame, f_number: {f_number}, iso: 100, shutter: 1/100 s"
    light = {}
    for focus in (".inf", "0.5"):
        for kind, name in (("lens", f"lens: '{path}'"), ("thin_lens", "focal_length: 50")):
            camera = packed_camera(f"type: {kind}, {name}, {exposed}, focus_distance: {focus}", 36, 24)
            weights = weighted_rays(camera, np.full(20000, 18.0), 12.0)[2]
            assert weights.std() < 0.1 * weights.mean()
            light[kind, focus] = weights.mean()
    assert light["lens", ".inf"] == pytest.approx(math.pi / (4.0 * f_number**2), rel=0.003)
    for focus in (".inf", "0.5"):
        assert light["lens", focus] == pytest.approx(light["thin_lens", focus], rel=0.003)
    assert light["lens", ".inf"] / light["lens", "0.5"] == pytest.approx(1.2346, rel=0.003)


@pytest.mark.parametrize("f_number", [2.0, 2.8, 4.0, 8.0, 22.0])
def test_exposure_on_the_axis_is_that_of_the_f_number(f_number):
    """E = pi L / (4 N^2) with focus at infinity: a lens corrected for coma obeys Abbe's sine condition."""
    camera = f"type: lens, lens: '{DOUBLE_GAUSS}', f_number: {f_number}, focus_distance: .inf, dispersion: false"
    # Without an exposure the middle of the picture is as bright as what it shows.
    for exposed, expected in ((", iso: 100, shutter: 1/100 s", math.pi / (4.0 * f_number**2)), ("", 1.0)):
        weights = weighted_rays(packed_camera(camera + exposed, 36, 24), np.full(20000, 18.0), 12.0)[2]
        assert weights.mean() == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize(("f_number", "focus"), [(2.0, ".inf"), (2.0, "0.6"), (4.0, "3"), (16.0, ".inf")])
def test_relative_illumination_is_that_of_brute_force(f_number, focus):
    exposed = f"f_number: {f_number}, iso: 100, shutter: 1/100 s, focus_distance: {focus}, dispersion: false"
    camera = packed_camera(f"type: lens, lens: '{DOUBLE_GAUSS}', {exposed}", 3600, 2400)
    places, count = np.linspace(0.0, 21.4, 10), 20000
    expected = by_brute_force(camera, places)
    # Along a diagonal of the film.
    pixels = places / camera.film.pixel
    x, y = 1800.0 + pixels * 0.83, 1200.0 - pixels * math.sqrt(1.0 - 0.83**2)
    weights = weighted_rays(camera, np.repeat(x, count), np.repeat(y, count))[2].reshape(len(places), count)
    found, noise = weights.mean(axis=1), weights.std(axis=1) / math.sqrt(count)
    # The grid's own error is of the rim's cells: 500 across 1.5 of the rear, so some 1e-3 at most of a small pupil.
    tolerance = 5.0 * noise + expected * 3e-3 * max(1.0, f_number / 4.0)
    assert (np.abs(found - expected) < tolerance).all(), (found / expected, noise / expected)
    # A good lens vignettes at f/2, and hardly at f/16 beyond cos^4.
    relative = expected / expected[0]
    assert relative[-1] < (0.4 if f_number == 2.0 else 0.8)
