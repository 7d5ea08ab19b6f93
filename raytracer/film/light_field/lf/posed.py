"""Reading `.lf` files of views with poses of their own; those of views in one plane are read as such views too."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from raytracer.film.light_field.lf.reader import (
    OpenFile,
    read_file,
    read_layers,
    read_light_field,
    read_radiance,
    read_settings,
    read_version,
)
from raytracer.film.light_field.lf.stored_array import POSED_VERSION, VERSION, checked_array
from raytracer.film.light_field.posed_field import PosedLightField
from raytracer.film.light_field.posed_views import PLANE_NUMBERS, POSE_SHAPE, PosedViews
from raytracer.util.errors import InputError


@dataclass(frozen=True, eq=False, repr=False)
class OpenPosedField(OpenFile, PosedLightField):
    """A light field in a file, whose views have poses of their own."""

    file: Any = None


def open_posed(path: str | Path) -> OpenPosedField:
    """Open the light field in a file as one of views with poses of their own, also where they stand in one plane.

    Raises
    ------
    InputError : as `open` does.
    """
    return read_file(path, _read_posed_field)


def is_posed(path: str | Path) -> bool:
    """Tell if the views in a file have poses of their own; an InputError as of `open`."""

    def read(file: Any, path: Path) -> bool:
        with file:
            return read_version(file, path) == POSED_VERSION

    return read_file(path, read)


def _read_posed_field(file: Any, path: Path) -> OpenPosedField:
    """Read geometry and settings, and open the arrays."""
    if read_version(file, path) == VERSION:
        planar = PosedLightField.of(read_light_field(file, path))
        return OpenPosedField(planar.radiance, planar.views, planar.layers, planar.settings, file)
    radiance = read_radiance(file, path)
    rows, columns, height, width, _ = radiance.shape
    geometry = {}
    for name, shape in {"pose": POSE_SHAPE, "plane": (PLANE_NUMBERS,)}.items():
        array = checked_array(file, name, path, axes=2 + len(shape))
        if array.shape != (rows, columns, *shape):
            raise InputError(
                f"{path}: {name} must be of shape {(rows, columns, *shape)} as radiance is, not {array.shape}"
            )
        geometry[name] = np.asarray(array, dtype=np.float64)
    try:
        views = PosedViews(**geometry, width=width, height=height)
    except ValueError as error:
        raise InputError(f"{path}: {error}") from error
    return OpenPosedField(radiance, views, read_layers(file, path, radiance), read_settings(file, path), file)
