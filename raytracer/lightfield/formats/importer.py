"""Import of light fields of other programs: folders of views, arrays, and pictures that show all views.

Views are read from their files as they are asked for.
"""

import contextlib
import dataclasses
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, TypedDict, Unpack

import numpy as np
from numpy.typing import NDArray

from raytracer.film import image_file
from raytracer.film.formats import pfm
from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.lazy_array import LazyArray
from raytracer.film.light_field.views import Views
from raytracer.lightfield.formats import folders, geometry, hci
from raytracer.lightfield.formats.folders import ViewFiles, list_images
from raytracer.lightfield.formats.geometry import KnownGeometry, ViewOptics
from raytracer.util import srgb
from raytracer.util.errors import InputError
from raytracer.util.safe_open import BrokenFileError, open_regular, read_npy_header, read_regular

_NPY = ".npy"


class OpticsOptions(TypedDict, total=False):
    """Keyword options of `import_views` that give the field of view of a view; see `ViewOptics`."""

    vfov: float | None
    focal_length: float | None
    sensor: float | None


def import_views(
    path: str | Path,
    *,
    rows: int | None = None,
    columns: int | None = None,
    spacing: float | tuple[float, float] | None = None,
    focus_distance: float | None = None,
    flip: str = "",
    interleaved: bool = False,
    **optics: Unpack[OpticsOptions],
) -> LightField:
    """Import a light field of another program; its views are read as they are asked for.

    Metres need `spacing`, `focus_distance`, and `vfov` or `focal_length` with `sensor`, or files that say as much.
    Without them places are in steps of one view and `settings["units"]` is "views".

    Parameters
    ----------
    path : a folder of views, an array (.npy), or a picture that shows all views.
    rows, columns : of views, where names do not say them.
    spacing : from view to view (m), or that to the right and that down.
    focus_distance : of the plane in which all views see the same (m); inf for parallel ones.
    flip : "x", "y", "xy": places in Stanford names run to the left, or up.
    interleaved : True if the pixels of one picture go from view to view, as under microlenses.
    vfov : vertical field of view of a view (degrees).
    focal_length, sensor : of a view, and the width of its sensor (mm).

    Raises
    ------
    InputError : files are missing, broken, of different sizes or not views, or the options are not enough for metres.
    """
    path = Path(path)
    view_optics = ViewOptics(**optics)
    has_options = any(value is not None for value in (spacing, focus_distance, *view_optics))
    layers: dict[str, PartialLayer] = {}
    parameters: hci.HciParameters | None = None
    radiance: Any
    if path.is_dir():
        parameters = _parameters(path) if (rows, columns) == (None, None) else None
        if parameters is not None:
            rows, columns = parameters.rows, parameters.columns
        files = folders.find_views(path, rows, columns, flip)
        radiance = LazyPictures(files.files)
        beside = path / geometry.FILE
    elif path.suffix.lower() == _NPY:
        radiance = LazyNpy(path)
        beside = path.with_suffix(f".{geometry.FILE}")
        files = ViewFiles([], geometry.regular_grid(*radiance.shape[:2]), "grid")
    else:
        if rows is None or columns is None:
            _check_picture(path)
            raise InputError(f"{path}: is one picture: say --rows and --columns of the views in it")
        radiance = split_montage(path, rows, columns, interleaved=interleaved)
        beside = path.with_suffix(f".{geometry.FILE}")
        files = ViewFiles([], geometry.regular_grid(rows, columns), "grid")

    height, width = radiance.shape[2:4]
    settings = {"naming": files.naming}
    if has_options:
        known = _known_geometry(path, spacing, focus_distance, view_optics.pixel(width, height), files.is_placed)
        views, units = geometry.make_views(path, files.steps, width, height, known)
    elif beside.exists():
        views, units = geometry.read(beside)
        _check_same_size(beside, views, radiance.shape)
    elif parameters is not None:
        views, units = _hci_views(path / hci.FILE, parameters, radiance.shape), {}
    else:
        views, units = geometry.make_views(path, files.steps, width, height, KnownGeometry())
    if files.naming == "hci" and not units:
        layers = _ground_truth_layers(path, views)
    return LightField(radiance, views, layers, settings={**settings, **units})


def _check_picture(path: Path) -> None:
    """Refuse a file that is missing, or is no picture."""
    if not path.exists():
        raise InputError(f"{path}: no such file or folder")
    if path.suffix.lower() == ".lf":
        raise InputError(f"{path}: is an .lf file already")
    image_file.load(path)


