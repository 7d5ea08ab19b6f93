"""Formulas of thin lenses and the sizes of sensors, against the worked numbers of the camera truths and of the books.

What they do to pictures is measured in tests/camera_truths/.
"""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, TypeAdapter, ValidationError

from raytracer.optics import thin_lens as ph
from raytracer.optics.sensor_formats import SENSORS, SensorField, SensorSize, SensorSpec, fit_sensor
from raytracer.schema.registry import CAMERAS

# Plausible lenses and distances, in mm.
focal_lengths = st.floats(5.0, 800.0)
f_numbers = st.floats(0.7, 64.0)
circles = st.floats(0.002, 0.2)
distances = st.floats(1.1, 1e4)


def camera(**keys):
    return CAMERAS.specs()[keys.get("type", "thin_lens")].model_validate({"look_from": [0, 0, 0], **keys})


@pytest.mark.parametrize(("focal", "diagonal"), [(17.0, 103.68), (50.0, 46.79), (200.0, 12.35)])
def test_fields_of_view(focal, diagonal):
    assert ph.field_of_view(math.hypot(36.0, 24.0), focal) == pytest.approx(diagonal, abs=5e-3)


@pytest.mark.parametrize(("size", "factor"), [((23.6, 15.7), 1.526), ((17.3, 13.0), 1.999), ((13.2, 8.8), 2.727)])
def test_crop_factors(size, factor):
    assert ph.crop_factor(*size) == pytest.approx(factor, abs=5e-4)
    assert ph.crop_factor(36.0, 24.0) == 1.0


def test_sensors_have_their_sizes():
    assert SENSORS == {
        "medium_format": (53.7, 40.2),
        "full_frame": (36.0, 23.9),
        "aps_h": (27.9, 18.6),
        "aps_c": (23.6, 15.8),
        "four_thirds": (17.3, 13.0),
        "1-inch": (13.2, 8.8),
        "1/1.63-inch": (8.38, 5.59),
        "1/2.3-inch": (6.16, 4.62),
        "1/3.2-inch": (4.54, 3.42),
    }


class _Holder(BaseModel):
    sensor: SensorField


NAMES = {"full_frame": "full_frame", "Full Frame": "full_frame", "full-frame": "full_frame", "APS-C": "aps_c"}
NAMES |= {"1 inch": "1-inch", 1: "1-inch", "1/2.3": "1/2.3-inch", "1/1.63-inch": "1/1.63-inch"}


@pytest.mark.parametrize(("given", "name"), NAMES.items())
def test_sensors_are_known_by_their_names(given, name):
    for value in (given, {"format": given}):
        assert _Holder.model_validate({"sensor": value}).sensor.size() == SensorSize(*SENSORS[name])


def test_sensors_may_be_of_any_size():
    assert SensorSpec(width=254.0, height=203.0).size() == SensorSize(254.0, 203.0)
    assert _Holder.model_validate({"sensor": {"width": "1 m", "height": "20 cm"}}).sensor.size() == SensorSize(
        1000.0, 200.0
    )
    assert SensorSpec(noise=True).size() is None
    for keys in ({"width": 36}, {"height": 24}, {"format": "aps_c", "width": 2, "height": 3}, {"format": "dx"}):
        with pytest.raises(ValidationError):
            TypeAdapter(SensorSpec).validate_python(keys)


@pytest.mark.parametrize(
    ("fit", "expected"),
    [("crop", (16, 9)), ("horizontal", (16, 9)), ("vertical", (64 / 3, 12)), ("overscan", (64 / 3, 12))],
)
def test_wide_pictures_on_a_sensor_of_four_thirds(fit, expected):
    assert fit_sensor(SensorSize(16.0, 12.0), 1920, 1080, fit) == pytest.approx(expected)
    # Upright, it is the other way round: what was cut above and below is cut at the sides.
    turned = {"horizontal": "vertical", "vertical": "horizontal"}.get(fit, fit)
    assert fit_sensor(SensorSize(12.0, 16.0), 1080, 1920, turned) == pytest.approx(expected[::-1])


@given(st.floats(1.0, 99.0), st.floats(1.0, 99.0), st.integers(1, 999), st.integers(1, 999))
def test_a_cropped_picture_lies_on_the_sensor_and_an_overscanned_one_around_it(across, down, width, height):
    sensor = SensorSize(across, down)
    inside, around = fit_sensor(sensor, width, height, "crop"), fit_sensor(sensor, width, height, "overscan")
    for part in (inside, around):
        assert part.width / part.height == pytest.approx(width / height)
    rounding = 1.0 + 1e-14
    assert inside.width <= across * rounding
    assert inside.height <= down * rounding
    assert around.width * rounding >= across
    assert around.height * rounding >= down
    # One of the edges is the sensor's own.
    assert inside.width == pytest.approx(across) or inside.height == pytest.approx(down)


