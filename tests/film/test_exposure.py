"""Exposure against the numbers of ISO 12232, and what metering measures."""

import math

import numpy as np
import pytest

from raytracer.film.exposure import (
    CropWindow,
    ExposureResult,
    luminance,
    meter_luminance,
    metering_weights,
    resolve_exposure,
    saturation_gain,
)
from raytracer.optics.thin_lens import ExposureSettings, Metering
from raytracer.util.errors import InputError

MEAN = Metering("mean", 0.5, 0.5, 0.1)
CENTER = Metering("center_weighted", 0.5, 0.5, 0.1)
WHOLE = CropWindow(60, 40, 0, 0)


def camera(iso=100.0, seconds=1 / 125, f_number=2.8, *, compensation=0.0, metering=None, radiometric=True):
    return ExposureSettings(seconds, iso, compensation, metering, f_number, radiometric)


def grey(value):
    return np.full((40, 60, 3), value)


def scene():
    """A dark room with a bright window to the right, from 0.1 to 0.9 of the height."""
    values = grey(0.02)
    values[4:36, 40:56] = [5.0, 6.0, 8.0]
    return values


def test_iso_100_saturates_at_0_78_lux_seconds():
    # H_sat = 78 / S; 179 lm/W turn lux into W/m2.
    irradiance = 0.78 / 179.0
    assert saturation_gain(1.0, 100.0) * irradiance == pytest.approx(1.0, rel=1e-14)
    assert saturation_gain(1 / 500, 50.0) * 1000.0 * irradiance == pytest.approx(1.0, rel=1e-14)


def test_a_stop_of_time_speed_or_compensation_is_a_factor_of_two():
    plain = saturation_gain(1 / 125, 100.0)
    assert saturation_gain(2 / 125, 100.0) == pytest.approx(2.0 * plain, rel=1e-15)
    assert saturation_gain(1 / 125, 200.0) == pytest.approx(2.0 * plain, rel=1e-15)
    assert saturation_gain(1 / 125, 100.0, 1.0) == pytest.approx(2.0 * plain, rel=1e-15)
    assert saturation_gain(1 / 125, 100.0, -3.0) == pytest.approx(plain / 8.0, rel=1e-15)


def test_a_light_meter_exposes_as_the_standard_wants():
    # ISO 2720: a reflected-light meter with K = 12.5 reads L = K N^2 / (t S).  A lens without losses gives the sensor
    # pi L / (4 N^2) of it, so H S = 12.5 pi / 4 = 9.82, which is the 10 of ISO 12232 but for 2 %.
    n, seconds, iso = 5.6, 1 / 60, 400.0
    lux = math.pi / (4.0 * n * n) * 12.5 * n * n / (seconds * iso)
    assert saturation_gain(seconds, iso) * lux / 179.0 == pytest.approx(10.0 / 78.0, rel=0.02)


def test_a_given_speed_is_kept_and_nothing_is_metered():
    setting = resolve_exposure(camera(iso=800.0, compensation=1.0), grey(123.0), WHOLE)
    assert (setting.iso, setting.metered) == (800.0, None)
    assert setting.iso_speed == 1600.0
    assert setting.gain == saturation_gain(1 / 125, 800.0, 1.0)


def test_ev100_of_known_settings():
    # f/1 and a second are EV 0 by definition; f/16 at 1/125 s is bright sun, EV 15; ISO 400 takes two stops less light.
    assert resolve_exposure(camera(100.0, 1.0, 1.0), grey(1.0), WHOLE).ev100 == 0.0
    assert resolve_exposure(camera(100.0, 1 / 128, 16.0), grey(1.0), WHOLE).ev100 == pytest.approx(15.0)
    assert resolve_exposure(camera(400.0, 1 / 128, 16.0), grey(1.0), WHOLE).ev100 == pytest.approx(13.0)
    assert resolve_exposure(camera(f_number=None), grey(1.0), WHOLE).ev100 is None
    assert resolve_exposure(camera(f_number=math.inf), grey(1.0), WHOLE).ev100 is None


def test_a_speed_without_aperture_or_time_is_refused():
    for exposure in (camera(seconds=None), camera(radiometric=False)):
        with pytest.raises(ValueError, match="without the aperture and the time"):
            resolve_exposure(exposure, grey(1.0), WHOLE)


@pytest.mark.parametrize("mode", ["mean", "center_weighted", "spot"])
@pytest.mark.parametrize("compensation", [0.0, 1.5, -2.0])
@pytest.mark.parametrize("radiometric", [True, False])
def test_auto_brings_what_is_metered_to_10_over_78(mode, compensation, radiometric):
    metering = Metering(mode, 0.7, 0.4, 0.2)
    exposure = camera(None, compensation=compensation, metering=metering, radiometric=radiometric)
    setting = resolve_exposure(exposure, scene(), WHOLE)
    exposed = meter_luminance(setting.gain * scene(), metering, WHOLE)
    assert exposed == pytest.approx(10.0 / 78.0 * 2.0**compensation, rel=1e-12)
    assert (setting.iso is not None) == radiometric


