"""Fields of view: where points of known places are seen, by the projection of the packed camera and on pictures.

On pictures, a spot of the radius a = 1.5 pixels is known by its n samples to sqrt(a^2 / 4 + 1 / 12) / sqrt(n): with 256
samples in each of its 7 pixels, n = 1800, to 0.02 pixels along each axis; 0.1 is five times that.
"""

import math

import numpy as np
import pytest

from raytracer.optics.sensor_formats import SENSORS
from raytracer.scene.load import build
from tests.camera_truths.measure import LOOK, moments, pixels, spot
from tests.plugins.cameras.kernels import projected

LECTURE = (17.0, 24.0, 28.0, 35.0, 50.0, 85.0, 100.0, 135.0, 200.0)
"""Focal lengths (mm) of the lecture on cameras."""

WIDTH, HEIGHT = 1200, 800
SPOT_PX, SPP, MARGIN = 1.5, 256, 8


# Of the type of many scenes: by a pinhole, and two segments long.
SHARED = {"lit": True, "filled": True, "max_depth": 2}


def seen_at(camera, x, y, depth, radius, near):
    """Find the image of a spot (m), in px from the top left, within `MARGIN` pixels around a place."""
    left, top = math.floor(near[0]) - MARGIN, math.floor(near[1]) - MARGIN
    window = (left, top, left + 2 * MARGIN + 1, top + 2 * MARGIN + 1)
    shared = SHARED if "pinhole" in camera else {}
    shining = spot(x, y, depth, radius)
    found = moments(pixels(camera, shining, width=WIDTH, height=HEIGHT, spp=SPP, crop=window, **shared))
    # All of it, which it would not be if its middle were more than 6 pixels off.
    assert found.total == pytest.approx(math.pi * SPOT_PX**2, rel=0.2)
    return found.x + left, found.y + top


def check(camera, width_mm, height_mm, image_mm, depth=10.0, *, pictures=False):
    """Assert where points are seen by a camera whose film is so large, and so far behind the lens.

    Near the right, the bottom left, and the top edge of the picture; the place on the film is to the distance behind
    the lens as that in space to the depth, by similar triangles.
    """
    text = f"camera: {{{LOOK}, {camera}}}\nfilm: {{width: {WIDTH}, height: {HEIGHT}}}\n"
    packed = build(text, "test.yaml").camera.pack(WIDTH, HEIGHT)
    for right, up in ((0.96, 0.02), (-0.96, -0.95), (0.0, 0.96)):
        x, y = right * 0.5 * width_mm / image_mm * depth, up * 0.5 * height_mm / image_mm * depth
        expected = (0.5 * WIDTH * (1.0 + right), 0.5 * HEIGHT * (1.0 - up))
        np.testing.assert_allclose(projected(packed, (x, y, -depth))[0], (*expected, depth), rtol=1e-9, atol=1e-6)
        if pictures:
            radius = SPOT_PX * width_mm / WIDTH / image_mm * depth
            assert seen_at(camera, x, y, depth, radius, expected) == pytest.approx(expected, abs=0.1), (right, up)


@pytest.mark.parametrize("sensor", SENSORS)
def test_focal_length_and_sensor_are_the_field_of_view(sensor):
    """2 atan(w / 2 f), for every lecture focal length; of a sensor that is not 3:2, the largest part that is."""
    width, height = SENSORS[sensor]
    width, height = min(width, 1.5 * height), min(height, width / 1.5)
    for focal in LECTURE:
        camera = f"type: pinhole, sensor: {sensor}, focal_length: {focal} mm"
        check(camera, width, height, focal, pictures=focal == 17.0 and sensor in ("full_frame", "1-inch"))


@pytest.mark.parametrize(("focal", "diagonal"), [(17.0, 103.68), (50.0, 46.79), (200.0, 12.35)])
def test_the_corners_are_as_far_apart_as_the_diagonal_angle(focal, diagonal):
    # Camera truths, on 36 x 24 mm: of the film's diagonal, 43.27 mm at the distance 1, twice the tangent of its half.
    size = 2.0 * math.tan(math.radians(diagonal / 2.0)) / math.hypot(3.0, 2.0)
    assert (3.0 * size * focal, 2.0 * size * focal) == pytest.approx((36.0, 24.0), rel=1e-3)
    check(f"type: pinhole, sensor: {{width: 36 mm, height: 24 mm}}, focal_length: {focal} mm", 36.0, 24.0, focal)


@pytest.mark.parametrize(
    ("fit", "width", "height"),
    [("crop", 17.3, 17.3 / 1.5), ("horizontal", 17.3, 17.3 / 1.5), ("vertical", 19.5, 13.0), ("overscan", 19.5, 13.0)],
)
def test_a_sensor_of_another_shape_than_the_picture(fit, width, height):
    # Four thirds in a picture of 3:2: cut off above and below, or with nothing left out.
    check(f"type: pinhole, sensor: four_thirds, focal_length: 25, sensor_fit: {fit}", width, height, 25.0)


@pytest.mark.parametrize("sensor", ["full_frame", "aps_c", "1-inch"])
def test_equivalent_focal_lengths_see_the_same_diagonal(sensor):
    """As 36 x 24 mm does: the focal length is to the sensor's diagonal as the equivalent one to 43.27 mm."""
    width, height = SENSORS[sensor]
    focal = 35.0 * math.hypot(width, height) / math.hypot(36.0, 24.0)
    width, height = min(width, 1.5 * height), min(height, width / 1.5)
    check(f"type: pinhole, sensor: {sensor}, equivalent_focal_length: 35 mm", width, height, focal)


@pytest.mark.parametrize(
    ("key", "width", "height"),
    [("vfov", 1.5, 1.0), ("hfov", 1.0, 1.0 / 1.5), ("dfov", 3.0 / math.sqrt(13.0), 2.0 / math.sqrt(13.0))],
)
def test_angles_of_view_by_themselves(key, width, height):
    # A film as wide, as high, or as long in its diagonal as twice tan(30 deg) at the distance 1.
    size = 2.0 * math.tan(math.radians(30.0))
    check(f"type: pinhole, {key}: 60", width * size, height * size, 1.0)


# ---- Focus breathing


@pytest.mark.parametrize("focus", [0.3, 0.5, 2.0, math.inf])
def test_focusing_close_narrows_the_field_of_view(focus):
    """The film is at z_i = f F / (F - f): what is in focus is sharp, and z_i / F as far from the axis as in space.

    Focused at 0.3 m, a 50 mm lens draws 20 % larger than at infinity: a point at the edge moves by 100 pixels.
    """
    image = 50.0 if math.isinf(focus) else 50.0 * 1e3 * focus / (1e3 * focus - 50.0)
    depth = 1e4 if math.isinf(focus) else focus
    text = ".inf" if math.isinf(focus) else repr(focus)
    camera = f"type: thin_lens, sensor: full_frame, focal_length: 50, f_number: 2, focus_distance: {text}"
    check(camera, 1.5 * 23.9, 23.9, image, depth, pictures=focus == 0.3)


def test_what_is_out_of_focus_has_its_middle_where_a_pinhole_sees_it():
    # The blur, 6 pixels wide, is known to 3 / 2 sqrt(n) pixels.
    image = 50.0 * 500.0 / 450.0
    camera = "type: thin_lens, sensor: full_frame, focal_length: 50, f_number: 16, focus_distance: 0.5"
    check(camera, 1.5 * 23.9, 23.9, image, 0.53, pictures=True)
