"""Numbers with units, and indices of refraction with the names of glasses."""

import math
import typing
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from raytracer.optics.glass import MAX_INDEX, parse_glass
from raytracer.schema.fields import MAX_MAGNITUDE, Quantity
from raytracer.schema.units import Dimension, parse_quantity
from raytracer.schema.yaml_parser import parse
from raytracer.util.errors import InputError

DICTIONARY = tuple(
    word.encode()
    for word in (
        *(
            "1/125 s",
            "50 mm",
            "deg/s",
            "µm",
            "°",
            "inf",
            ".inf",
            "1e400",
            "-0",
            "/0",
            "N-BK7",
            "{index: 1.5, abbe: 60}",
        ),
        *("{cauchy: [1.5, 0.004]}", "{sellmeier: {b: [1], c: [0.01]}}", "turn/s", "rpm", "mph", "٣"),
    )
)

_DIMENSIONS = typing.get_args(Dimension)


def seeds() -> Iterator[bytes]:
    for number, text in enumerate(
        ("2 ft", "1/3 cm", "550 nm", "0.3 rad", "1/125 s", "30 km/h", "300 rpm", "10 Hz", "1 K", "1/3")
    ):
        yield bytes((number,)) + text.encode()
    for text in (
        "N-BK7",
        "1.5",
        "{index: 1.5, abbe: 60}",
        "{cauchy: [1.5, 0.004]}",
        "{sellmeier: {b: [1.1], c: [0.01]}}",
    ):
        yield b"\xff" + text.encode()


def run(data: bytes, folder: Path) -> None:
    text = data[1:].decode("utf-8", errors="replace")
    try:
        if data[:1] == b"\xff":
            root = parse(text, "glass")
            _check_glass(None if root is None else root.plain())
        else:
            dimension = _DIMENSIONS[(data[0] if data else 0) % len(_DIMENSIONS)]
            assert not math.isnan(parse_quantity(text, dimension))
            number = Quantity(dimension)(text)
            assert number == 0.0 or 1.0 / MAX_MAGNITUDE <= abs(number) <= MAX_MAGNITUDE
    except ValueError as error:
        raise InputError(str(error)) from None


def _check_glass(value: object) -> None:
    waves = np.arange(360.0, 831.0)
    ior = parse_glass(value).ior(waves)
    assert np.isfinite(ior).all()
    assert ((ior > 0.0) & (ior <= MAX_INDEX)).all()
