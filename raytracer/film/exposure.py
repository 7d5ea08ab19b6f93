"""Exposure: metering, and the gain from light on the film to values in which 1 saturates the sensor.

In a scene:

    camera: {type: thin_lens, sensor: full_frame, focal_length: 50 mm, f_number: 2.8, shutter: 1/125 s, iso: 400}
    camera: {type: thin_lens, sensor: full_frame, focal_length: 50 mm, f_number: 2.8, shutter: 1/125 s,
             exposure: {metering: spot, at: [0.3, 0.5]}, exposure_compensation: -1}

References: ISO 12232:2019, "Photography - Digital still cameras - Determination of exposure index, ISO speed ratings,
    standard output sensitivity, and recommended exposure index": saturation-based speed, S_sat = 78 / H_sat, and
    standard output sensitivity, S_SOS = 10 / H_m, with exposures H in lx s.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.fresnel import REC709_LUMINANCE
from raytracer.optics.thin_lens import (
    MEAN_EXPOSURE,
    SATURATION_EXPOSURE,
    WHITE_EFFICACY,
    ExposureSettings,
    Metering,
    exposure_value,
)
from raytracer.util.errors import InputError

FloatArray = NDArray[np.float64]

METERED_VALUE = MEAN_EXPOSURE / SATURATION_EXPOSURE
"""Value to which metering exposes the mean that it measures: 10 / 78 of saturation."""

_CENTRE_WEIGHT = 0.75
_CENTRE_DIAMETER = 0.5
_UNMETERED_ISO = 100.0

# Smaller values count as black: their reciprocals may not be finite.
_TINY = float(np.finfo(np.float64).tiny)


class CropWindow(NamedTuple):
    """A part of a picture.

    width, height (px) : of the whole picture.
    left, top (px) : place of the top left pixel of the part.
    view (px) : width and height of each of the views that the picture is made of, side by side; None for a single one.
    """

    width: int
    height: int
    left: int
    top: int
    view: tuple[int, int] | None = None

    @property
    def size(self) -> tuple[int, int]:
        """Width and height (px) of the picture of one camera."""
        return self.view or (self.width, self.height)


class ExposureResult(NamedTuple):
    """The exposure of a picture.

    gain : factor of the light on the film; 1 is then the sensor's saturation.
    iso : ISO speed, given or chosen by metering; None where aperture or shutter are not known.
    metered : mean luminance that was measured, in the unit of the film; None if none was.
    exposure : settings of the camera.
    """

    gain: float
    iso: float | None
    metered: float | None
    exposure: ExposureSettings

    @property
    def ev100(self) -> float | None:
        """Exposure value of f-number, time and speed; None where one of them is not known."""
        n, seconds = self.exposure.f_number, self.exposure.seconds
        if n is None or seconds is None or self.iso is None or math.isinf(n):
            return None
        return exposure_value(n, seconds, self.iso)

    @property
    def iso_speed(self) -> float | None:
        """ISO speed that the picture is developed at: `iso`, pushed by the compensation."""
        return None if self.iso is None else self.iso * math.exp2(self.exposure.compensation)

    def as_dict(self) -> dict[str, float]:
        """List the known values by name, for headers and statistics."""
        values = {
            "iso": self.iso,
            "f_number": self.exposure.f_number,
            "shutter_seconds": self.exposure.seconds,
            "exposure_compensation": self.exposure.compensation,
            "ev100": self.ev100,
            "exposure_gain": self.gain,
        }
        return {name: value for name, value in values.items() if value is not None and math.isfinite(value)}

    def summary(self) -> str:
        """Describe the exposure, as in `ISO 400, f/2.8, 1/125 s, EV100 7.9, metered by spot`."""
        n, seconds, metering = self.exposure.f_number, self.exposure.seconds, self.exposure.metering
        parts = [f"light times {self.gain:.4g}" if self.iso is None else f"ISO {_format_number(self.iso)}"]
        if n is not None and math.isfinite(n):
            parts.append(f"f/{_format_number(n)}")
        if seconds is not None:
            parts.append(
                f"1/{_format_number(1.0 / seconds)} s" if 0.0 < seconds < 0.5 else f"{_format_number(seconds)} s"
            )
        if self.ev100 is not None:
            parts.append(f"EV100 {self.ev100:.2f}")
        if self.exposure.compensation:
            parts.append(f"compensated by {self.exposure.compensation:+.4g} EV")
        if metering is not None:
            black = "" if (self.metered or 0.0) >= _TINY else ", and found black"
            parts.append(f"metered by {metering.mode}{black}")
            if self.iso is not None and self.exposure.base_iso == self.iso_speed:
                parts.append("as slow as the sensor is")
        return ", ".join(parts)


def _format_number(number: float) -> str:
    """Format a positive number with at least four digits, and without an exponent if it is large."""
    return f"{number:.0f}" if number >= 1000.0 else f"{number:.4g}"


def luminance(values: FloatArray) -> FloatArray:
    """Compute the luminance (...) of linear Rec. 709 values (..., 3), in their unit."""
    return np.asarray(values @ np.array(REC709_LUMINANCE))


# ---- Metering


def _pixel_distances(x: float, y: float, frame: CropWindow, height: int, width: int) -> FloatArray:
    """Compute the distances (height, width), in pixels, of pixels' middles from (x, y), in fractions of their view."""
    wide, high = frame.size
    across = (frame.left + np.arange(width)) % wide + 0.5 - x * wide
    down = (frame.top + np.arange(height)) % high + 0.5 - y * high
    return np.asarray(np.hypot(across, down[:, None]))


