"""What happens to a picture after its light is gathered: exposure, the sensor, white balance, and a tone curve.

Only what a scene asks for happens; a picture of plain radiance keeps its bits.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.film.exposure import Frame, Setting, metering_weights, settle
from raytracer.film.image import Image
from raytracer.film.sensor import record, require_demosaic, require_size, response
from raytracer.film.tone import ToneCurveSpec
from raytracer.film.white_balance import AUTO, WhiteBalance, gains
from raytracer.photography import Exposure
from raytracer.sensors import SensorSpec

RADIANCE, SQUARE = "W/(m2 sr)", "(W/(m2 sr))2"
"""Units of layers that are light, and of those that are variances of light."""


class Process(NamedTuple):
    """How a picture is to be developed.

    exposure : what the camera says of it; None for radiance as it is.
    sensor : that which is simulated, if one is.
    white_balance : see `white_balance.gains`; None for none.
    tone_curve : how the picture is shown.
    """

    exposure: Exposure | None
    sensor: SensorSpec | None
    white_balance: WhiteBalance | None
    tone_curve: ToneCurveSpec


def check_process(process: Process, frame: Frame, height: int, width: int) -> None:
    """Make sure, before an image is rendered, that a part of height x width pixels of the frame can be developed.

    Raises
    ------
    InputError : a metering spot outside of the part, a Bayer mosaic without its library, or of too few pixels.
    """
    if process.exposure is not None and process.exposure.metering is not None:
        metering_weights(process.exposure.metering, frame, height, width)
    if process.sensor is not None and process.sensor.bayer is not None:
        require_demosaic()
        require_size(height, width)


def photograph(
    image: Image, process: Process, frame: Frame, seed: int, units: Mapping[str, str]
) -> tuple[Image, Setting | None]:
    """The picture of a process, and how it was exposed, if it was.

    Parameters
    ----------
    image : light as the film has gathered it, a part of `frame`.
    seed : of the sensor's noise, if the sensor has none of its own.
    units : of the image's layers by name; light and variances of light are multiplied as the picture is.

    Raises
    ------
    InputError : see `check_process`.
    """
    setting = None if process.exposure is None else settle(process.exposure, image.radiance, frame)
    curve = process.tone_curve.curve(saturates=process.sensor is not None)
    if curve is not None:
        settings = {**image.settings, "tone_curve": f"filmic, white {curve.white:g}, in display files only"}
        image = replace(image, tone_curve=curve, settings=settings)
    if setting is None and process.white_balance is None:
        return image, None

    # Light is balanced after the sensor, and the light that is balanced for is told before it.
    exposed = image.radiance if setting is None else setting.gain * image.radiance
    balance = np.ones(3) if process.white_balance is None else gains(process.white_balance, image.radiance)
    gain = balance if setting is None else setting.gain * balance
    variance = None if image.variance is None else gain**2 * image.variance
    if process.sensor is None or setting is None:
        values = balance * exposed
    else:
        recorded = record(exposed, process.sensor, setting.speed, seed, frame)
        values = balance * recorded.values
        # What saturates all channels is at least so bright, and has no colour.
        values[recorded.saturated] = balance.max() * response(process.sensor, setting.speed).most
        if recorded.variance is None or variance is None:
            variance = None
        else:
            variance = variance + balance**2 * recorded.variance

    layers = {name: _scaled(layer, gain, units.get(name, "")) for name, layer in image.layers.items()}
    if variance is not None and "variance" in layers:
        layers["variance"] = variance
    settings = {**image.settings, **_header(process, setting, balance, seed)}
    return replace(image, radiance=values, variance=variance, layers=layers, settings=settings), setting


def _scaled(layer: NDArray[Any], gain: NDArray[np.float64], unit: str) -> NDArray[Any]:
    """A layer as the picture is exposed and balanced, if it holds light."""
    powers = {RADIANCE: gain, SQUARE: gain**2}
    return layer * powers[unit] if unit in powers else layer


def _header(
    process: Process, setting: Setting | None, balance: NDArray[np.float64], seed: int
) -> dict[str, str | float | int]:
    """What the headers of files tell of the process."""
    header: dict[str, str | float | int] = {} if setting is None else {**setting.numbers()}
    if setting is not None and setting.exposure.metering is not None:
        header["metering"] = setting.exposure.metering.mode
    if process.white_balance is not None:
        if process.white_balance == AUTO:
            header["white_balance"] = AUTO
        header["white_balance_gains"] = ",".join(f"{float(gain)!r}" for gain in balance)
    if process.sensor is not None and setting is not None:
        sensor = process.sensor
        of_light = response(sensor, setting.speed)
        header |= {
            "sensor": f"{sensor.full_well:g} electrons at ISO {sensor.base_iso:g}, read noise {sensor.read_noise:g}, "
            f"{sensor.bit_depth} bits from {of_light.black}" + (f", {sensor.bayer}" if sensor.bayer else ""),
            "sensor_electrons": of_light.saturation,
            "sensor_seed": seed if sensor.seed is None else sensor.seed,
        }
    return header
