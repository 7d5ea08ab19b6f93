"""Lens files of ours: YAML texts, and lenses put together from the schema; what is taken is finite.

An input that begins with a zero byte is taken for choices of the grammar, any other for a text.
"""

import contextlib
import math
import random
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from raytracer.optics.lens_system.first_order import cardinal_points
from raytracer.optics.lens_system.lens import Lens
from raytracer.optics.lens_system.prescription import LensSpec
from raytracer.scene.assets import read_lens
from raytracer.scene.json_schema import lens_schema
from raytracer.schema.validation_errors import first_error
from raytracer.schema.yaml_parser import parse
from raytracer.util.errors import InputError
from tests.fuzz.targets._grammar import Choices, Grammar, written

DICTIONARY = (
    b"name:",
    b"surfaces:",
    b"type: ",
    b"radius:",
    b"thickness:",
    b"aperture:",
    b"material:",
    b".inf",
    b".nan",
)

_BASES = (
    """\
name: doublet
source: nowhere
focal_length: 100
f_number: 4
coating: mgf2
focus: {moves: group, first: 1, last: 2}
surfaces:
  - {type: spherical, radius: 61.47, thickness: 6, material: N-BK7, aperture: 25}
  - {type: conic, radius: -44.6, conic: -0.5, thickness: 2.5, material: {index: 1.67, abbe: 32}, aperture: 25}
  - {type: asphere, radius: -129.9, coefficients: [1e-7, 1e-10], thickness: 3, aperture: 25}
  - {type: stop, thickness: 90, aperture: 20}
""",
    """\
name: anamorph
surfaces:
  - {type: cylindrical, axis: x, radius: 80, thickness: 4, material: {cauchy: [1.5, 0.004]}, aperture: 20, stop: true}
  - {type: flat, thickness: 20, material: 1, aperture: 20, coating: none}
  - {type: flat, thickness: 4, aperture: 20,
     material: {sellmeier: {b: [1.04, 0.23, 1.01], c: [0.006, 0.02, 103.6]}}}
  - {type: spherical, radius: -60 mm, thickness: 1 cm, aperture: 20}
""",
)


@cache
def _grammar() -> tuple[Grammar, list[Any]]:
    roots = [parse(text, "base") for text in _BASES]
    return Grammar(lens_schema(), {"material": ("N-BK7", "F2", "air", "N-BK8")}, {}), [
        root.plain() for root in roots if root is not None
    ]


def seeds() -> Iterator[bytes]:
    for text in _BASES:
        yield text.encode()
    chance = random.Random(1)
    for length in (20, 50, 100, 200) * 4:
        seed = b"\0" + chance.randbytes(length)
        with contextlib.suppress(InputError):
            check(lens_of(_text(seed[1:])))
            yield seed


def _text(data: bytes) -> str:
    grammar, bases = _grammar()
    choices = Choices(data)
    if choices.byte() % 8 == 0:
        return written(grammar.value(choices))
    values = choices.one_of(bases)
    for _ in range(1 + choices.byte() % 3):
        values = grammar.changed(values, choices)
    return written(values)


def run(data: bytes, folder: Path) -> None:
    if data[:1] == b"\0":
        check(lens_of(_text(data[1:])))
        return
    path = folder / "lens.yaml"
    path.write_bytes(data)
    check(read_lens(path))


def lens_of(text: str) -> Lens:
    """The lens of a text in YAML."""
    root = parse(text, "lens.yaml")
    try:
        return LensSpec.model_validate(None if root is None else root.plain()).lens()
    except ValidationError as error:
        raise first_error(error, root, "lens.yaml") from None


def check(lens: Lens) -> None:
    """Raise where a lens holds what is no finite number, or says what cannot be of one."""
    for element in lens.elements:
        numbers = (element.curvature, element.thickness, element.radius, element.conic, *element.coefficients)
        assert all(map(math.isfinite, numbers)), element
        assert element.radius > 0.0, element
        assert np.isfinite(element.glass.ior(np.array([400.0, 587.0, 700.0]))).all(), element
    surfaces = lens.packed()
    # What has no power is a lens all the same, and whoever looks for its image is told.
    with contextlib.suppress(ValueError):
        cardinal_points(surfaces)


# Made now, and not while an input is timed.
_grammar()