@given(focal_lengths, distances)
def test_gauss(focal, times):
    subject = times * focal
    image = ph.image_distance(focal, subject)
    assert 1.0 / focal == pytest.approx(1.0 / image + 1.0 / subject)
    assert ph.focal_length_from_distances(image, subject) == pytest.approx(focal)
    # Newton's form of it, which is m^2 = f / (s - f) * (z_i - f) / f.
    assert ph.magnification(image, subject) == pytest.approx(focal / (subject - focal))


def test_gauss_at_its_ends():
    assert ph.image_distance(50.0, math.inf) == 50.0
    assert ph.focal_length_from_distances(50.0, math.inf) == 50.0
    assert ph.magnification(50.0, math.inf) == 0.0
    # Twice the focal length on both sides: life size.
    assert ph.image_distance(50.0, 100.0) == 100.0
    for subject in (50.0, 49.0, 0.0):
        with pytest.raises(ValueError, match="no image behind a lens of the focal length 50"):
            ph.image_distance(50.0, subject)


def test_circles_of_confusion():
    # 50 mm f/1.4 focused at 2 m, a point at 4 m.
    image = ph.image_distance(50.0, 2000.0)
    assert ph.circle_of_confusion(50.0 / 1.4, image, 2000.0, 4000.0) == pytest.approx(0.45788, abs=5e-6)
    assert ph.circle_of_confusion(50.0 / 1.4, image, 2000.0, 2000.0) == 0.0
    assert ph.circle_of_confusion(25.0, 50.0, math.inf, 1000.0) == pytest.approx(1.25)
    assert ph.circle_of_confusion(25.0, image, 2000.0, math.inf) == pytest.approx(25.0 * image / 2000.0)
    assert ph.circle_of_confusion(25.0, image, 2000.0, 0.0) == math.inf
    # A defocus angle of 0.6 deg at 10 m, 20 deg high, 675 rows: in pixels, on the film at distance 1.
    pupil, pixel = 2.0 * 10.0 * math.tan(math.radians(0.3)), 2.0 * math.tan(math.radians(10.0)) / 675.0
    assert pupil == pytest.approx(0.104720, abs=1e-6)
    assert ph.circle_of_confusion(pupil, 1.0 / pixel, 10.0, 5.0) == pytest.approx(20.044, abs=5e-4)
    assert ph.circle_of_confusion(pupil, 1.0 / pixel, 10.0, 20.0) == pytest.approx(10.022, abs=5e-4)


@given(focal_lengths, f_numbers, distances, distances)
def test_the_circle_of_confusion_by_similar_triangles(focal, n, focus, times):
    """Camera truths: C / A = |z_s - z_i| / z_i, with z_i the image of the point and z_s that of the plane of focus."""
    film, subject = ph.image_distance(focal, focus * focal), times * focal
    image = ph.image_distance(focal, subject)
    expected = focal / n * abs(film - image) / image
    found = ph.circle_of_confusion(focal / n, film, focus * focal, subject)
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-12 * focal)
    # And in terms of the object.
    away = focal / n * abs(subject - focus * focal) / subject * focal / (focus * focal - focal)
    assert found == pytest.approx(away, rel=1e-9, abs=1e-12 * focal)


def test_depth_of_field():
    near, far = (limit(50.0, 2.8, 0.03, 3000.0) for limit in (ph.near_limit, ph.far_limit))
    assert (near, far) == pytest.approx((2729.5, 3330.1), abs=0.05)
    image = ph.image_distance(50.0, 3000.0)
    for limit in (near, far):
        assert ph.circle_of_confusion(50.0 / 2.8, image, 3000.0, limit) == pytest.approx(0.03, rel=1e-12)
    assert ph.far_limit(28.0, 11.0, 0.03, 2500.0) == math.inf


