"""The sensor's noise against the statistics of photons, and where it saturates and rounds."""

import sys

import numpy as np
import pytest
from scipy import stats

from raytracer.film.exposure import CropWindow
from raytracer.film.sensor_response import make_response, poisson_quantile, require_demosaic, simulate_readout
from raytracer.optics.sensor_formats import SensorSpec
from raytracer.util.errors import InputError

SIZE = 256
WHOLE = CropWindow(SIZE, SIZE, 0, 0)

# Of 3 x 256 x 256 normal numbers the variance is known to sqrt(2 / n) = 0.32 %: 3 % is nine standard deviations.
TOLERANCE = 0.03

BAYER = ["rggb", "bggr", "grbg", "gbrg"]


def sensor(**keys):
    return SensorSpec(noise=True, **keys)


def patch(value, size=SIZE):
    return np.full((size, size, 3), value)


def recorded(value, of, iso=100.0, seed=1):
    """An evenly lit patch as the sensor records it."""
    return simulate_readout(patch(value), of, iso, seed, WHOLE).values


@pytest.mark.parametrize("iso", [100.0, 200.0, 400.0, 800.0, 1600.0, 3200.0, 6400.0])
@pytest.mark.parametrize("value", [0.05, 0.18, 0.7])
def test_variance_is_that_of_the_photons_from_iso_100_to_6400(iso, value):
    found = recorded(value, sensor(full_well=50_000.0, read_noise=3.0, bit_depth=14, black_level=512), iso)
    # A value of 1 is 50,000 electrons at ISO 100, and inversely fewer above.
    electrons = 50_000.0 * 100.0 / iso
    step = 1.0 / (2**14 - 1 - 512)
    expected = value / electrons + (3.0 / electrons) ** 2 + step**2 / 12.0
    assert found.var() == pytest.approx(expected, rel=TOLERANCE)
    # The mean is unbiased, to five standard errors.
    assert abs(found.mean() - value) < 5.0 * np.sqrt(expected / found.size)


def test_photons_are_counted_whole():
    # Ten electrons to the value of 1, and one number each: Poisson's distribution itself.
    few = sensor(full_well=1000.0, read_noise=0.0, bit_depth=10, black_level=0)
    iso = 100.0 * 1000.0 / (2**10 - 1)
    counts = np.rint(recorded(4.0 / 1023.0, few, iso) * 1023.0).astype(int).ravel()
    expected = counts.size * stats.poisson.pmf(np.arange(12), 4.0)
    found = np.bincount(counts, minlength=12)[:12]
    assert stats.chisquare(found, expected * found.sum() / expected.sum()).pvalue > 1e-4


@pytest.mark.parametrize("read_noise", [2.0, 20.0])
def test_a_dark_frame_shows_the_read_noise_about_black(read_noise):
    dark = recorded(0.0, sensor(full_well=20_000.0, read_noise=read_noise, bit_depth=16))
    step = 1.0 / (65535 - 2048)
    assert dark.std() * 20_000.0 == pytest.approx(np.sqrt(read_noise**2 + (20_000.0 * step) ** 2 / 12.0), rel=TOLERANCE)
    assert abs(dark.mean()) < 5.0 * dark.std() / np.sqrt(dark.size)
    # Numbers below black are kept, so that the mean of dark is dark.
    assert dark.min() < 0.0


def test_iso_3200_at_a_32nd_of_the_time_is_as_bright_and_noisier():
    quiet = sensor(full_well=40_000.0, read_noise=0.0, bit_depth=16)
    slow, fast = recorded(0.2, quiet, 100.0, seed=1), recorded(0.2, quiet, 3200.0, seed=2)
    assert fast.mean() == pytest.approx(slow.mean(), rel=2e-3)
    # A 32nd of the photons: sqrt(32) times the noise.
    assert fast.std() / slow.std() == pytest.approx(np.sqrt(32.0), rel=TOLERANCE)
    # Read noise, of 8 electrons, adds to it by 32 times what it was.
    loud = sensor(full_well=40_000.0, read_noise=8.0, bit_depth=16)
    ratio = recorded(0.2, loud, 3200.0).var() / recorded(0.2, loud, 100.0).var()
    few = 40_000.0 / 32
    assert ratio == pytest.approx((0.2 / few + (8.0 / few) ** 2) / (0.2 / 40_000.0 + (8.0 / 40_000.0) ** 2), rel=0.03)


def test_the_variance_that_it_tells_is_the_one_that_it_has():
    of = sensor(full_well=10_000.0, read_noise=5.0, bit_depth=10)
    result = simulate_readout(patch(0.4), of, 400.0, 3, WHOLE)
    np.testing.assert_allclose(result.variance, result.values.var(), rtol=TOLERANCE)


