"""Circles of confusion and depth of field, measured on pictures of a spot of light.

How well: of n samples that meet the spot, a disc's mean square radius R^2 / 2 is known to R^2 / sqrt(12 n), so its
diameter to 0.29 / sqrt(n) of itself.  These spots have a radius of 4 pixels and 256 samples in each: n = 13 000, and a
standard deviation of 0.25 %, of which 1 % is four.  That is for independent numbers; Sobol's are ten times as good.
"""

import math

import numpy as np
import pytest

from raytracer.optics.thin_lens import circle_of_confusion, far_limit, hyperfocal, near_limit
from tests.camera_truths.measure import blur_px, moments, pixels, spot

PIXELS, SPP = 40, 256
WANTED_PX, SPOT_PX = 22.0, 4.0


def picture_of(camera, image_mm, depth, sensor_mm, *, x=0.0, y=0.0, spp=SPP):
    """A spot at a depth (m), on a sensor of this width and height, of `PIXELS` x `PIXELS`.

    image_mm : distance of the film from the lens, which says how large a spot of `SPOT_PX` pixels is.
    x, y : where on the film the spot is (px), to the right and up from its middle.
    """
    pixel = sensor_mm / PIXELS / image_mm * depth
    return pixels(
        f"{camera}, sensor: {{width: {sensor_mm!r}, height: {sensor_mm!r}}}",
        spot(x * pixel, y * pixel, depth, SPOT_PX * pixel),
        width=PIXELS,
        height=PIXELS,
        spp=spp,
    )


def blur_mm(camera, image_mm, depth, sensor_mm, *, x=0.0, y=0.0):
    """Diameter (mm) of the blur of a point there, measured as `picture_of` shows it."""
    picture = picture_of(camera, image_mm, depth, sensor_mm, x=x, y=y)
    found = moments(picture)
    # All of the spot's light is there, known to 1 / sqrt(n), and where a pinhole sees it, known to R / 2 sqrt(n).
    assert found.total == pytest.approx(math.pi * SPOT_PX**2, rel=0.04)
    assert math.hypot(found.x - PIXELS / 2 - x, found.y - PIXELS / 2 + y) < 0.2
    # The blur is round: along each axis the variance is known to 1 / sqrt(n) of itself.
    assert found.variance_x == pytest.approx(found.variance_y, rel=0.04)
    return blur_px(picture, SPOT_PX) * sensor_mm / PIXELS


# ---- Circle of confusion


@pytest.mark.parametrize("focal", [50.0, 85.0])
@pytest.mark.parametrize("f_number", [1.4, 4.0, 16.0])
def test_the_circle_of_confusion_is_as_its_formula_says(focal, f_number):
    """Camera truths: c = (f / N) |s - F| / s * f / (F - f), here focused at 2 m."""
    focus = 2.0
    camera = f"type: thin_lens, focal_length: {focal}, f_number: {f_number}, focus_distance: {focus}"
    image = 1.0 / (1.0 / focal - 1e-3 / focus)
    for depth in (0.8, 1.3, 2.5, 4.0, 50.0):
        expected = focal / f_number * abs(depth - focus) / depth * focal / (1e3 * focus - focal)
        assert blur_mm(camera, image, depth, expected * PIXELS / WANTED_PX) == pytest.approx(expected, rel=0.01), depth
        assert circle_of_confusion(focal / f_number, image, 1e3 * focus, 1e3 * depth) == pytest.approx(expected)


def test_the_circle_of_confusion_of_the_worked_number():
    # 50 mm f/1.4 focused at 2 m, a point at 4 m: 0.45788 mm; in the middle of the film and far from it.
    camera = "type: thin_lens, focal_length: 50 mm, f_number: 1.4, focus_distance: 2"
    image = 2000.0 / 39.0
    assert blur_mm(camera, image, 4.0, 0.9) == pytest.approx(0.45788, rel=0.01)
    # On the film of a camera, 36 mm in 2000 pixels, it is 25.4 of them, at the top right corner too.
    pitch = 0.018
    for x, y in ((0.0, 0.0), (940.0, 600.0)):
        pixel = pitch / image * 4.0
        left, top = 1000 + round(x) - 20, 663 - round(y) - 20
        picture = pixels(
            f"{camera}, sensor: full_frame",
            spot(x * pixel, y * pixel, 4.0, SPOT_PX * pixel),
            width=2000,
            height=1326,
            spp=SPP,
            crop=(left, top, left + 40, top + 40),
        )
        assert blur_px(picture, SPOT_PX) * pitch == pytest.approx(0.45788, rel=0.01)