def test_the_speed_that_auto_chooses_gives_the_same_picture_when_it_is_given():
    chosen = resolve_exposure(camera(None, compensation=0.7, metering=CENTER), scene(), WHOLE)
    given = resolve_exposure(camera(chosen.iso, compensation=0.7), scene(), WHOLE)
    assert given.gain == chosen.gain
    # Standard output sensitivity: S = 10 / H of what is metered.
    lux_seconds = 179.0 * meter_luminance(scene(), CENTER, WHOLE) / 125
    assert chosen.iso == pytest.approx(10.0 / lux_seconds, rel=1e-12)


def test_metering_modes_tell_the_window_from_the_room():
    def found(metering):
        return meter_luminance(scene(), metering, WHOLE)

    window = float(luminance(np.array([5.0, 6.0, 8.0])))
    assert found(Metering("spot", 0.8, 0.5, 0.2)) == pytest.approx(window)
    assert found(Metering("spot", 0.2, 0.5, 0.2)) == pytest.approx(0.02)
    assert found(MEAN) == pytest.approx(0.02 + (window - 0.02) * 32 * 16 / 2400)


def test_luminance_is_that_of_rec_709():
    np.testing.assert_allclose(luminance(np.eye(3)), [0.2126, 0.7152, 0.0722], rtol=1e-15)


@pytest.mark.parametrize("metering", [MEAN, CENTER, Metering("spot", 0.3, 0.8, 0.25)])
@pytest.mark.parametrize("size", [(40, 60), (1, 1), (2, 2), (3, 50), (61, 47)])
def test_weights_sum_to_one(metering, size):
    height, width = size
    weights = metering_weights(metering, CropWindow(width, height, 0, 0), height, width)
    assert weights.shape == size
    assert weights.sum() == pytest.approx(1.0, rel=1e-12)
    assert (weights >= 0.0).all()


def test_the_middle_counts_three_quarters():
    weights = metering_weights(CENTER, CropWindow(600, 400, 0, 0), 400, 600)
    y, x = np.indices((400, 600)) + 0.5
    inside = np.hypot(x - 300.0, y - 200.0) <= 100.0
    assert weights[inside].sum() == pytest.approx(0.75)
    # All of the circle alike, all of the rest alike.
    assert np.unique(weights[inside]).size == np.unique(weights[~inside]).size == 1
    assert inside.sum() == pytest.approx(math.pi * 100.0**2, rel=2e-3)


def test_a_spot_has_its_diameter_and_its_place():
    weights = metering_weights(Metering("spot", 0.25, 0.75, 0.5), CropWindow(600, 400, 0, 0), 400, 600)
    assert np.count_nonzero(weights) == pytest.approx(math.pi * 100.0**2, rel=2e-3)
    y, x = np.indices((400, 600)) + 0.5
    assert (weights * x).sum() == pytest.approx(150.0)
    assert (weights * y).sum() == pytest.approx(300.0)


@pytest.mark.parametrize(
    ("place", "pixel"), [((0.0, 0.0), (0, 0)), ((1.0, 1.0), (5, 7)), ((0.55, 0.2), (1, 4)), ((1.0, 0.0), (0, 7))]
)
def test_a_tiny_spot_is_the_pixel_that_it_lies_in(place, pixel):
    weights = metering_weights(Metering("spot", *place, 1e-9), CropWindow(8, 6, 0, 0), 6, 8)
    assert weights[pixel] == 1.0


def test_a_crop_is_metered_where_it_lies_in_the_frame():
    whole = metering_weights(CENTER, CropWindow(60, 40, 0, 0), 40, 60)
    part = metering_weights(CENTER, CropWindow(60, 40, 22, 6), 30, 30)
    inside = whole[6:36, 22:52] == whole.max()
    assert inside.any()
    assert not inside.all()
    np.testing.assert_array_equal(part == part.max(), inside)


def test_a_spot_outside_of_the_crop_is_refused():
    with pytest.raises(InputError, match="metering spot lies outside of the crop"):
        metering_weights(Metering("spot", 0.1, 0.1, 0.1), CropWindow(60, 40, 30, 20), 20, 30)


def test_black_has_no_exposure_of_its_own():
    for value in (0.0, 5e-324):
        known = resolve_exposure(camera(None, metering=MEAN), grey(value), WHOLE)
        assert (known.iso, known.gain) == (100.0, saturation_gain(1 / 125, 100.0))
        assert resolve_exposure(camera(None, metering=MEAN, radiometric=False), grey(value), WHOLE).gain == 1.0
    assert "found black" in resolve_exposure(camera(None, metering=MEAN), grey(0.0), WHOLE).summary()


def test_a_setting_tells_itself():
    assert ExposureResult(2.0, 400.0, None, camera(400.0)).summary() == "ISO 400, f/2.8, 1/125 s, EV100 7.94"
    long = camera(None, 2.0, 8.0, compensation=-1.0, metering=MEAN)
    assert ExposureResult(2.0, 50.0, 1.0, long).summary() == (
        "ISO 50, f/8, 2 s, EV100 6.00, compensated by -1 EV, metered by mean"
    )
    short = ExposureResult(2.0, 102400.0, None, camera(102400.0, 1 / 80_000))
    assert short.summary().startswith("ISO 102400, f/2.8, 1/80000 s")
    bare = camera(None, None, None, metering=CENTER, radiometric=False)
    assert ExposureResult(0.25, None, 1.0, bare).summary() == "light times 0.25, metered by center_weighted"
    assert ExposureResult(0.25, None, 1.0, bare).as_dict() == {"exposure_compensation": 0.0, "exposure_gain": 0.25}
