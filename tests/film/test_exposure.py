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


def test_a_crop_is_metered_where_it_lies_in_the_frame():
    whole = metering_weights(CENTER, CropWindow(60, 40, 0, 0), 40, 60)
    part = metering_weights(CENTER, CropWindow(60, 40, 22, 6), 30, 30)
    inside = whole[6:36, 22:52] == whole.max()
    assert inside.any()
    assert not inside.all()
    np.testing.assert_array_equal(part == part.max(), inside)


def test_black_has_no_exposure_of_its_own():
    for value in (0.0, 5e-324):
        known = resolve_exposure(camera(None, metering=MEAN), grey(value), WHOLE)
        assert (known.iso, known.gain) == (100.0, saturation_gain(1 / 125, 100.0))
        assert resolve_exposure(camera(None, metering=MEAN, radiometric=False), grey(value), WHOLE).gain == 1.0
    assert "found black" in resolve_exposure(camera(None, metering=MEAN), grey(0.0), WHOLE).summary()


def test_a_setting_tells_itself():
    assert ExposureResult(2.0, 400.0, None, camera(400.0)).summary() == "ISO 400, f/2.8, 1/125 s, EV100 7.94"
    bare = camera(None, None, None, metering=CENTER, radiometric=False)
    assert ExposureResult(0.25, None, 1.0, bare).summary() == "light times 0.25, metered by center_weighted"
