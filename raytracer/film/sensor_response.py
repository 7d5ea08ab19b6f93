"""Simulation of a sensor: shot noise, read noise, full wells and quantization.

In a scene:

    camera: {type: thin_lens, sensor: {format: full_frame, noise: true}, focal_length: 50 mm, f_number: 2.8,
             shutter: 1/125 s, iso: 3200}
    camera: {type: thin_lens, focal_length: 35 mm, f_number: 8, shutter: 1/30 s, exposure: auto,
             sensor: {format: aps_c, noise: true, full_well: 30000, read_noise: 2.5, bit_depth: 12, bayer: rggb}}

A value of 1 at the base ISO is a full well; at a speed of n times that it is the n-th part of it, which is amplified to
the converter's largest number.  With mu electrons expected, F of them at a value of 1:

    electrons  N = min(Poisson(mu), full well) + Normal(0, read noise)
    number     D = round(black + (white - black) N / F), from 0 to white = 2^bits - 1
    value      (D - black) / (white - black)

so a value v has the variance v / F + (read noise / F)^2 + 1 / (12 (white - black)^2).

References: EMVA Standard 1288, release 4.0 (2021), "Linear Model", sec. 2; Janesick 2007, "Photon Transfer", ch. 3.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.film.exposure import CropWindow
from raytracer.optics.sensor_formats import SensorSpec
from raytracer.util.errors import InputError

FloatArray = NDArray[np.float64]

_STREAM = int.from_bytes(b"sensor")
"""Separates the sensor's random numbers from others with the same seed."""

_NORMAL_APPROXIMATION_FROM = 100.0

_LEAST_UNIFORM, _GREATEST_UNIFORM = 2.0**-54, 1.0 - 2.0**-53
"""Uniform numbers whose quantiles are finite: half a step of theirs above 0, and the last float64 below 1."""

_MISSING = "a sensor with a Bayer mosaic needs OpenCV, which is not installed: pip install 'raytracer[bayer]'"
_LARGEST_NUMBER = 65535
_SMALLEST_MOSAIC = 3


class SensorResponse(NamedTuple):
    """The response of a sensor to light at some ISO speed.

    saturation (electrons) : of the value 1.
    full_well (electrons) : that a pixel holds.
    read_noise (electrons) : standard deviation.
    white, black : numbers that the converter gives for the values 1 and 0.
    """

    saturation: float
    full_well: float
    read_noise: float
    white: int
    black: int

    @property
    def scale(self) -> float:
        """Numbers per electron."""
        return (self.white - self.black) / self.saturation

    @property
    def max_value(self) -> float:
        """The largest value: that of a full well, where a picture is made darker than the base ISO would."""
        return min(1.0, self.full_well / self.saturation)

    def variance(self, values: FloatArray) -> FloatArray:
        """Compute the variance that the sensor adds to expected `values`, not negative, if none is clipped."""
        rounding = 1.0 / (12.0 * (self.white - self.black) ** 2)
        return np.asarray(values / self.saturation + (self.read_noise / self.saturation) ** 2 + rounding)

    def values(self, numbers: Any) -> FloatArray:
        """Convert the converter's numbers, of any shape, to values."""
        return np.asarray((numbers - float(self.black)) / (self.white - self.black))


class SensorReadout(NamedTuple):
    """The recording of a sensor.

    values : float64 (height, width, 3), of at most 1.
    variance : of the sensor's noise, of the same shape; None behind a Bayer mosaic, where it is not known.
    saturated : bool (height, width), pixels with all channels saturated.
    """

    values: FloatArray
    variance: FloatArray | None
    saturated: NDArray[np.bool_]


def make_response(sensor: SensorSpec, speed: float | None) -> SensorResponse:
    """Make the response of a sensor at an ISO speed; at its base ISO if that is not known."""
    gain = 1.0 if speed is None else speed / sensor.base_iso
    return SensorResponse(sensor.full_well / gain, sensor.full_well, sensor.read_noise, sensor.white(), sensor.black())


def require_demosaic() -> Any:
    """Import OpenCV, or raise an InputError, before a render, if the extra is not installed or does not run."""
    try:
        import cv2
    except ImportError as error:
        raise InputError(_MISSING) from error
    return cv2


def require_mosaic_size(height: int, width: int) -> None:
    """Raise an InputError if a mosaic of height x width pixels is too small to be demosaiced: less than 3 a side."""
    if min(height, width) < _SMALLEST_MOSAIC:
        raise InputError(
            f"a Bayer mosaic needs a picture of at least {_SMALLEST_MOSAIC} x {_SMALLEST_MOSAIC} pixels, "
            f"got {width} x {height}: make it larger, or leave out camera.sensor.bayer"
        )


# ---- Random numbers


def _random_numbers(seed: int, frame: CropWindow, height: int, width: int) -> tuple[FloatArray, FloatArray]:
    """Draw uniform and normal numbers (height, width, 3) for the pixels of a part of the frame.

    They belong to the pixels of the frame, so that a part has the same as the whole has there.
    """
    uniform, normal = np.empty((height, width, 3)), np.empty((height, width, 3))
    part = slice(frame.left, frame.left + width)
    for row in range(height):
        key = np.random.SeedSequence(entropy=seed, spawn_key=(_STREAM, frame.top + row))
        generator = np.random.Generator(np.random.PCG64(key))
        uniform[row] = generator.random((frame.width, 3))[part]
        normal[row] = generator.standard_normal((frame.width, 3))[part]
    return uniform, normal


