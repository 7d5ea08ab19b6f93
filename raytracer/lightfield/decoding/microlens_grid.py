"""Microlens grid of a camera: its lattice, and the JSON file that holds it."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from raytracer.film.light_field.lattice import Lattice
from raytracer.util.errors import InputError
from raytracer.util.safe_open import name_read_errors, read_regular

_LARGEST_FILE, _LARGEST_NUMBER = 1 << 20, 1e9
"""Most bytes of a file with a grid, and most pixels of its lengths: far above those of any camera."""


@dataclass(frozen=True)
class Grid:
    """Grid of microlenses of a camera.

    Attributes
    ----------
    lattice : centres of the sub-images, counted from the one nearest to the picture's middle.
    width, height : pixels of the raw pictures.
    residual : distance of blocks of microlenses from the lattice (raw pixels, RMS of the blocks that were used).
    blocks : number of the blocks that were used, and of all.
    diameter : of a sub-image (raw pixels): of the disc as large as the part that is at least half as bright as its
        middle.
    """

    lattice: Lattice
    width: int
    height: int
    residual: float = 0.0
    blocks: tuple[int, int] = (0, 0)
    diameter: float = 0.0

    @property
    def layout(self) -> str:
        """Layout of the microlenses: `square` or `hexagonal`."""
        return "hexagonal" if self.lattice.hexagonal else "square"

    def as_dict(self) -> dict[str, Any]:
        """Convert to JSON values: lengths in raw pixels, right and down from the top left corner, angles in degrees."""
        lattice = self.lattice
        return {
            "layout": self.layout,
            "pitch": lattice.pitch,
            "rotation": lattice.rotation,
            "offset": list(lattice.origin),
            "along": list(lattice.along),
            "across": list(lattice.across),
            "diameter": self.diameter,
            "residual": self.residual,
            "blocks_used": self.blocks[0],
            "blocks": self.blocks[1],
            "width": self.width,
            "height": self.height,
        }


def grid_from_dict(values: Mapping[str, Any], name: str) -> Grid:
    """Read a grid from the values of `Grid.as_dict`; an InputError, which begins with `name`, says what is wrong."""

    def vector(key: str) -> tuple[float, float]:
        pair = values.get(key)
        if not (isinstance(pair, list | tuple) and len(pair) == 2):
            raise InputError(f"{name}: {key}: must be two numbers, right and down in pixels")
        return number(key, pair[0]), number(key, pair[1])

    def number(key: str, value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= _LARGEST_NUMBER:
            raise InputError(f"{name}: {key}: must be a number, of at most {_LARGEST_NUMBER:g} pixels")
        return float(value)

    if not isinstance(values, Mapping):
        raise InputError(f"{name}: a grid is a JSON object with offset, along, across, width and height")
    missing = [key for key in ("offset", "along", "across", "width", "height") if key not in values]
    if missing:
        raise InputError(f"{name}: {missing[0]} is missing: a grid has offset, along, across, width and height")
    try:
        lattice = Lattice(vector("offset"), vector("along"), vector("across"))
    except ValueError as error:
        raise InputError(f"{name}: {error}") from None
    if lattice.pitch < 1.0 or lattice.area < 1.0:
        raise InputError(f"{name}: along, across: microlenses must be at least a pixel apart")
    width, height = number("width", values["width"]), number("height", values["height"])
    diameter = number("diameter", values.get("diameter", lattice.pitch))
    return Grid(lattice, int(width), int(height), number("residual", values.get("residual", 0.0)), (0, 0), diameter)


def read_grid(path: str | Path) -> Grid:
    """Read a grid from a JSON file, as `rt lightfield decode --json` prints it.

    Raises
    ------
    InputError : the file is missing, or holds no grid.
    """
    path = Path(path)
    try:
        with name_read_errors(path):
            values = json.loads(read_regular(path, _LARGEST_FILE).decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: is no JSON file") from error
    return grid_from_dict(values, str(path))
