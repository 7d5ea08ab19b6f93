"""Reading `.lf` files: geometry at once, arrays as they are asked for."""

import stat
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self, TypeVar

import numpy as np

from raytracer.film.light_field.field import PLAIN_LAYERS, LightField, Rays, Samples
from raytracer.film.light_field.lf.stored_array import (
    AXES,
    CACHE_BYTES,
    COVERAGE,
    FORMAT,
    MICROLENSES,
    NUMBERS,
    OPTIONAL_NUMBERS,
    POSED_VERSION,
    RADIANCE,
    VERSION,
    StoredArray,
    checked_array,
    checked_name,
    find_object,
    list_members,
    read_attribute,
    read_number,
    read_numbers,
    read_string,
)
from raytracer.film.light_field.views import Plane, Pose, Views
from raytracer.util.errors import InputError


class OpenFile:
    """A file that is open until `close`, the end of a `with` block, or its last reference is gone."""

    file: Any

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file; its arrays cannot be read any more."""
        self.file.close()


@dataclass(frozen=True, eq=False, repr=False)
class OpenField(OpenFile, LightField):
    """A light field in a file, whose views stand in one plane."""

    file: Any = None


Opened = TypeVar("Opened")


def open(path: str | Path) -> OpenField:  # noqa: A001
    """Open the light field in a file; its arrays are read when they are indexed, and are `StoredArray`.

    Raises
    ------
    InputError : the file is missing, truncated, damaged, another kind of file, of a newer version, or its geometry
        makes no sense; or its views have poses of their own, which `open_posed` reads.
    """
    return read_file(path, read_light_field)


def read_file(path: str | Path, read: Callable[[Any, Path], Opened]) -> Opened:
    """Open a file of a light field, and read what stays open with it; see `open`."""
    path = Path(path)
    file = _open_hdf5(path)
    try:
        return read(file, path)
    except InputError:
        file.close()
        raise
    except (OSError, RuntimeError, KeyError, ValueError, TypeError) as error:
        # HDF5 raises errors of its own for what it cannot interpret.
        file.close()
        raise InputError(f"{path}: is damaged") from error


def _open_hdf5(path: Path) -> Any:
    """Open a regular file as HDF5."""
    import h5py

    try:
        status = path.stat()
        if stat.S_ISDIR(status.st_mode):
            raise InputError(f"{path}: is a folder, not an .lf file: rt lightfield import reads folders of views")
        # A pipe would be waited for.
        if not stat.S_ISREG(status.st_mode):
            raise InputError(f"{path}: is no regular file")
        with path.open("rb") as raw:
            raw.read(1)
        if not h5py.is_hdf5(path):
            raise InputError(f"{path}: is no .lf file (not HDF5)")
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file") from error
    except (OSError, ValueError) as error:
        raise InputError(f"{path!s:.200}: cannot be read: {getattr(error, 'strerror', None) or error}") from error
    try:
        return h5py.File(path, "r", locking=False, rdcc_nbytes=CACHE_BYTES)
    except (OSError, RuntimeError) as error:
        is_short = "truncated" in str(error)
        raise InputError(f"{path}: is {'truncated: its end is missing' if is_short else 'damaged'}") from error


def read_version(file: Any, path: Path) -> int:
    """Read the version of a light field's file: `VERSION` or `POSED_VERSION`.

    Raises InputError: it is no light field, or of another version.
    """
    kind = read_string(file, "format", path)
    if kind != FORMAT:
        raise InputError(f"{path}: is an HDF5 file, but no light field: its attribute format is not {FORMAT!r}")
    version = read_number(file, "version", path)
    if version not in (VERSION, POSED_VERSION):
        known = f"{VERSION} and {POSED_VERSION}"
        raise InputError(f"{path}: is of version {version:g} of the format; this program reads versions {known}")
    return int(version)


def read_radiance(file: Any, path: Path) -> StoredArray:
    """Open the radiance of all views."""
    radiance = checked_array(file, RADIANCE, path, axes=5)
    if radiance.shape[4] != 3:
        raise InputError(f"{path}: radiance must have 3 channels (red, green, blue), not {radiance.shape[4]}")
    return radiance


def read_light_field(file: Any, path: Path) -> OpenField:
    """Read the geometry and the settings, and open the arrays, of views in one plane."""
    if read_version(file, path) == POSED_VERSION:
        raise InputError(
            f"{path}: its views have poses of their own, and this needs views in one plane: of this file rt lightfield "
            "views and move draw pictures from any place, by --from and --toward"
        )
    # Shapes first: everything else has to go with them.
    radiance = read_radiance(file, path)
    rows, columns, height, width, _ = radiance.shape
    position = checked_array(file, "position", path, axes=3)
    if position.shape != (rows, columns, 2):
        raise InputError(f"{path}: position must be of shape {(rows, columns, 2)} as radiance is, not {position.shape}")

    coverage = checked_array(file, COVERAGE, path, axes=2) if find_object(file, COVERAGE, path) else None
    cell, pose = read_numbers(file, "cell", path, (2,)), read_numbers(file, "pose", path, (4, 3))
    if pose is not None and not np.isfinite(pose).all():
        raise InputError(f"{path}: its pose must be of finite numbers")
    pixel, left, top, inverse_focus = (read_number(file, name, path) for name in NUMBERS)
    aperture, focal_length = (read_numbers(file, name, path, ()) for name in OPTIONAL_NUMBERS)
    try:
        views = Views(
            position=np.asarray(position, dtype=np.float64),
            plane=Plane(pixel, left, top),
            width=width,
            height=height,
            inverse_focus=inverse_focus,
            cell=None if cell is None else (float(cell[0]), float(cell[1])),
            aperture=None if aperture is None else float(aperture),
            focal_length=None if focal_length is None else float(focal_length),
            pose=None if pose is None else Pose.of(pose),
            coverage=None if coverage is None else np.asarray(coverage, dtype=np.float64),
        )
    except ValueError as error:
        raise InputError(f"{path}: {error}") from error
    layers, rays = read_layers(file, path, radiance), _read_rays(file, path)
    samples = _read_samples(file, path, (rows, columns))
    return OpenField(radiance, views, layers, rays, read_settings(file, path), samples, file)


def read_layers(file: Any, path: Path, radiance: StoredArray) -> dict[str, StoredArray]:
    """Open the layers of all views."""
    size, layers = radiance.shape[:4], {}
    for name in list_members(file, "layers", path):
        layer = checked_array(file, f"layers/{name}", path, axes=None, kinds="fiub")
        if layer.shape[:4] != size or layer.ndim > len(AXES):
            raise InputError(f"{path}: layer {name} must be of shape {size} as radiance is, not {layer.shape}")
        if name in PLAIN_LAYERS and layer.ndim != len(size):
            raise InputError(f"{path}: layer {name} must have one number a pixel, and is of shape {layer.shape}")
        layers[name] = layer
    return layers


def _read_samples(file: Any, path: Path, size: tuple[int, int]) -> Samples | None:
    """Open the samples of microlenses, if there are any."""
    if not list_members(file, MICROLENSES, path):
        return None
    place, value = (
        checked_array(file, f"{MICROLENSES}/{name}", path, axes=n) for name, n in (("place", 2), ("value", 4))
    )
    if place.shape[1] != 2 or value.shape != (*size, place.shape[0], 3):
        wanted = f"(n, 2) and {(*size, 'n', 3)}"
        raise InputError(f"{path}: {MICROLENSES} must be of shapes {wanted}, not {place.shape} and {value.shape}")
    places = np.asarray(place, dtype=np.float64)
    if not np.isfinite(places).all():
        raise InputError(f"{path}: places of {MICROLENSES} must be finite")
    return Samples(places, value)


_RAYS = {"place": 2, "value": 2, "weight": 1}


def _read_rays(file: Any, path: Path) -> Rays | None:
    """Open the rays, if there are any."""
    if not list_members(file, "rays", path):
        return None
    place, value, weight = (checked_array(file, f"rays/{name}", path, axes=axes) for name, axes in _RAYS.items())
    count = len(weight)
    bundle = checked_array(file, "rays/bundle", path, axes=2) if "bundle" in list_members(file, "rays", path) else None
    if bundle is not None and bundle.shape != (count, 2):
        raise InputError(f"{path}: rays/bundle must be of shape {(count, 2)}, not {bundle.shape}")
    if place.shape != (count, 4) or value.shape != (count, 3):
        shapes = ", ".join(str(array.shape) for array in (place, value, weight))
        raise InputError(f"{path}: rays must be of shapes (n, 4), (n, 3) and (n,), not {shapes}")
    return Rays(place, value, weight, bundle)  # type: ignore[arg-type]


def read_settings(file: Any, path: Path) -> dict[str, str | float | int]:
    """Read the settings."""
    group = find_object(file, "settings", path)
    if group is None:
        return {}
    values = {name: read_attribute(group, name, path) for name in group.attrs}
    known = {name: value for name, value in values.items() if isinstance(value, str | int | float)}
    return {checked_name(name, "settings", path): value for name, value in known.items()}