@given(focal_lengths, f_numbers, circles, distances)
def test_limits_of_the_depth_of_field_are_blurred_by_the_circle(focal, n, circle, times):
    focus = times * focal
    image = ph.image_distance(focal, focus)
    near, far = ph.near_limit(focal, n, circle, focus), ph.far_limit(focal, n, circle, focus)
    assert near <= focus <= far
    assert ph.circle_of_confusion(focal / n, image, focus, near) == pytest.approx(circle, rel=1e-6)
    at_infinity = ph.circle_of_confusion(focal / n, image, focus, math.inf)
    if math.isinf(far):
        assert at_infinity <= circle * (1.0 + 1e-9)
    else:
        # The farther it is, the less does its blur change with it.
        assert ph.circle_of_confusion(focal / n, image, focus, far) == pytest.approx(circle, rel=1e-6)
        assert at_infinity > circle * (1.0 - 1e-9)
    # Infinity is just sharp from the hyperfocal distance on, and then everything from half of it.
    distance = ph.hyperfocal(focal, n, circle)
    assert math.isinf(ph.far_limit(focal, n, circle, distance * (1.0 + 1e-9)))
    assert math.isfinite(ph.far_limit(focal, n, circle, focal + (distance - focal) * (1.0 - 1e-9)))
    assert ph.near_limit(focal, n, circle, distance) == pytest.approx(distance / 2.0)
    assert ph.near_limit(focal, n, circle, math.inf) == pytest.approx(distance - focal)
    assert ph.far_limit(focal, n, circle, math.inf) == math.inf


def test_the_airy_disc():
    # 2.44 * 0.55 um * 8, twice the first zero of the Bessel function, 3.8317, over pi.
    assert ph.airy_diameter_um(8.0) == pytest.approx(10.736)
    assert ph.airy_diameter_um(1.0) == pytest.approx(2.0 * 3.8317 / math.pi * 0.55, rel=1e-3)


def test_exposure_values():
    # The definition's own zero, and the sunny sixteen rule: EV 15 is f/16 at 1/128 s.
    assert ph.exposure_value(1.0, 1.0) == 0.0
    assert ph.exposure_value(16.0, 1.0 / 128.0) == 15.0
    assert ph.exposure_value(16.0, 1.0 / 128.0, 400.0) == 13.0
    # A row of whole stops is one exposure value.
    exact = {round(ph.exposure_value(math.sqrt(2.0) ** k, 2.0 ** (k - 10)), 12) for k in range(1, 11)}
    assert exact == {10.0}


def test_constants_of_the_standard():
    # ISO 12232: H_sat = 78 / S leaves half a stop above white: 18 % of 78 / sqrt(2) is the 10 of S_SOS = 10 / H.
    assert ph.SATURATION_EXPOSURE / math.sqrt(2.0) * 0.18 == pytest.approx(ph.MEAN_EXPOSURE, rel=0.01)
    assert ph.WHITE_EFFICACY == 179.0


def test_a_camera_in_full():
    """50 mm f/1.4 on full frame, focused at 2 m, 1/125 s, ISO 400; 1800 x 1195 pixels are of the sensor's shape."""
    spec = camera(sensor="full_frame", focal_length=50, f_number=1.4, focus_distance=2, shutter="1/125 s", iso=400)
    numbers = spec.describe(1800, 1195)
    image = 50.0 * 2000.0 / 1950.0
    assert numbers["film_width_mm"] == pytest.approx(36.0)
    assert numbers["film_height_mm"] == pytest.approx(23.9)
    assert numbers["pixel_pitch_um"] == pytest.approx(20.0)
    assert numbers["image_distance_mm"] == pytest.approx(image)
    assert numbers["magnification"] == pytest.approx(50.0 / 1950.0)
    assert numbers["entrance_pupil_mm"] == pytest.approx(50.0 / 1.4)
    assert numbers["hfov_deg"] == pytest.approx(2.0 * math.degrees(math.atan(18.0 / image)))
    assert numbers["vfov_deg"] == pytest.approx(2.0 * math.degrees(math.atan(11.95 / image)))
    assert numbers["crop_factor"] == pytest.approx(43.2666 / 43.2112, abs=1e-5)
    assert numbers["equivalent_focal_length_mm"] == pytest.approx(50.064, abs=5e-4)
    assert numbers["ev100"] == pytest.approx(math.log2(1.4**2 * 125.0) - 2.0)
    assert numbers["airy_disc_um"] == pytest.approx(1.342 * image / (50.0 / 1.4))


