"""Development of a photograph: exposure, sensor simulation, white balance and tone curve.

Only the steps that a scene asks for are applied; a picture of plain radiance keeps its bits.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.film.exposure import CropWindow, ExposureResult, metering_weights, resolve_exposure
from raytracer.film.image import Image
from raytracer.film.sensor_response import make_response, require_demosaic, require_mosaic_size, simulate_readout
from raytracer.film.tone import ToneCurveSpec
from raytracer.film.white_balance import AUTO, WhiteBalance, balance_gains
from raytracer.optics.sensor_formats import SensorSpec
from raytracer.optics.thin_lens import ExposureSettings

RADIANCE, RADIANCE_SQUARED = "W/(m2 sr)", "(W/(m2 sr))2"
"""Units of layers that are light, and of those that are variances of light."""


class DevelopSettings(NamedTuple):
    """Settings of the development of a picture.

    exposure : settings of the camera; None for radiance as it is.
    sensor : to simulate; None for none.
    white_balance : see `white_balance.balance_gains`; None for none.
    tone_curve : for display files.
    """

    exposure: ExposureSettings | None
    sensor: SensorSpec | None
    white_balance: WhiteBalance | None
    tone_curve: ToneCurveSpec


def check_develop_settings(process: DevelopSettings, frame: CropWindow, height: int, width: int) -> None:
    """Check, before an image is rendered, that a part of height x width pixels of the frame can be developed.

    Raises InputError: a metering spot outside of the part, a Bayer mosaic without its library, or of too few pixels.
    """
    if process.exposure is not None and process.exposure.metering is not None:
        metering_weights(process.exposure.metering, frame, height, width)
    if process.sensor is not None and process.sensor.bayer is not None:
        require_demosaic()
        require_mosaic_size(height, width)


def develop_photograph(
    image: Image, process: DevelopSettings, frame: CropWindow, seed: int, units: Mapping[str, str]
) -> tuple[Image, ExposureResult | None]:
    """Develop a picture; also return its exposure, if it was exposed.

    image : radiance or irradiance of the film, a part of `frame`.
    seed : of the sensor's noise, if the sensor has none of its own.
    units : of the image's layers by name; layers of light and of variances of light are scaled as the picture is.

    Raises InputError: see `check_develop_settings`.
    """
    setting = None if process.exposure is None else resolve_exposure(process.exposure, image.radiance, frame)
    curve = process.tone_curve.curve(saturates=process.sensor is not None)
    if curve is not None:
        settings = {**image.settings, "tone_curve": f"filmic, white {curve.white:g}, in display files only"}
        image = replace(image, tone_curve=curve, settings=settings)
    if setting is None and process.white_balance is None:
        return image, None

    # White balance is applied after the sensor, with gains that are found before it.
    exposed = image.radiance if setting is None else setting.gain * image.radiance
    balance = np.ones(3) if process.white_balance is None else balance_gains(process.white_balance, image.radiance)
    gain = balance if setting is None else setting.gain * balance
    variance = None if image.variance is None else gain**2 * image.variance
    if process.sensor is None or setting is None:
        values = balance * exposed
    else:
        recorded = simulate_readout(exposed, process.sensor, setting.iso_speed, seed, frame)
        values = balance * recorded.values
        # A pixel that saturates all channels is at least so bright, and has no colour.
        values[recorded.saturated] = balance.max() * make_response(process.sensor, setting.iso_speed).max_value
        if recorded.variance is None or variance is None:
            variance = None
        else:
            variance = variance + balance**2 * recorded.variance

    # Layers that hold light are scaled as the picture is exposed and balanced.
    powers = {RADIANCE: gain, RADIANCE_SQUARED: gain**2}
    layers = {
        name: layer * powers[units[name]] if units.get(name) in powers else layer
        for name, layer in image.layers.items()
    }
    if variance is not None and "variance" in layers:
        layers["variance"] = variance
    settings = {**image.settings, **_header_settings(process, setting, balance, seed)}
    return replace(image, radiance=values, variance=variance, layers=layers, settings=settings), setting


def _header_settings(
    process: DevelopSettings, setting: ExposureResult | None, balance: NDArray[np.float64], seed: int
) -> dict[str, str | float | int]:
    """List the settings of the process for the headers of files."""
    header: dict[str, str | float | int] = {} if setting is None else {**setting.as_dict()}
    if setting is not None and setting.exposure.metering is not None:
        header["metering"] = setting.exposure.metering.mode
    if process.white_balance is not None:
        if process.white_balance == AUTO:
            header["white_balance"] = AUTO
        header["white_balance_gains"] = ",".join(f"{float(gain)!r}" for gain in balance)
    if process.sensor is not None and setting is not None:
        sensor = process.sensor
        of_light = make_response(sensor, setting.iso_speed)
        header |= {
            "sensor": f"{sensor.full_well:g} electrons at ISO {sensor.base_iso:g}, read noise {sensor.read_noise:g}, "
            f"{sensor.bit_depth} bits from {of_light.black}" + (f", {sensor.bayer}" if sensor.bayer else ""),
            "sensor_electrons": of_light.saturation,
            "sensor_seed": seed if sensor.seed is None else sensor.seed,
        }
    return header
