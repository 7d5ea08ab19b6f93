"""The sensor's own doings: photons come one by one, reading adds noise, wells fill up, and numbers are whole.

In a scene:

    camera: {type: thin_lens, sensor: {format: full_frame, noise: true}, focal_length: 50 mm, f_number: 2.8,
             shutter: 1/125 s, iso: 3200}
    camera: {type: thin_lens, focal_length: 35 mm, f_number: 8, shutter: 1/30 s, exposure: auto,
             sensor: {format: aps_c, noise: true, full_well: 30000, read_noise: 2.5, bit_depth: 12, bayer: rggb}}

A value of 1 at the base ISO is a full well; at a speed of n times that it is the n-th part of it, which the amplifier
takes to the converter's largest number.  With mu electrons expected, F of them at a value of 1:

    electrons  N = min(Poisson(mu), full well) + Normal(0, read noise)
    number     D = round(black + (white - black) N / F), from 0 to white = 2^bits - 1
    value      (D - black) / (white - black)

so a value v has the variance v / F + (read noise / F)^2 + 1 / (12 (white - black)^2).

References: EMVA Standard 1288, release 4.0 (2021), "Linear Model", sec. 2; Janesick 2007, "Photon Transfer", ch. 3.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.errors import InputError
from raytracer.film.exposure import Frame
from raytracer.sensors import SensorSpec

Floats = NDArray[np.float64]

_STREAM = int.from_bytes(b"sensor")
"""Tells the sensor's random numbers from others that are drawn with the same seed."""

_MANY_ELECTRONS = 100.0

_LEAST_UNIFORM, _GREATEST_UNIFORM = 2.0**-54, 1.0 - 2.0**-53
"""Uniform numbers whose quantiles are finite: half a step of theirs above 0, and the last float64 below 1."""

_MISSING = "a sensor with a Bayer mosaic needs OpenCV, which is not installed: pip install 'raytracer[bayer]'"
_LARGEST_NUMBER = 65535
_SMALLEST_MOSAIC = 3


class Response(NamedTuple):
    """What a sensor makes of light at some ISO speed.

    saturation : electrons of the value 1; full_well and read_noise, in electrons; white and black, the numbers that the
        converter gives for the values 1 and 0.
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
    def most(self) -> float:
        """The largest value: that of a full well, where a picture is made darker than the base ISO would."""
        return min(1.0, self.full_well / self.saturation)

    def variance(self, values: Floats) -> Floats:
        """Variance that the sensor adds to expected `values` of any shape, none below 0, where nothing is clipped."""
        rounding = 1.0 / (12.0 * (self.white - self.black) ** 2)
        return np.asarray(values / self.saturation + (self.read_noise / self.saturation) ** 2 + rounding)

    def values(self, numbers: Any) -> Floats:
        """Values of the converter's numbers, of any shape."""
        return np.asarray((numbers - float(self.black)) / (self.white - self.black))


class Recorded(NamedTuple):
    """What a sensor has recorded.

    values : float64 (height, width, 3), of at most 1.
    variance : that of the sensor's noise, alike; None where it is not known, which is behind a Bayer mosaic.
    saturated : bool (height, width), where all channels are as large as they can be.
    """

    values: Floats
    variance: Floats | None
    saturated: NDArray[np.bool_]


def response(sensor: SensorSpec, speed: float | None) -> Response:
    """What a sensor does at an ISO speed; at its base ISO if that is not known."""
    gain = 1.0 if speed is None else speed / sensor.base_iso
    return Response(sensor.full_well / gain, sensor.full_well, sensor.read_noise, sensor.white(), sensor.black())


def require_demosaic() -> None:
    """Make sure, before an image is rendered, that a Bayer mosaic can be turned into a picture.

    Raises
    ------
    InputError : the extra is not installed, or does not run on this machine.
    """
    _opencv()


def require_size(height: int, width: int) -> None:
    """Make sure that a mosaic of height x width pixels can be turned into a picture.

    Raises
    ------
    InputError : it has fewer than 3 pixels a side.
    """
    if min(height, width) < _SMALLEST_MOSAIC:
        raise InputError(
            f"a Bayer mosaic needs a picture of at least {_SMALLEST_MOSAIC} x {_SMALLEST_MOSAIC} pixels, "
            f"got {width} x {height}: make it larger, or leave out camera.sensor.bayer"
        )


def _opencv() -> Any:
    try:
        import cv2
    except ImportError as error:
        raise InputError(_MISSING) from error
    return cv2


# ---- Random numbers


def _draws(seed: int, frame: Frame, height: int, width: int) -> tuple[Floats, Floats]:
    """Uniform and normal numbers (height, width, 3) of the pixels of a part of the frame.

    They belong to the pixels of the frame, so that a part has those that it has in the whole.
    """
    uniform, normal = np.empty((height, width, 3)), np.empty((height, width, 3))
    part = slice(frame.left, frame.left + width)
    for row in range(height):
        key = np.random.SeedSequence(entropy=seed, spawn_key=(_STREAM, frame.top + row))
        generator = np.random.Generator(np.random.PCG64(key))
        uniform[row] = generator.random((frame.width, 3))[part]
        normal[row] = generator.standard_normal((frame.width, 3))[part]
    return uniform, normal