def _nearest_pixel(x: float, y: float, frame: CropWindow) -> float:
    """Compute the distance (px) of the nearest pixel's middle in a whole view from (x, y), in fractions of the view."""

    def apart(place: float, size: int) -> float:
        position = place * size
        return abs(min(math.floor(position), size - 1) + 0.5 - position)

    wide, high = frame.size
    return math.hypot(apart(x, wide), apart(y, high))


def metering_weights(metering: Metering, frame: CropWindow, height: int, width: int) -> FloatArray:
    """Compute the weights of metering of the pixels of a part of the frame, (height, width), whose sum is 1.

    `mean`: equal weights.  `spot`: pixels in a circle.  `center_weighted`: three quarters for a circle in the middle of
    half the frame's shorter side, and one quarter for its surroundings, as Nikon's cameras have it (12 mm of 24 mm).  A
    circle so small that no pixel's middle lies in it takes the nearest.  Each of several views has its own circle.

    References: Nikon, "D750 User's Manual": "Metering" (the circle) and "Specifications" (its weight of 75 %).

    Raises InputError: the spot lies outside of the part.
    """
    if metering.mode == "mean":
        return np.full((height, width), 1.0 / (height * width))
    is_spot = metering.mode == "spot"
    x, y = (metering.x, metering.y) if is_spot else (0.5, 0.5)
    diameter = (metering.size if is_spot else _CENTRE_DIAMETER) * min(frame.size)
    apart = _pixel_distances(x, y, frame, height, width)
    rounding = 1.0 + 8.0 * np.finfo(np.float64).eps
    inside = apart <= rounding * max(0.5 * diameter, _nearest_pixel(x, y, frame))
    count = int(inside.sum())
    if is_spot:
        if count == 0:
            raise InputError("the metering spot lies outside of the crop: move it there with exposure.at, or give iso")
        return np.asarray(inside / count)
    outside = height * width - count
    if count == 0 or outside == 0:
        return np.full((height, width), 1.0 / (height * width))
    return np.where(inside, _CENTRE_WEIGHT / count, (1.0 - _CENTRE_WEIGHT) / outside)


def meter_luminance(values: FloatArray, metering: Metering, frame: CropWindow) -> float:
    """Meter the mean luminance of linear values (height, width, 3), in their unit; raises as `metering_weights`."""
    height, width, _ = values.shape
    return float((metering_weights(metering, frame, height, width) * luminance(values)).sum())


# ---- Gain


def saturation_gain(seconds: float, iso: float, compensation: float = 0.0) -> float:
    """Compute the exposed value of 1 W/m2 on the sensor: K t S / 78 2^compensation, with K = 179 lm/W.

    H_sat = 78 / S is the exposure (lx s) with which a sensor of ISO speed S saturates: ISO 12232:2019, saturation-based
    ISO speed.
    """
    return WHITE_EFFICACY * seconds * iso / SATURATION_EXPOSURE * math.exp2(compensation)


def resolve_exposure(exposure: ExposureSettings, values: FloatArray, frame: CropWindow) -> ExposureResult:
    """Find the exposure for the light on a film, `values` (height, width, 3).

    Metering chooses the ISO speed with which, without compensation, the metered luminance is 10 / 78 of saturation.
    The speed of a simulated sensor is at least its base ISO, compensation included: the picture may then be
    overexposed.  If aperture or shutter are not known, there is no speed, and the gain is chosen in the same way.  A
    black picture gets ISO 100, or a gain of 1.

    Raises ValueError: a speed is given, and aperture or shutter are not known.
    Raises InputError: see `metering_weights`.
    """
    seconds = exposure.seconds if exposure.radiometric else None
    if exposure.iso is not None:
        if seconds is None:
            raise ValueError("an ISO speed says nothing without the aperture and the time of the exposure")
        return ExposureResult(
            saturation_gain(seconds, exposure.iso, exposure.compensation), exposure.iso, None, exposure
        )

    assert exposure.metering is not None
    push = math.exp2(exposure.compensation)
    metered = meter_luminance(values, exposure.metering, frame)
    if seconds is None:
        return ExposureResult(METERED_VALUE / metered * push if metered >= _TINY else push, None, metered, exposure)
    at_iso_1 = metered * saturation_gain(seconds, 1.0)
    iso = METERED_VALUE / at_iso_1 if at_iso_1 >= _TINY else _UNMETERED_ISO
    if exposure.base_iso is not None:
        iso = max(iso, exposure.base_iso / push)
    return ExposureResult(saturation_gain(seconds, iso, exposure.compensation), iso, metered, exposure)
