"""Blurs behind real glass, measured on pictures of a spot of light and by rays, against formulas for the glass.

Of a point at infinity, light meets the front of a lens evenly.  So of a singlet whose back focus is known by its
height, the blur on a film is a disc with the mean square radius (2 / H^2) int TA(h)^2 h dh: TA(h) is how far from the
axis the light of the height h meets the film, and H the largest height.  `measure.blur_px` gives what an even disc of
that moment would be wide.
"""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from raytracer.optics.thin_lens import circle_of_confusion
from raytracer.scene.load import build
from raytracer.scene.pack.scene import pack
from tests.camera_truths.measure import LOOK, blur_px, moments, pixels, spot
from tests.optics.lens_system.lens_files import INDEX, PLANO_CONVEX, ROUND_SIDE, thin, written
from tests.repository import SCENES

PIXELS = 39
SPP = 256
FAR = 1e4
"""Distance (m) of what counts as infinitely far: of f = 100 mm its image is 1e-3 mm behind that of infinity."""


def film_behind(camera):
    """Return the distance of the film behind the last vertex (mm)."""
    text = f"camera: {{{LOOK}, {camera}}}\nfilm: {{width: {PIXELS}, height: {PIXELS}}}\n{spot(0, 0, 5, 1)}"
    packed = pack(build(text, "test.yaml", allow_files="/")).scene.camera
    return float(packed.film.z - packed.surfaces.vertex[-1])


# ---- The plano-convex singlet


def _crossing(h):
    """Compute the crossing of light at the height h with the axis, behind the vertex of the round side (mm)."""
    bent = math.asin(INDEX * h / ROUND_SIDE) - math.asin(h / ROUND_SIDE)
    return h / math.tan(bent) - (ROUND_SIDE - math.sqrt(ROUND_SIDE**2 - h * h))


def _aside(h, film):
    """Compute the distance from the axis at which light of the height h meets a film (mm)."""
    bent = math.asin(INDEX * h / ROUND_SIDE) - math.asin(h / ROUND_SIDE)
    return abs((_crossing(h) - film) * math.tan(bent))


def _width(top, film):
    """Diameter (mm) of the even disc with the moment of the blur."""
    square, _ = quad(lambda h: 2.0 / top**2 * _aside(h, film) ** 2 * h, 0.0, top)
    return math.sqrt(8.0 * square)


@pytest.mark.parametrize("f_number", [4.5, 7.0])
@pytest.mark.parametrize("focus", ["marginal", "rms"])
def test_the_blur_of_the_plano_convex_singlet(tmp_path, f_number, focus):
    """At f/5 light is up to 10 mm from the axis, and crosses it from 95.418 to 100 mm behind the lens."""
    path = written(tmp_path, PLANO_CONVEX)
    keys = f"type: lens, lens: '{path}', f_number: {f_number}, focus_distance: .inf, focus: {focus}"
    top = 100.0 / (2.0 * f_number)
    film = film_behind(f"{keys}, sensor: {{width: 1, height: 1}}")
    assert _crossing(top) < film < _crossing(0.01)
    expected = _width(top, film)
    # The film is as wide as the widest light, and a quarter more.
    widest = 2.0 * max(_aside(h, film) for h in np.linspace(0.01, top, 200).tolist())
    side = 1.25 * widest
    pitch = side / PIXELS
    # What shines is seen as 1.5 pixels wide.
    shining = 0.75 * pitch / 100.0 * FAR
    camera = f"{keys}, sensor: {{width: {side!r}, height: {side!r}}}"
    picture = pixels(camera, spot(0.0, 0.0, FAR, shining), width=PIXELS, height=PIXELS, spp=16 * SPP)
    assert blur_px(picture, 0.75) * pitch == pytest.approx(expected, rel=0.02)
    # And its edge: nothing beyond the widest light, and something just within it.
    rows, columns = np.mgrid[0:PIXELS, 0:PIXELS] + 0.5 - PIXELS / 2
    distance = np.hypot(rows, columns) * pitch
    assert picture[distance > 0.5 * widest + 1.6 * pitch].sum() == 0.0
    assert picture[(distance > 0.5 * widest - 2.0 * pitch) & (distance < 0.5 * widest)].sum() > 0.0