def test_pixels_and_channels_are_independent():
    noise = recorded(0.3, sensor()) - 0.3
    deviations = noise / noise.std()
    limit = 5.0 / SIZE
    assert abs((deviations[..., 0] * deviations[..., 1]).mean()) < limit
    assert abs((deviations[..., 1] * deviations[..., 2]).mean()) < limit
    assert abs((deviations[1:] * deviations[:-1]).mean()) < limit
    assert abs((deviations[:, 1:] * deviations[:, :-1]).mean()) < limit


def test_without_a_known_speed_it_works_at_its_base_iso():
    of = sensor(base_iso=200.0)
    np.testing.assert_array_equal(recorded(0.3, of, None), recorded(0.3, of, 200.0))


@pytest.mark.parametrize("mean", [0.3, 5.0, 99.0, 101.0, 1000.0, 40_000.0])
def test_poisson_quantiles_are_the_exact_ones(mean):
    u = np.random.default_rng(4).random(4000)
    found = poisson_quantile(u, np.full_like(u, mean))
    wrong = found != stats.poisson.ppf(u, mean)
    assert wrong.mean() < 2e-3
    assert np.abs(found - stats.poisson.ppf(u, mean)).max() <= 1.0


def test_light_beyond_saturation_is_clipped_there():
    result = simulate_readout(patch(3.0, 8), sensor(), 100.0, 1, CropWindow(8, 8, 0, 0))
    # The full well has the noise of reading, and what exceeds the largest number becomes that.
    assert result.values.max() == 1.0
    assert result.values.min() > 1.0 - 6.0 * 3.0 / 50_000.0
    assert result.saturated.all()
    fast = simulate_readout(patch(3.0, 8), sensor(), 6400.0, 1, CropWindow(8, 8, 0, 0))
    np.testing.assert_array_equal(fast.values, 1.0)
    assert fast.saturated.all()
    assert not simulate_readout(patch(0.5, 8), sensor(), 100.0, 1, CropWindow(8, 8, 0, 0)).saturated.any()


def test_below_the_base_iso_the_well_fills_before_the_numbers_end():
    # At half the base ISO a value of 1 would be two full wells.
    half = recorded(0.9, sensor(read_noise=0.0), 50.0)
    np.testing.assert_allclose(half, 0.5, atol=1e-4)


@pytest.mark.parametrize("bits", [1, 4, 8])
def test_numbers_are_whole_and_as_many_as_the_bits_allow(bits):
    # So many electrons that there is no noise to speak of.
    of = sensor(full_well=1e9, read_noise=0.0, bit_depth=bits, black_level=0)
    ramp = np.linspace(0.0, 1.0, SIZE)[None, :, None] * np.ones((4, SIZE, 3))
    found = simulate_readout(ramp, of, 100.0, 1, CropWindow(SIZE, 4, 0, 0)).values
    levels = 2**bits - 1
    np.testing.assert_allclose(found * levels, np.rint(found * levels), atol=1e-9)
    assert np.unique(found).size == min(2**bits, SIZE)
    assert np.abs(found - ramp).max() <= 0.5 / levels + 1e-3


def test_the_black_level_is_subtracted_again():
    found = recorded(0.25, sensor(black_level=1000, read_noise=10.0))
    assert found.mean() == pytest.approx(0.25, rel=1e-3)
    # Without room below black, the noise of dark is cut off there.
    assert recorded(0.0, sensor(black_level=0, read_noise=10.0)).min() == 0.0


def test_what_is_not_a_picture_does_no_harm():
    values = np.zeros((3, 3, 3))
    values[0] = [np.inf, 1e308, -5.0]
    values[1] = [np.nan, -np.inf, 0.0]
    found = simulate_readout(values, sensor(), 100.0, 1, CropWindow(3, 3, 0, 0)).values
    assert np.isfinite(found).all()
    assert (found[0, 0, :2] > 0.999).all()
    assert np.abs(found[1]).max() < 1e-3


@pytest.mark.parametrize("iso", [1e-290, 1e-3, 1e12, 1e24])
def test_speeds_beyond_all_reason_do_no_harm(iso):
    found = simulate_readout(patch(0.5, 4), sensor(), iso, 1, CropWindow(4, 4, 0, 0))
    assert np.isfinite(found.values).all()
    assert np.isfinite(found.variance).all()


def test_a_response_is_in_electrons_and_numbers():
    of = make_response(sensor(full_well=60_000.0, base_iso=200.0, bit_depth=12, black_level=256), 800.0)
    assert (of.saturation, of.full_well, of.white, of.black) == (15_000.0, 60_000.0, 4095, 256)
    assert of.scale == pytest.approx(3839.0 / 15_000.0)


