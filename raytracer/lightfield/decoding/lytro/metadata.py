"""Metadata of a photograph: its pixels, its colours and the camera's optics.

Lengths in the files are metres.  The keys of the first camera (F01) and of the Illum differ in places; both are known.

References: the public schemas' keys, as files of both cameras in the tests of imageio show them (tests/test_lytro.py);
J. Kucera (miloush), "Lytro Compatible Library", metadata (units, directions); D. Dansereau, LFToolbox, LFReadLFP and
LFUtilProcessWhiteImages (zoom and focus steps of white pictures).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.lightfield.decoding.raw_image import BAYER
from raytracer.util.errors import one_line
from raytracer.util.safe_open import BrokenFileError

FILTERS = ("r", "gr", "gb", "b")
"""Colour filters: red, green in the rows of red, green in the rows of blue, and blue."""

_LARGEST_SIDE, _LARGEST_NUMBER = 1 << 16, 1e12
_LARGEST_SHIFT, _LARGEST_CODE = 15, 65535.0
_WORD_BITS = 16
_MATRIX = 9


@dataclass(frozen=True)
class LensState:
    """The main lens at the time of the photograph; None where the metadata do not say.

    focal_length (m), f_number : of the lens.
    zoom_step, focus_step : of its motors.
    infinity_lambda : distance by which the sensor lies behind the image of infinity, over f-number and pitch of the
        microlenses.
    exit_pupil (m) : distance of the exit pupil from the microlenses.
    """

    focal_length: float | None
    f_number: float | None
    zoom_step: float | None
    focus_step: float | None
    infinity_lambda: float | None
    exit_pupil: float | None


@dataclass(frozen=True)
class MicrolensState:
    """The sensor and its microlenses; None where the metadata do not say.

    pixel_pitch (m) : of the sensor.
    pitch (m) : of the microlenses.
    distance (m) : from the microlenses to the sensor.
    """

    pixel_pitch: float | None
    pitch: float | None
    distance: float | None


@dataclass(frozen=True)
class PhotoMetadata:
    """Metadata of one photograph.

    width, height (px) : of the raw picture.
    bits, endianness, shift : of its codes: bits each takes, order of bytes, and bits to shift them right by.
    bayer : colours of the filters on the first two pixels of the first two rows, as `rggb`; None without filters.
    black, white : codes without light, and of the most light, of each of `FILTERS`.
    gains : of red, green and blue, that make neutral things neutral; None if not known.
    matrix : 3 x 3, from these colours to linear sRGB; None if not known.
    orientation : as in EXIF; 1 is upright.
    lens, microlenses : the optics.
    exposure (s) : time for which a pixel gathered light; None if not known.
    camera, serial, time : names of the camera, its serial number, and when it was taken; empty if not known.
    """

    width: int
    height: int
    bits: int
    endianness: str
    shift: int
    bayer: str | None
    black: tuple[float, ...]
    white: tuple[float, ...]
    gains: tuple[float, float, float] | None
    matrix: NDArray[np.float64] | None
    orientation: int
    lens: LensState
    microlenses: MicrolensState
    exposure: float | None
    camera: str
    serial: str
    time: str

    @property
    def spare_bits(self) -> int:
        """Bits by which codes are shifted to the left where they fill 16, as in the files of other programs."""
        return max(0, _WORD_BITS - self.bits + self.shift)

    def filter_levels(self, levels: tuple[float, ...]) -> NDArray[np.float32]:
        """Arrange numbers of the four filters as these lie on the first two rows and columns: (2, 2)."""
        if self.bayer is None:
            return np.full((2, 2), levels[1], np.float32)
        named = dict(zip(FILTERS, levels, strict=True))
        numbers = []
        for row in (self.bayer[:2], self.bayer[2:]):
            green = "gr" if "r" in row else "gb"
            numbers.append([named[green if color == "g" else color] for color in row])
        return np.array(numbers, np.float32)


class _Fields:
    """Values of a JSON object by dotted keys, of which each is checked; None for what is missing or null."""

    def __init__(self, values: Mapping[str, Any]) -> None:
        self._values = values

    def get(self, *keys: str) -> Any:
        """Return the value of the first key that there is."""
        for key in keys:
            value: Any = self._values
            for part in key.split("."):
                value = value.get(part) if isinstance(value, Mapping) else None
            if value is not None:
                return value
        return None

    def number(self, *keys: str) -> float | None:
        """Return a finite number."""
        value = self.get(*keys)
        if value is None:
            return None
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= _LARGEST_NUMBER:
            raise BrokenFileError(f"{keys[-1]}: must be a number, got {one_line(str(value)):.40}")
        return float(value)

    def positive(self, *keys: str) -> float | None:
        """Return a number greater than 0; None for 0, which stands for what was not measured."""
        value = self.number(*keys)
        if value is not None and value < 0.0:
            raise BrokenFileError(f"{keys[-1]}: must not be less than 0, got {value:g}")
        return value or None

    def integer(self, lowest: int, highest: int, otherwise: int | None, *keys: str) -> int:
        """Return an integer within limits."""
        value = self.number(*keys)
        if value is None and otherwise is not None:
            return otherwise
        if value is None:
            raise BrokenFileError(f"has no {keys[-1]} in its metadata: they are not of a raw picture")
        if value != math.floor(value) or not lowest <= value <= highest:
            raise BrokenFileError(f"{keys[-1]}: must be an integer from {lowest} to {highest}, got {value:g}")
        return int(value)

    def text(self, *keys: str) -> str:
        """Return a string, in one line; empty for what is missing."""
        value = self.get(*keys)
        if value is None:
            return ""
        if not isinstance(value, str):
            raise BrokenFileError(f"{keys[-1]}: must be a string")
        return one_line(value)[:200]

    def filters(self, otherwise: float, *keys: str) -> tuple[float, ...]:
        """Return a number for each of `FILTERS`."""
        base = next((key for key in keys if self.get(key) is not None), keys[0])
        numbers = [self.number(f"{base}.{name}") for name in FILTERS]
        return tuple(otherwise if number is None else number for number in numbers)


def read_metadata(values: Mapping[str, Any], private: Mapping[str, Any] | None = None) -> PhotoMetadata:
    """Read the metadata of a frame; `private` holds what cameras keep apart: the serial number.

    Raises
    ------
    BrokenFileError : they are not of a raw picture, or make no sense.
    """
    fields, secret = _Fields(values), _Fields(private or {})
    bits = fields.integer(1, 16, None, "image.rawDetails.pixelPacking.bitsPerPixel", "image.pixelPacking.bitsPerPixel")
    largest = float((1 << bits) - 1)
    black = fields.filters(0.0, "image.rawDetails.pixelFormat.black", "image.pixelFormat.black")
    white = fields.filters(largest, "image.rawDetails.pixelFormat.white", "image.pixelFormat.white")
    for name, low, high in zip(FILTERS, black, white, strict=True):
        if not 0.0 <= low < high <= _LARGEST_CODE:
            raise BrokenFileError(f"image.pixelFormat: black of {name}, {low:g}, must be less than white, {high:g}")
    return PhotoMetadata(
        width=fields.integer(1, _LARGEST_SIDE, None, "image.width"),
        height=fields.integer(1, _LARGEST_SIDE, None, "image.height"),
        bits=bits,
        endianness=fields.text("image.rawDetails.pixelPacking.endianness", "image.pixelPacking.endianness"),
        shift=fields.integer(
            0, _LARGEST_SHIFT, 0, "image.rawDetails.pixelFormat.rightShift", "image.pixelFormat.rightShift"
        ),
        bayer=_read_bayer(fields),
        black=black,
        white=white,
        gains=_read_gains(fields),
        matrix=_read_matrix(fields),
        orientation=fields.integer(1, 8, 1, "image.orientation"),
        lens=LensState(
            focal_length=fields.positive("devices.lens.focalLength"),
            f_number=fields.positive("devices.lens.fNumber"),
            zoom_step=fields.number("devices.lens.zoomStep"),
            focus_step=fields.number("devices.lens.focusStep"),
            infinity_lambda=fields.number("devices.lens.infinityLambda"),
            exit_pupil=fields.number("devices.lens.exitPupilOffset.z") or None,
        ),
        microlenses=MicrolensState(
            pixel_pitch=fields.positive("devices.sensor.pixelPitch"),
            pitch=fields.positive("devices.mla.lensPitch"),
            distance=fields.positive("devices.mla.sensorOffset.z"),
        ),
        exposure=fields.positive("devices.shutter.pixelExposureDuration", "devices.shutter.frameExposureDuration"),
        camera=" ".join(filter(None, (fields.text("camera.make"), fields.text("camera.model")))),
        serial=secret.text("camera.serialNumber") or fields.text("camera.serialNumber"),
        time=fields.text("devices.clock.zuluTime"),
    )


def _read_bayer(fields: _Fields) -> str | None:
    """Read the order of the colour filters: a tile of two rows, of which one pixel is said to be the first."""
    places = ("image.rawDetails.mosaic", "image.mosaic", "devices.sensor.mosaic")
    tile = fields.text(*(f"{place}.tile" for place in places))
    first = fields.text(*(f"{place}.upperLeftPixel" for place in places))
    if tile in ("", "monochrome"):
        return None
    rows = [row.split(",") for row in tile.lower().split(":")]
    names = [name.strip() for row in rows for name in row]
    if [len(row) for row in rows] != [2, 2] or sorted(names) != sorted(FILTERS) or first.lower() not in names:
        raise BrokenFileError(f"mosaic: the colour filters {tile!r}, from {first!r} on, are not known")
    at = names.index(first.lower())
    order = "".join(names[(row ^ at // 2) * 2 + (column ^ at % 2)][0] for row in (0, 1) for column in (0, 1))
    if order not in BAYER:
        raise BrokenFileError(f"mosaic: the colour filters {tile!r} are not those of Bayer")
    return order


def _read_gains(fields: _Fields) -> tuple[float, float, float] | None:
    """Read the gains of red, green (the mean of both) and blue."""
    key = "image.color.whiteBalanceGain"
    if fields.get(key) is None:
        return None
    red, red_green, blue_green, blue = fields.filters(1.0, key)
    gains = (red, 0.5 * (red_green + blue_green), blue)
    if min(gains) <= 0.0:
        raise BrokenFileError(f"{key}: must be greater than 0")
    return gains


def _read_matrix(fields: _Fields) -> NDArray[np.float64] | None:
    """Read the colour matrix, whose rows make red, green and blue."""
    key = "image.color.ccmRgbToSrgbArray"
    values = fields.get("image.color.ccm", key)
    if values is None:
        return None
    if not isinstance(values, list) or len(values) != _MATRIX:
        raise BrokenFileError(f"{key}: must be {_MATRIX} numbers")
    numbers = [_Fields({"number": value}).number("number") for value in values]
    if None in numbers:
        raise BrokenFileError(f"{key}: must be {_MATRIX} numbers")
    return np.array(numbers, np.float64).reshape(3, 3)