def _known_geometry(
    path: Path,
    spacing: float | tuple[float, float] | None,
    distance: float | None,
    pixel: float | None,
    is_placed: bool,
) -> KnownGeometry:
    """Gather the geometry that options give, and refuse one that is not complete."""
    if spacing is None or distance is None or pixel is None:
        given = {
            "--spacing": spacing,
            "--focus-distance (inf for parallel views)": distance,
            "--vfov, or --focal-length with --sensor": pixel,
        }
        missing = [name for name, value in given.items() if value is None]
        raise InputError(
            f"{path}: metres need also {' and '.join(missing)}; without any of them, places are in steps of one view"
        )
    both = spacing if isinstance(spacing, tuple) else (spacing, spacing)
    if is_placed and both[0] != both[1]:
        raise InputError(
            f"{path}: names say where views are: --spacing is one length, that from view to view on average"
        )
    return KnownGeometry(both, distance, pixel)


def _check_same_size(path: Path, views: Views, shape: Sequence[int]) -> None:
    """Refuse a geometry file of other views than there are."""
    stated = (views.rows, views.columns, views.height, views.width)
    if stated != tuple(shape[:4]):
        raise InputError(
            f"{path}: is the geometry of views (rows, columns, height, width) {stated}; there are {tuple(shape[:4])}"
        )


def _parameters(folder: Path) -> hci.HciParameters | None:
    """Read the benchmark's file of parameters, if views are named as the benchmark's and there is one."""
    named = any(folders.HCI.fullmatch(path.stem) for path in list_images(folder))
    return hci.read(folder / hci.FILE) if named and (folder / hci.FILE).exists() else None


def _hci_views(path: Path, stated: hci.HciParameters, shape: Sequence[int]) -> Views:
    """Make the geometry of the benchmark's parameters, and refuse those of another image size."""
    if (stated.height, stated.width) != tuple(shape[2:4]):
        height, width = shape[2:4]
        raise InputError(f"{path}: says {stated.width} x {stated.height} pixels a view; they have {width} x {height}")
    steps = geometry.regular_grid(stated.rows, stated.columns)
    views, _ = geometry.make_views(path, steps, stated.width, stated.height, stated.known)
    return dataclasses.replace(views, pose=stated.pose)


def _ground_truth_layers(folder: Path, views: Views) -> "dict[str, PartialLayer]":
    """Read the benchmark's ground truth as the layer `depth`, nan in views without any; no layer if there is none."""
    step: float | None = None
    # Between views that are on no grid disparities say nothing.
    with contextlib.suppress(ValueError):
        step = hci.grid_spacing(views)
    kinds = (hci.DEPTH_LAYER,) if step is None else (hci.DEPTH_LAYER, hci.DISPARITY_MAP)
    known: dict[tuple[int, int], NDArray[np.float64]] = {}
    middle = views.rows * views.columns // 2
    for number in range(views.rows * views.columns):
        ends = [f"_Cam{number:03d}.pfm"] + ([".pfm"] if number == middle else [])
        for name in (f"gt_{kind}_lowres{end}" for end in ends for kind in kinds):
            path = folder / name
            if not path.exists():
                continue
            values = _read_map(path, views)
            known[divmod(number, views.columns)] = (
                values if step is None or hci.DEPTH_LAYER in name else hci.disparity_to_depth(values, views, step)
            )
            break
    return (
        {hci.DEPTH_LAYER: PartialLayer(known, (views.rows, views.columns, views.height, views.width))} if known else {}
    )


def _read_map(path: Path, views: Views) -> NDArray[np.float64]:
    """Read a .pfm file of one number a pixel of a view."""
    try:
        values = np.asarray(pfm.decode(read_regular(path)), dtype=np.float64)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise InputError(f"{path}: is truncated, or no .pfm file") from error
    if values.shape != (views.height, views.width):
        raise InputError(
            f"{path}: must be of {views.width} x {views.height} pixels as the views are, is {values.shape}"
        )
    return values


_CHANNELS = 3