def test_the_same_seed_gives_the_same_bits_and_another_does_not():
    np.testing.assert_array_equal(recorded(0.2, sensor(), seed=7), recorded(0.2, sensor(), seed=7))
    assert (recorded(0.2, sensor(), seed=7) != recorded(0.2, sensor(), seed=8)).mean() > 0.9


def test_the_sensor_may_have_a_seed_of_its_own():
    one, other = recorded(0.2, sensor(seed=5), seed=1), recorded(0.2, sensor(seed=5), seed=2)
    np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(one, recorded(0.2, sensor(), seed=5))


def test_a_crop_has_the_noise_of_the_whole():
    values = np.random.default_rng(2).random((20, 30, 3))
    whole = simulate_readout(values, sensor(), 400.0, 3, CropWindow(30, 20, 0, 0)).values
    part = simulate_readout(values[5:12, 7:29], sensor(), 400.0, 3, CropWindow(30, 20, 7, 5)).values
    np.testing.assert_array_equal(part, whole[5:12, 7:29])


@pytest.mark.parametrize("bayer", BAYER)
def test_a_mosaic_of_even_light_is_even(bayer):
    pytest.importorskip("cv2")
    of = sensor(bayer=bayer, full_well=1e9, read_noise=0.0, bit_depth=16, black_level=0)
    color = [0.8, 0.4, 0.1]
    found = simulate_readout(np.broadcast_to(color, (12, 14, 3)), of, 100.0, 1, CropWindow(14, 12, 0, 0)).values
    np.testing.assert_allclose(found, np.broadcast_to(color, found.shape), atol=2e-4)


@pytest.mark.parametrize("bayer", BAYER)
def test_each_pixel_records_the_colour_of_its_filter(bayer):
    pytest.importorskip("cv2")
    of = sensor(bayer=bayer, full_well=1e9, read_noise=0.0, bit_depth=16, black_level=0)
    values = np.random.default_rng(6).random((20, 24, 3))
    found = simulate_readout(values, of, 100.0, 1, CropWindow(24, 20, 0, 0)).values
    for row in range(2):
        for column in range(2):
            channel = "rgb".index(bayer[2 * row + column])
            here = (slice(2 + row, -2, 2), slice(2 + column, -2, 2), channel)
            np.testing.assert_allclose(found[here], values[here], atol=2e-4)
            other = (*here[:2], (channel + 1) % 3)
            assert np.abs(found[other] - values[other]).max() > 0.1


def test_noise_of_a_mosaic_is_that_of_the_photons_where_it_was_recorded():
    pytest.importorskip("cv2")
    of = sensor(bayer="rggb", full_well=20_000.0, read_noise=4.0, bit_depth=14)
    result = simulate_readout(patch(0.3), of, 800.0, 1, WHOLE)
    red = result.values[2:-2:2, 2:-2:2, 0]
    electrons = 20_000.0 / 8
    # 16,000 values: sqrt(2 / n) is 1.1 %.
    assert red.var() == pytest.approx(0.3 / electrons + (4.0 / electrons) ** 2, rel=0.05)
    # What is filled in is a mean of neighbours, and so less noisy; how much, nobody tells.
    assert result.values[3:-2:2, 3:-2:2, 0].var() < 0.6 * red.var()
    assert result.variance is None


def test_a_crop_keeps_the_pattern_of_the_frame():
    pytest.importorskip("cv2")
    values = np.random.default_rng(2).random((24, 30, 3))
    of = sensor(bayer="grbg")
    whole = simulate_readout(values, of, 400.0, 3, CropWindow(30, 24, 0, 0)).values
    part = simulate_readout(values[6:20, 7:29], of, 400.0, 3, CropWindow(30, 24, 7, 6)).values
    # But for the edges, whose neighbours are not there.
    np.testing.assert_array_equal(part[3:-3, 3:-3], whole[9:17, 10:26])


def test_light_that_saturates_a_neighbourhood_saturates_its_colours():
    pytest.importorskip("cv2")
    values = np.full((9, 9, 3), 0.1)
    values[:, 4:] = 40.0
    saturated = simulate_readout(values, sensor(bayer="rggb"), 1600.0, 1, CropWindow(9, 9, 0, 0)).saturated
    assert saturated[:, 5:].all()
    assert not saturated[:, :5].any()


def test_a_mosaic_needs_three_pixels_a_side():
    pytest.importorskip("cv2")
    with pytest.raises(InputError, match="at least 3 x 3 pixels, got 5 x 2"):
        simulate_readout(np.ones((2, 5, 3)), sensor(bayer="rggb"), 100.0, 1, CropWindow(5, 2, 0, 0))


def test_a_missing_extra_is_told_with_the_command_that_brings_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "cv2", None)
    with pytest.raises(InputError, match=r"not installed: pip install 'raytracer\[bayer\]'"):
        require_demosaic()