def poisson_quantile(uniform: FloatArray, mean: FloatArray) -> FloatArray:
    """Compute the least integer k with P(X <= k) >= `uniform`, for X Poisson distributed with `mean`.

    For a mean of 100 and more an expansion takes the place of the exact sum: one in ten thousand results is then off
    by one.

    References: Giles 2016, "Algorithm 955: Approximation of the Inverse Poisson Cumulative Distribution Function",
        ACM Trans. Math. Softw. 42(1) (the expansion about the normal distribution).
    """
    from scipy.special import ndtri, pdtrik

    u = np.clip(uniform, _LEAST_UNIFORM, _GREATEST_UNIFORM)
    result = np.zeros_like(mean)
    few = (mean > 0.0) & (mean < _NORMAL_APPROXIMATION_FROM)
    result[few] = np.ceil(pdtrik(u[few], mean[few]))
    many = mean >= _NORMAL_APPROXIMATION_FROM
    m, w = mean[many], ndtri(u[many])
    root = np.sqrt(m)
    result[many] = np.floor(
        m
        + root * w
        + (1.0 / 3.0 + w**2 / 6.0)
        + (-w / 36.0 - w**3 / 72.0) / root
        + (-8.0 / 405.0 + 7.0 * w**2 / 810.0 + w**4 / 270.0) / m
    )
    return np.maximum(result, 0.0)


def simulate_readout(
    values: FloatArray, sensor: SensorSpec, speed: float | None, seed: int, frame: CropWindow
) -> SensorReadout:
    """Simulate the readout of a sensor that recorded `values` (height, width, 3), which are a part of `frame`.

    speed : ISO speed at which `values` of 1 saturate the sensor; None if not known.
    seed : of the noise, if the sensor has none of its own.

    Raises InputError: a Bayer mosaic of fewer than 3 pixels a side, or without the library that makes a picture of it.
    """
    height, width, _ = values.shape
    sensor_response = make_response(sensor, speed)
    uniform, normal = _random_numbers(seed if sensor.seed is None else sensor.seed, frame, height, width)
    if sensor.bayer is not None:
        colors = _colors(sensor.bayer, frame, height, width)
        values, uniform, normal = (np.take_along_axis(a, colors, axis=2) for a in (values, uniform, normal))

    # Values far beyond the full well fill it for certain, and would overflow.
    most = (2.0 * sensor_response.full_well + 1e3) / sensor_response.saturation
    values = np.clip(np.nan_to_num(values, posinf=most), 0.0, most)
    expected = sensor_response.saturation * values
    caught = np.minimum(poisson_quantile(uniform, expected), sensor_response.full_well)
    signal = caught + sensor_response.read_noise * normal
    numbers = np.clip(np.rint(sensor_response.black + sensor_response.scale * signal), 0, sensor_response.white)
    # Below the base ISO a well is full before the numbers end.
    full = np.asarray((caught >= sensor_response.full_well) | (numbers >= sensor_response.white))
    if sensor.bayer is None:
        return SensorReadout(sensor_response.values(numbers), sensor_response.variance(values), np.all(full, axis=2))
    developed = _demosaic(numbers[..., 0], sensor.bayer, sensor_response.white, frame)
    return SensorReadout(sensor_response.values(developed), None, _full_neighbourhood(full[..., 0]))


# ---- Mosaic


def _pattern(bayer: str, frame: CropWindow) -> NDArray[np.str_]:
    """Find the colours (2, 2), as letters, of the first two rows and columns of a part of the frame."""
    return np.roll(np.array(list(bayer)).reshape(2, 2), (-frame.top, -frame.left), axis=(0, 1))


def _colors(bayer: str, frame: CropWindow, height: int, width: int) -> NDArray[np.intp]:
    """Find the channel that each pixel of a part of the frame records, (height, width, 1)."""
    tile = np.vectorize("rgb".index, otypes=[np.intp])(_pattern(bayer, frame))
    return np.asarray(np.tile(tile, ((height + 1) // 2, (width + 1) // 2))[:height, :width, None])


def _demosaic(numbers: FloatArray, bayer: str, white: int, frame: CropWindow) -> FloatArray:
    """Demosaic numbers (height, width) to a picture (height, width, 3), by interpolation along edges.

    References: https://docs.opencv.org/4.x/d8/d01/group__imgproc__color__conversions.html, "Edge-Aware Demosaicing".
    """
    cv2 = require_demosaic()
    require_mosaic_size(*numbers.shape)
    # All 16 bits are used, so that a mean of integers is rounded less than they are.
    steps = _LARGEST_NUMBER // white
    name = "".join(_pattern(bayer, frame).ravel()).upper()
    code = getattr(cv2, f"COLOR_Bayer{name}2RGB_EA")
    return np.asarray(cv2.demosaicing((steps * numbers).astype(np.uint16), code), dtype=np.float64) / steps


def _full_neighbourhood(full: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Find pixels whose neighbourhood of nine is full, and so all colours of the middle."""
    padded = np.pad(full, 1, mode="edge")
    height, width = full.shape
    shifted = [padded[y : y + height, x : x + width] for y in range(3) for x in range(3)]
    return np.asarray(np.logical_and.reduce(shifted))