@pytest.mark.parametrize(
    "keys",
    [
        {"sensor": "aps_c", "focal_length": 35},
        {"sensor": "aps_c", "vfov": 2 * math.degrees(math.atan(15.8 / 2 / 35))},
        {"focal_length": 35, "vfov": 2 * math.degrees(math.atan(15.8 / 2 / 35))},
        {"focal_length": 35, "hfov": 2 * math.degrees(math.atan(23.6 / 2 / 35))},
        {"focal_length": 35, "dfov": 2 * math.degrees(math.atan(math.hypot(23.6, 15.8) / 2 / 35))},
        {"sensor": "aps_c", "equivalent_focal_length": 35 * ph.crop_factor(23.6, 15.8)},
    ],
)
def test_two_of_sensor_angle_and_focal_length_give_the_third(keys):
    optics = camera(**keys, focus_distance=math.inf, f_number=2).optics(236, 158)
    assert (*optics.film, optics.focal_length, optics.image_distance) == pytest.approx((23.6, 15.8, 35.0, 35.0))
    assert optics.top == pytest.approx(7.9 / 35.0)


def test_an_angle_is_that_of_the_picture_wherever_the_focus_is():
    # The film is as far away as the angle and the sensor say; the focal length follows from that and the focus.
    spec = camera(sensor="full_frame", hfov=40, focus_distance=0.5)
    image = 18.0 / math.tan(math.radians(20.0))
    numbers = spec.describe(1800, 1195)
    assert numbers["hfov_deg"] == pytest.approx(40.0)
    assert numbers["image_distance_mm"] == pytest.approx(image)
    assert numbers["focal_length_mm"] == pytest.approx(1.0 / (1.0 / image + 1.0 / 500.0))


def test_the_default_sensor_is_full_frame():
    alone, named = camera(focal_length=28), camera(focal_length=28, sensor="full_frame")
    assert alone.describe(300, 200) == named.describe(300, 200)
    # Of which 28 mm is 28 mm times 43.267 / 43.211 as an equivalent.
    assert alone.describe(360, 239)["equivalent_focal_length_mm"] == pytest.approx(28.036, abs=5e-4)


@pytest.mark.parametrize("distance", [math.inf, 3.0, 0.5])
def test_the_plane_of_focus_moves_with_autofocus(distance):
    unfocused = camera(focal_length=50, f_number=2, focus_on="ball")
    focused = unfocused.with_focus_distance(distance)
    assert focused.plane_of_focus() == distance
    assert focused.optics(36, 24) == camera(focal_length=50, f_number=2, focus_distance=distance).optics(36, 24)
    assert unfocused.focus_on == "ball"


def test_what_a_lens_cannot_focus_on():
    with pytest.raises(ValueError, match="must be farther than the focal length, 50 mm"):
        camera(focal_length=50, focus_on="ball").with_focus_distance(0.05)
    with pytest.raises(ValueError, match="needs a finite focus_distance"):
        camera(vfov=40, defocus_angle=1, focus_at=[0.5, 0.5]).with_focus_distance(math.inf)


def test_what_the_film_is_told_of_the_exposure():
    keys = {"focal_length": 50, "focus_distance": 2, "shutter": "1/125 s"}
    assert camera(**keys, f_number=2).exposure_settings(36, 24) is None
    given_speed = camera(**keys, f_number=2, iso=400, exposure_compensation=-1).exposure_settings(36, 24)
    assert given_speed == ph.ExposureSettings(0.008, 400.0, -1.0, None, 2.0, True)
    # An f-number follows from the diameter of the lens; without an aperture, or its scale, only radiance is metered.
    auto = camera(**keys, aperture=20, exposure={"metering": "spot", "at": [0.3, 0.6]}).exposure_settings(36, 24)
    assert auto.f_number == pytest.approx(2.5)
    assert (auto.iso, auto.metering, auto.radiometric) == (None, ph.Metering("spot", 0.3, 0.6, 0.1), True)
    plain = camera(type="pinhole", vfov=40, exposure="auto").exposure_settings(36, 24)
    assert plain == ph.ExposureSettings(None, None, 0.0, ph.Metering("center_weighted", 0.5, 0.5, 0.1), None, False)
    bare = camera(type="none", shutter=2, iso=25).exposure_settings(36, 24)
    assert bare == ph.ExposureSettings(2.0, 25.0, 0.0, None, None, True)


def test_the_f_number_of_a_hole():
    # 6 mm before film at 150 mm.
    numbers = camera(type="pinhole", focal_length=150, diameter=6).describe(36, 24)
    assert numbers["f_number"] == pytest.approx(25.0)
    assert camera(type="pinhole", focal_length=150, diameter=6).relative_aperture(36, 24) == pytest.approx(25.0)
    assert camera(type="pinhole", focal_length=150).relative_aperture(36, 24) is None