def test_the_best_focus_by_rms_is_sharper_than_the_marginal_one(tmp_path):
    path = written(tmp_path, PLANO_CONVEX)
    films = {
        focus: film_behind(
            f"type: lens, lens: '{path}', f_number: 5, focus_distance: .inf, focus: {focus}, sensor: full_frame"
        )
        for focus in ("marginal", "rms")
    }
    assert _width(10.0, films["rms"]) <= _width(10.0, films["marginal"])
    for moved in (-0.1, 0.1):
        assert _width(10.0, films["rms"]) < _width(10.0, films["rms"] + moved)


# ---- Pictures


@pytest.mark.parametrize(("distance", "f_number"), [(0.3, 16.0), (0.6, 22.0)])
def test_the_circle_of_confusion_behind_thin_glass(tmp_path, distance, f_number):
    """On the axis there is spherical aberration alone, of 1.67 h^2 / f along it: less than 1 % of this blur."""
    path = thin(tmp_path, 50.0, 20.0)
    image = 1.0 / (1.0 / 50.0 - 1e-3 / 10.0)
    expected = circle_of_confusion(50.0 / f_number, image, 1e4, 1e3 * distance)
    side = 1.5 * expected
    pitch = side / PIXELS
    shining = 2.0 * pitch / image * distance
    camera = (
        f"type: lens, lens: '{path}', f_number: {f_number}, focus_distance: 10, "
        f"sensor: {{width: {side!r}, height: {side!r}}}"
    )
    picture = pixels(camera, spot(0.0, 0.0, distance, shining), width=PIXELS, height=PIXELS, spp=4 * SPP)
    assert blur_px(picture, 2.0) * pitch == pytest.approx(expected, rel=0.02)


def _double_gauss(more):
    return f"type: lens, lens: '{SCENES / 'lenses' / 'double-gauss-50mm.yaml'}', dispersion: false, {more}"


@pytest.mark.parametrize(("f_number", "distance"), [(2.8, 4.0), (8.0, 1.0), (8.0, 30.0)])
def test_the_circle_of_confusion_behind_the_double_gauss(f_number, distance):
    """A corrected lens blurs as the thin lens does, which its entrance pupil and its focal length make.

    c = A m |s - F| / s, with A = f / N, the distances from the entrance pupil, and the magnification m of the plane of
    focus: by the spot's own image in focus.  The lens's aberrations are some hundredths of a millimetre.
    """
    focus = 2.0
    pitch = 0.02
    side = PIXELS * pitch
    sensor = f"sensor: {{width: {side!r}, height: {side!r}}}, focus_distance: {focus}, f_number: {f_number}"
    sharp = pixels(_double_gauss(sensor), spot(0.0, 0.0, focus, 0.005), width=PIXELS, height=PIXELS, spp=SPP)
    found = moments(sharp)
    own = math.sqrt(2.0 * (found.variance_x + found.variance_y - 1.0 / 6.0)) * pitch
    m = own / 5.0
    assert m == pytest.approx(50.0 / 1950.0, rel=0.05)
    length = _focal_length()
    expected = length / f_number * m * abs(distance - focus) / distance
    side = 1.5 * expected
    pitch = side / PIXELS
    shining = 2.0 * pitch / m * distance / focus * 1e-3
    picture = pixels(
        _double_gauss(f"sensor: {{width: {side!r}, height: {side!r}}}, focus_distance: {focus}, f_number: {f_number}"),
        spot(0.0, 0.0, distance, shining),
        width=PIXELS,
        height=PIXELS,
        spp=4 * SPP,
    )
    assert blur_px(picture, 2.0) * pitch == pytest.approx(expected, rel=0.02)


def _focal_length():
    from raytracer.optics.lens_system.first_order import cardinal_points
    from raytracer.scene.assets.lenses import read_lens

    return cardinal_points(read_lens(SCENES / "lenses" / "double-gauss-50mm.yaml").packed()).focal_length