def poisson_quantile(uniform: Floats, mean: Floats) -> Floats:
    """The least whole k with P(X <= k) >= `uniform`, X being Poisson distributed with `mean`; shapes are alike.

    For a mean of 100 and more an expansion takes the place of the exact sum: one in ten thousand results is then off
    by one.

    References: Giles 2016, "Algorithm 955: Approximation of the Inverse Poisson Cumulative Distribution Function",
        ACM Trans. Math. Softw. 42(1) (the expansion about the normal distribution).
    """
    from scipy.special import ndtri, pdtrik

    u = np.clip(uniform, _LEAST_UNIFORM, _GREATEST_UNIFORM)
    result = np.zeros_like(mean)
    few = (mean > 0.0) & (mean < _MANY_ELECTRONS)
    result[few] = np.ceil(pdtrik(u[few], mean[few]))
    many = mean >= _MANY_ELECTRONS
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


# ---- Recording


def record(values: Floats, sensor: SensorSpec, speed: float | None, seed: int, frame: Frame) -> Recorded:
    """What a sensor records of exposed `values` (height, width, 3), which are a part of `frame`.

    Parameters
    ----------
    speed : ISO speed, from which on `values` are 1 where the sensor saturates; None if not known.
    seed : of the noise, if the sensor has none of its own.

    Raises
    ------
    InputError : a Bayer mosaic of fewer than 3 pixels a side, or without the library that makes a picture of it.
    """
    height, width, _ = values.shape
    sensor_response = response(sensor, speed)
    uniform, normal = _draws(seed if sensor.seed is None else sensor.seed, frame, height, width)
    if sensor.bayer is not None:
        colors = _colors(sensor.bayer, frame, height, width)
        values, uniform, normal = (np.take_along_axis(a, colors, axis=2) for a in (values, uniform, normal))

    # What is far beyond the full well fills it for certain, and would be too large a number.
    most = (2.0 * sensor_response.full_well + 1e3) / sensor_response.saturation
    values = np.clip(np.nan_to_num(values, posinf=most), 0.0, most)
    expected = sensor_response.saturation * values
    caught = np.minimum(poisson_quantile(uniform, expected), sensor_response.full_well)
    signal = caught + sensor_response.read_noise * normal
    numbers = np.clip(np.rint(sensor_response.black + sensor_response.scale * signal), 0, sensor_response.white)
    # Below the base ISO a well is full before the numbers end.
    full = np.asarray((caught >= sensor_response.full_well) | (numbers >= sensor_response.white))
    if sensor.bayer is None:
        return Recorded(sensor_response.values(numbers), sensor_response.variance(values), np.all(full, axis=2))
    developed = _demosaiced(numbers[..., 0], sensor.bayer, sensor_response.white, frame)
    return Recorded(sensor_response.values(developed), None, _around(full[..., 0]))


# ---- Mosaic


def _pattern(bayer: str, frame: Frame) -> NDArray[np.str_]:
    """The colours (2, 2), as letters, of the first two rows and columns of a part of the frame."""
    return np.roll(np.array(list(bayer)).reshape(2, 2), (-frame.top, -frame.left), axis=(0, 1))


def _colors(bayer: str, frame: Frame, height: int, width: int) -> NDArray[np.intp]:
    """Which channel each pixel of a part of the frame records, (height, width, 1)."""
    tile = np.vectorize("rgb".index, otypes=[np.intp])(_pattern(bayer, frame))
    return np.asarray(np.tile(tile, ((height + 1) // 2, (width + 1) // 2))[:height, :width, None])


def _demosaiced(numbers: Floats, bayer: str, white: int, frame: Frame) -> Floats:
    """The picture (height, width, 3) of a mosaic of numbers (height, width): what is missing follows the edges.

    References: https://docs.opencv.org/4.x/d8/d01/group__imgproc__color__conversions.html, "Edge-Aware Demosaicing".
    """
    cv2 = _opencv()
    require_size(*numbers.shape)
    # As many bits as there are, lest a mean of whole numbers is rounded more than they are.
    steps = _LARGEST_NUMBER // white
    name = "".join(_pattern(bayer, frame).ravel()).upper()
    code = getattr(cv2, f"COLOR_Bayer{name}2RGB_EA")
    return np.asarray(cv2.demosaicing((steps * numbers).astype(np.uint16), code), dtype=np.float64) / steps


def _around(full: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Where all nine pixels of a neighbourhood are full, and so all colours of its middle."""
    padded = np.pad(full, 1, mode="edge")
    height, width = full.shape
    shifted = [padded[y : y + height, x : x + width] for y in range(3) for x in range(3)]
    return np.asarray(np.logical_and.reduce(shifted))