def test_the_circle_of_confusion_is_an_evenly_lit_disc():
    """Its diameter from the area, total over peak, and from the edge.

    The middle of the blur, within 5 pixels, holds 79 pixels * 1024 samples * (4 / 11)^2 / (pi / pi) = 10 700 samples
    that meet the spot, so the peak is known to 1 %, and the diameter to 0.5 %; 2 % is four times that.
    """
    camera = "type: thin_lens, focal_length: 50 mm, f_number: 1.4, focus_distance: 2"
    circle = 0.45788
    picture = picture_of(camera, 2000.0 / 39.0, 4.0, circle * PIXELS / WANTED_PX, spp=1024)
    rows, columns = np.mgrid[0:PIXELS, 0:PIXELS] + 0.5 - PIXELS / 2
    distance = np.hypot(rows, columns)
    peak = picture[distance <= 5.0].mean()
    assert math.sqrt(4.0 * picture.sum() / (math.pi * peak)) == pytest.approx(WANTED_PX, rel=0.02)
    # It is as bright all over, but for what the spot's own radius and a pixel's half diagonal smear at the edge.
    flat, smeared = (WANTED_PX / 2 - SPOT_PX - 0.71, WANTED_PX / 2 + SPOT_PX + 0.71)
    ring = picture[(distance > 5.0) & (distance < flat)].mean()
    assert ring == pytest.approx(peak, rel=0.06)
    assert not picture[distance > smeared].any()
    assert picture[(distance > smeared - 2.5) & (distance < smeared - 1.5)].any()


@pytest.mark.parametrize(("depth", "expected"), [(5.0, 20.044), (20.0, 10.022)])
def test_the_blur_of_a_defocus_angle(depth, expected):
    # Camera truths: F = 10, delta = 0.6 deg, vfov 20 deg, 675 rows.
    pixel = 2.0 * math.tan(math.radians(10.0)) / 675.0 * depth
    picture = pixels(
        "type: thin_lens, vfov: 20, focus_distance: 10, defocus_angle: 0.6 deg",
        spot(0.5 * pixel, -0.5 * pixel, depth, SPOT_PX * pixel),
        width=1200,
        height=675,
        spp=SPP,
        crop=(582, 319, 620, 357),
    )
    assert blur_px(picture, SPOT_PX) == pytest.approx(expected, rel=0.01)


def test_the_circle_of_confusion_with_focus_at_infinity():
    # c = A f / s: what is left of A z_i |1/F - 1/s|.
    camera = "type: thin_lens, focal_length: 100 mm, f_number: 2, focus_distance: .inf"
    for depth in (3.0, 30.0):
        expected = 50.0 * 100.0 / (1e3 * depth)
        assert blur_mm(camera, 100.0, depth, expected * PIXELS / WANTED_PX) == pytest.approx(expected, rel=0.01)


# ---- Depth of field


@pytest.mark.parametrize(
    ("focal", "f_number", "circle", "focus", "near", "far"),
    [
        (50.0, 2.8, 0.03, 3.0, 2.7295, 3.3301),
        (85.0, 4.0, 0.029, 2.0, 1.9403, 2.0634),
        (28.0, 11.0, 0.03, 2.5, 1.2252, math.inf),
    ],
)
def test_at_the_limits_of_the_depth_of_field_the_blur_is_the_circle_of_confusion(
    focal, f_number, circle, focus, near, far
):
    camera = f"type: thin_lens, focal_length: {focal}, f_number: {f_number}, focus_distance: {focus}"
    image = 1.0 / (1.0 / focal - 1e-3 / focus)
    f, c = 1e-3 * focal, 1e-3 * circle
    assert near_limit(f, f_number, c, focus) == pytest.approx(near, abs=5e-5)
    assert far_limit(f, f_number, c, focus) == pytest.approx(far, abs=5e-5)
    assert blur_mm(camera, image, near, circle * PIXELS / WANTED_PX) == pytest.approx(circle, rel=0.01)
    at_far = blur_mm(camera, image, min(far, 1e6), circle * PIXELS / WANTED_PX)
    if math.isinf(far):
        # Nothing beyond is blurred by more, however far.
        assert 0.5 * circle < at_far < circle
    else:
        assert at_far == pytest.approx(circle, rel=0.01)


def test_focused_at_the_hyperfocal_distance_infinity_is_just_sharp():
    # To H = f^2 / (N c) + f belongs the blur of infinity c = A f / (H - f), and the near limit H / 2.
    focal, f_number, circle = 35.0, 8.0, 0.03
    distance = hyperfocal(1e-3 * focal, f_number, 1e-3 * circle)
    camera = f"type: thin_lens, focal_length: {focal}, f_number: {f_number}, focus_distance: {distance!r}"
    image = 1.0 / (1.0 / focal - 1e-3 / distance)
    for depth in (1e6, 0.5 * distance):
        assert blur_mm(camera, image, depth, circle * PIXELS / WANTED_PX) == pytest.approx(circle, rel=0.01)


# ---- Pinholes of a real size


@pytest.mark.parametrize("diameter", [0.35, 2.0, 6.0])
def test_a_hole_blurs_by_its_own_size(diameter):
    """The light of a point goes on as a cone: on film, at the distance f from the hole, it is d (1 + f / z) wide."""
    focal = 150.0
    for depth in (0.3, 2.0, 1e5):
        expected = diameter * (1.0 + 1e-3 * focal / depth)
        camera = f"type: pinhole, focal_length: {focal}, diameter: {diameter}"
        found = blur_mm(camera, focal, depth, expected * PIXELS / WANTED_PX)
        assert found == pytest.approx(expected, rel=0.01), depth
