"""Hand shake: how much a camera turns, how fast, about what, and what a moving camera makes of it."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from raytracer.core.camera_shake import Shake
from raytracer.core.motion.resolve import matrix_at
from raytracer.plugins.cameras.base.moving import MovingCamera, pack_camera
from tests.core.motion.kernels import camera_rays
from tests.plugins.cameras.test_moving import TURN, camera

Array = NDArray[np.float64]

WIDTH, HEIGHT = 16, 12


def shake(**keys):
    return Shake.model_validate({"amplitude": 0.2, **keys})


def turned(packed, times):
    """Pitch, yaw and roll (n, 3) in degrees of the picture at times, about the axes right, up and forward at rest.

    To first order in the angles: what the directions in the middle, and to its right, are off by.
    """
    frame = packed.camera.frame
    axes = np.array([frame.right, frame.up, frame.forward])
    n = len(times)
    origins, middle, _ = camera_rays(packed, np.full(n, WIDTH / 2), np.full(n, HEIGHT / 2), times)
    _, right, _ = camera_rays(packed, np.full(n, WIDTH), np.full(n, HEIGHT / 2), times)
    np.testing.assert_allclose(origins, np.broadcast_to(frame.origin, (n, 3)), atol=1e-12)
    pitch, yaw = middle @ axes[1], -middle @ axes[0]
    across = right - (right * middle).sum(axis=1)[:, None] * middle
    roll = -across @ axes[1] / np.linalg.norm(across, axis=1)
    return np.degrees(np.stack([pitch, yaw, roll], axis=1))


def test_the_noise_has_its_root_mean_square_about_each_axis():
    """Root mean square of 128 sinusoids over 20,000 s, within their beats."""
    angles = np.degrees(shake(bandwidth=5).angles(np.random.default_rng(0).uniform(0, 20_000, 50_000)))
    np.testing.assert_allclose(np.sqrt((angles**2).mean(axis=0)), 0.2, rtol=0.01)
    np.testing.assert_allclose(angles.mean(axis=0), 0.0, atol=0.002)
    # Gaussian: the fourth moment is 3 times the square of the second (3 - 1.5 / 128 for so many sinusoids).
    np.testing.assert_allclose((angles**4).mean(axis=0) / (angles**2).mean(axis=0) ** 2, 3.0, atol=0.1)
    # The axes turn independently, and seeds differ.
    assert np.abs(np.corrcoef(angles.T)[np.triu_indices(3, 1)]).max() < 0.02
    times = np.linspace(0, 100, 10_000)
    other = shake(bandwidth=5, seed=1).angles(times)
    assert np.abs(np.corrcoef(shake(bandwidth=5).angles(times).T, other.T)[:3, 3:]).max() < 0.2
    np.testing.assert_array_equal(other, shake(bandwidth=5, seed=1).angles(times))


@pytest.mark.parametrize("bandwidth", [2.0, 8.0])
def test_a_shaking_camera_turns_by_its_noise(bandwidth):
    """Rays of the packed camera over 16 s: their angles are the noise, its spectrum ends at the bandwidth."""
    spec = camera(shutter=16, shake={"amplitude": "0.2 deg", "bandwidth": f"{bandwidth} Hz"})
    packed = pack_camera(spec, WIDTH, HEIGHT)
    assert isinstance(packed, MovingCamera)
    times = np.arange(4096) / 4096
    result = turned(packed, times)
    expected = np.degrees(spec.shake.angles(16.0 * times))
    # But for what is of second order in the angles, and lost between 32 steps a period, 1 - cos(pi / 32).
    np.testing.assert_allclose(result, expected, atol=0.02 * 0.2)

    window = np.hanning(4096)[:, None]
    power = (np.abs(np.fft.rfft(result * window, axis=0)) ** 2).sum(axis=1)
    frequency = np.arange(len(power)) / 16.0
    inside = frequency <= bandwidth + 4 / 16
    assert power[~inside].sum() < 1e-3 * power.sum()
    # Even up to there: half of the power is below half of the band, as far as 16 s tell.
    assert power[frequency <= bandwidth / 2].sum() == pytest.approx(power.sum() / 2, rel=0.5)
    assert math.sqrt((result**2).mean()) == pytest.approx(0.2, rel=0.25)


@pytest.mark.parametrize("motion", [{"velocity": [0.5, 0, -1]}, TURN])
def test_a_camera_shakes_where_its_motion_has_brought_it(motion):
    keys = {"shutter": {"open": 0.5, "close": 2.5}, "shake": {"amplitude": 3, "bandwidth": 2}}
    alone, both = (pack_camera(camera(**keys, motion=given), WIDTH, HEIGHT) for given in (None, motion))
    spec = camera(motion=motion)
    for fraction in (0.0, 0.31, 0.5, 1.0):
        origins, directions, _ = camera_rays(both, [1.0, 15.0], [2.0, 9.0], fraction)
        rest_origins, rest_directions, _ = camera_rays(alone, [1.0, 15.0], [2.0, 9.0], fraction)
        matrix = matrix_at(spec.motion, 0.5 + 2.0 * fraction)
        np.testing.assert_allclose(origins, rest_origins @ matrix[:3, :3].T + matrix[:3, 3], atol=1e-4)
        np.testing.assert_allclose(directions, rest_directions @ matrix[:3, :3].T, atol=1e-3)


def test_a_short_exposure_is_shaken_little():
    """Within 1/500 s at most 2 pi B t of the amplitude of 0.1 degrees, to which the picture as a whole is moved."""
    packed = pack_camera(camera(shutter="1/500 s", time=7, shake={"amplitude": 0.1}), WIDTH, HEIGHT)
    result = turned(packed, np.array([0.0, 1.0]))
    assert 0.0 < np.abs(result[1] - result[0]).max() < 4 * 0.1 * 2 * math.pi * 10 / 500
    expected = np.degrees(shake(amplitude=0.1).angles([7.0, 7.002]))
    np.testing.assert_allclose(result, expected, atol=1e-3)


def test_a_shake_too_fast_to_follow_is_refused():
    with pytest.raises(ValueError, match="shakes 1e\\+06 times while the shutter is open, and at most 4096 times"):
        camera(shutter=1000, shake={"amplitude": 1, "bandwidth": "1 kHz"})