class LazyPictures(LazyArray):
    """Array of views in one picture file each, (rows, columns, height, width, 3) in linear light.

    Raises InputError, when one is read: a file is broken, or of another size than the first.
    """

    def __init__(self, files: list[list[Path]]) -> None:
        self._files = files
        self._last: tuple[Path, NDArray[np.float64]] = (files[0][0], image_file.load(files[0][0]))
        height, width = self._last[1].shape[:2]
        super().__init__((len(files), len(files[0]), height, width, _CHANNELS), np.dtype(np.float64))

    def _read(self, ahead: tuple[slice, ...]) -> NDArray[Any]:
        rows, columns, *within = ahead
        views = [[self._view(path)[tuple(within)] for path in row[columns]] for row in self._files[rows]]
        sizes = [len(range(size)[part]) for part, size in zip(ahead, self.shape, strict=True)]
        return np.array(views, dtype=self.dtype).reshape(sizes)

    def _view(self, path: Path) -> NDArray[np.float64]:
        if path == self._last[0]:
            return self._last[1]
        picture = image_file.load(path)
        if picture.shape[:2] != self.shape[2:4]:
            height, width = picture.shape[:2]
            first = f"{self.shape[3]} x {self.shape[2]} as {self._files[0][0].name} is"
            raise InputError(f"{path}: is of {width} x {height} pixels, and must be {first}: views are of one size")
        self._last = (path, picture)
        return picture


class LazyNpy(LazyArray):
    """Array of views in a .npy file, (rows, columns, height, width) and 3 or 1 channels, or none, mapped into memory.

    Integers are taken for display values (sRGB), floating-point numbers for linear light.

    Raises InputError: the file is missing, truncated, or holds something else.
    """

    def __init__(self, path: Path) -> None:
        try:
            with open_regular(path, sys.maxsize) as file:
                header = read_npy_header(file)
        except FileNotFoundError as error:
            raise InputError(f"{path}: no such file") from error
        except OSError as error:
            raise InputError(f"{path}: {error.strerror}") from error
        except BrokenFileError as error:
            raise InputError(f"{path}: is truncated, or no .npy file of numbers") from error
        shape, dtype = header.shape, header.dtype
        is_known = dtype.kind == "f" or (dtype.kind == "u" and dtype.itemsize <= 2)
        if len(shape) not in (4, 5) or 0 in shape or shape[4:] not in ((), (1,), (_CHANNELS,)) or not is_known:
            wanted = "(rows, columns, height, width, 3) of floating-point numbers, or uint8 or uint16"
            raise InputError(f"{path}: must be {wanted}; it is {shape} of {dtype}")
        order: Literal["F", "C"] = "F" if header.is_fortran else "C"
        self._array = np.memmap(path, dtype, "r", header.start, shape, order)
        super().__init__((*shape[:4], _CHANNELS), np.dtype(np.float64))

    def _read(self, ahead: tuple[slice, ...]) -> NDArray[Any]:
        values = np.asarray(self._array[ahead[: min(4, self._array.ndim)]])
        if self._array.ndim == len(ahead) - 1:
            values = values[..., None]
        if values.dtype.kind == "u":
            values = srgb.decode(values / np.iinfo(values.dtype).max)
        colours = np.broadcast_to(values.astype(np.float64), (*values.shape[:4], _CHANNELS))
        return np.asarray(colours[..., ahead[4]])


class PartialLayer(LazyArray):
    """Layer that is known of some views, by row and column, (rows, columns, height, width); nan in all others."""

    def __init__(self, known: Mapping[tuple[int, int], NDArray[np.float64]], shape: tuple[int, int, int, int]) -> None:
        self._known = known
        super().__init__(shape, np.dtype(np.float64))

    def _read(self, ahead: tuple[slice, ...]) -> NDArray[Any]:
        rows, columns, *within = (range(size)[part] for part, size in zip(ahead, self.shape, strict=True))
        layer = np.full([len(rows), len(columns), *map(len, within)], np.nan)
        for (row, column), values in self._known.items():
            if row in rows and column in columns:
                layer[rows.index(row), columns.index(column)] = values[ahead[2:]]
        return layer


def split_montage(path: Path, rows: int, columns: int, *, interleaved: bool) -> NDArray[np.float64]:
    """Split one picture that shows all views into these, (rows, columns, height, width, 3).

    interleaved : True if pixels of all views lie beside each other, as under microlenses (ESLF); else views do.

    Raises InputError: the picture cannot be read, or does not divide into so many views.
    """
    picture = image_file.load(path)
    height, width = picture.shape[:2]
    if height % rows or width % columns:
        raise InputError(
            f"{path}: {width} x {height} pixels do not divide into {columns} columns and {rows} rows of views"
        )
    if interleaved:
        return picture.reshape(height // rows, rows, width // columns, columns, _CHANNELS).transpose(1, 3, 0, 2, 4)
    return picture.reshape(rows, height // rows, columns, width // columns, _CHANNELS).swapaxes(1, 2)
