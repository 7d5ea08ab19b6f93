"""Writing `.lf` files: view by view, or a whole light field."""

import contextlib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.field import LightField, Rays
from raytracer.film.light_field.lf.stored_array import (
    AXES,
    COVERAGE,
    FORMAT,
    MICROLENSES,
    OPTIONAL_NUMBERS,
    POSED_VERSION,
    RADIANCE,
    RAYS_PER_TILE,
    TYPES,
    UNITS,
    VERSION,
)
from raytracer.film.light_field.posed_field import PosedLightField
from raytracer.film.light_field.posed_views import PosedViews
from raytracer.film.light_field.views import Views
from raytracer.util.atomic_write import atomic_write, wrap_os_errors
from raytracer.util.progress import Update, report_progress


class WriteOnlyFile:
    """A file for HDF5 to write, which stores the first error instead of raising it.

    HDF5 cannot close a file that it could not write, and ends the process at its exit.  So writes always seem to
    succeed, and the writer checks `error`.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self.error: BaseException | None = None

    def write(self, data: memoryview) -> int:
        self._attempt(lambda: self._file.write(data))
        return len(data)

    def truncate(self, size: int) -> int:
        self._attempt(lambda: self._file.truncate(size))
        return size

    def flush(self) -> None:
        self._attempt(self._file.flush)

    def __getattr__(self, name: str) -> Any:
        """Seek, tell and read as the file does."""
        return getattr(self._file, name)

    def _attempt(self, act: Callable[[], object]) -> None:
        try:
            if self.error is None:
                act()
        except BaseException as error:  # noqa: BLE001
            self.error = error


_TILE = 128
"""Pixels along the edge of a tile: as quick as whole views to write and read, and a part of a view costs little."""


class Writer:
    """Writer of an `.lf` file, to which views are written as they come: one, or whole rows of views, at a time.

    with Writer("x.lf", views, settings={"spp": 16}) as writer:
        writer.put(0, radiance)      # (rows, columns, height, width, 3), from row 0 on

    The file appears when all is written; after an error, there is none.

    Parameters
    ----------
    dtype : of the radiance in the file, one of `TYPES`; layers have float32 at least, or integers as they are.
    compress : by deflate; rendered noise shrinks by a fifth, and takes fifteen times as long to write, five to read.
    settings : that it was made with; more may be added until the end (`writer.settings`).
    microlenses : places (n, 2) that pixels are interpolated between (`field.Samples`); each view then has samples
        there.

    Raises
    ------
    OutputError : the file cannot be written (full disk, quota, permission).
    ValueError : an array of another size, a view written twice or not at all.
    """

    def __init__(
        self,
        path: str | Path,
        views: Views | PosedViews,
        *,
        dtype: str = "float32",
        compress: bool = False,
        settings: Mapping[str, str | float | int] | None = None,
        microlenses: NDArray[np.float64] | None = None,
    ) -> None:
        if dtype not in TYPES:
            raise ValueError(f"numbers of a light field's file must be {', '.join(TYPES)}, not {dtype}")
        self.path = Path(path)
        self.views = views
        self.settings = dict(settings or {})
        self._dtype = np.dtype(dtype).newbyteorder("<")
        self._compress = compress
        self._missing = set(np.ndindex(views.rows, views.columns))
        self._layers: dict[str, Any] | None = None
        self._microlenses = microlenses
        self._samples: Any = None
        self._context = self._open()
        self._file: Any = None
        self._radiance: Any = None
        self._sink: WriteOnlyFile | None = None

    def __enter__(self) -> "Writer":
        return self._context.__enter__()

    def __exit__(self, *error: Any) -> bool | None:
        return self._context.__exit__(*error)

    def put(self, row: int, radiance: Any, layers: Mapping[str, Any] | None = None) -> None:
        """Write rows of views, from `row` on.

        radiance : (rows, columns, height, width, 3).
        layers : by name, (rows, columns, height, width) or with a last axis of channels; the same names every time.
        """
        layers = layers or {}
        for name, array in {"radiance": radiance, **layers}.items():
            if tuple(np.shape(array))[:2] != (len(radiance), self.views.columns):
                wanted = (len(radiance), self.views.columns)
                raise ValueError(f"{name} must be rows of views, {wanted}, got {np.shape(array)}")
        # View by view: the whole may come from a file that does not fit into memory.
        for i, column in np.ndindex(len(radiance), self.views.columns):
            view_layers = {name: layer[i, column] for name, layer in layers.items()}
            self.put_view(row + i, column, radiance[i, column], view_layers)

    def put_view(
        self, row: int, column: int, radiance: Any, layers: Mapping[str, Any] | None = None, samples: Any = None
    ) -> None:
        """Write one view: radiance (height, width, 3), and layers by name, the same names for every view.

        samples : (n, 3), radiance that it saw at each of the microlenses, if there are any.
        """
        layers = layers or {}
        microlenses = None if self._microlenses is None else (len(self._microlenses), 3)
        given = None if samples is None else np.shape(samples)
        if given != microlenses:
            raise ValueError(f"samples must be of shape {microlenses}, got {given}")
        size = (self.views.height, self.views.width)
        for name, array in {"radiance": radiance, **layers}.items():
            channels = np.shape(array)[2:]
            if np.shape(array)[:2] != size or len(channels) > 1 or (name == "radiance" and channels != (3,)):
                raise ValueError(f"{name} must be a view of {size}, got {np.shape(array)}")
        if (row, column) not in self._missing:
            raise ValueError(f"the view in row {row}, column {column} is written already, or is not there")
        if self._layers is None:
            self._layers = {name: self._create_array(f"layers/{name}", layer) for name, layer in layers.items()}
        if self._layers.keys() != layers.keys():
            raise ValueError(f"layers must be {sorted(self._layers)} for every view, got {sorted(layers)}")
        arrays = [(self._layers[name], layer) for name, layer in layers.items()]
        arrays += [(self._radiance, radiance), *([] if samples is None else [(self._samples, samples)])]
        # What float16 cannot hold becomes inf, as it should.
        with np.errstate(over="ignore"):
            for dataset, array in arrays:
                dataset[row, column] = np.asarray(array).astype(dataset.dtype)
        self._raise_error()
        self._missing.discard((row, column))

    def write_rays(self, rays: Rays) -> None:
        """Write single rays, besides the views."""
        for name, array in rays._asdict().items():
            if array is None:
                continue
            shape = tuple(np.shape(array))
            dataset = self._create_dataset(f"rays/{name}", shape, np.dtype("<f8"), (RAYS_PER_TILE, *shape[1:]))
            for start in range(0, len(array), RAYS_PER_TILE):
                dataset[start : start + RAYS_PER_TILE] = array[start : start + RAYS_PER_TILE]
                self._raise_error()
            dataset.dims[0].label = "ray"

    @contextlib.contextmanager
    def _open(self) -> Iterator["Writer"]:
        import h5py

        with atomic_write(self.path) as aside, contextlib.ExitStack() as stack:
            with wrap_os_errors(self.path):
                self._sink = WriteOnlyFile(stack.enter_context(aside.open("w+b")))
            with h5py.File(self._sink, "w", libver=("v110", "v110")) as self._file:
                self._write_geometry()
                self._raise_error()
                yield self
                if self._missing:
                    raise ValueError(f"{len(self._missing)} views were not written, the first is {min(self._missing)}")
                _write_settings(self._file.create_group("settings"), self.settings)
            self._raise_error()

    def _raise_error(self) -> None:
        """Raise the error that kept the file from being written, if there was one."""
        error = None if self._sink is None else self._sink.error
        if error is not None:
            with wrap_os_errors(self.path):
                raise error

    def _write_geometry(self) -> None:
        """Write the geometry, and create the datasets of views."""
        from raytracer import __version__

        file, views = self._file, self.views
        is_posed = isinstance(views, PosedViews)
        file.attrs["version"] = POSED_VERSION if is_posed else VERSION
        _write_string(file, "format", FORMAT)
        _write_string(file, "creator", f"rt {__version__}")
        if isinstance(views, PosedViews):
            self._write_array("pose", views.pose, ("v", "u", "vector", "axis"), UNITS["pose"])
            self._write_array("plane", views.plane, ("v", "u", "number"), "tangent")
        else:
            self._write_plane_of_views(views)
        self._radiance = self._create_array(RADIANCE, np.empty((0, 0, 3)))
        _write_string(self._radiance, "primaries", "Rec. 709")
        if self._microlenses is not None:
            self._describe_microlenses(self._microlenses)

    def _write_plane_of_views(self, views: Views) -> None:
        """Write the geometry of views in one plane."""
        file, plane = self._file, views.plane
        numbers = {**plane._asdict(), "inverse_focus": views.inverse_focus, "focus_distance": views.focus_distance}
        numbers |= {name: value for name in OPTIONAL_NUMBERS if (value := getattr(views, name)) is not None}
        for name, number in numbers.items():
            file.attrs[name] = float(number)
        for name, tuples in {"cell": views.cell, "pose": views.pose}.items():
            if tuples is not None:
                file.attrs[name] = np.array(tuples, dtype="<f8")
        for name, unit in UNITS.items():
            _write_string(file, f"{name}_unit", unit)
        self._write_array("position", views.position, ("v", "u", "axis"), "m")
        if views.coverage is not None:
            self._write_array(COVERAGE, views.coverage, ("v", "u"))

        # Scales of the axes for other programs; places of views are in `position`, since they need not be on a grid.
        across, down = np.arange(views.width) + 0.5, np.arange(views.height) + 0.5
        scales = {"s": plane.left + plane.pixel * across, "t": plane.top - plane.pixel * down}
        for axis, scale in scales.items():
            file[axis] = scale.astype("<f8")
            file[axis].make_scale(axis)
            _write_string(file[axis], "unit", "tangent")

    def _write_array(
        self, name: str, numbers: NDArray[np.float64], labels: tuple[str, ...], unit: str | None = None
    ) -> None:
        """Write numbers of the geometry in one tile."""
        dataset = self._create_dataset(name, numbers.shape, np.dtype("<f8"), numbers.shape)
        dataset[...] = numbers
        _label(dataset, labels)
        if unit is not None:
            _write_string(dataset, "unit", unit)

    def _describe_microlenses(self, places: NDArray[np.float64]) -> None:
        """Write the places of the microlenses, and create the dataset of their samples."""
        count, views = len(places), self.views
        dataset = self._create_dataset(f"{MICROLENSES}/place", (count, 2), np.dtype("<f8"), (RAYS_PER_TILE, 2))
        dataset[...] = places
        _label(dataset, ("microlens", "axis"))
        _write_string(dataset, "unit", "pixel of a view")
        size = (views.rows, views.columns, count, 3)
        self._samples = self._create_dataset(f"{MICROLENSES}/value", size, self._dtype, (1, 1, RAYS_PER_TILE, 3))
        _label(self._samples, ("v", "u", "microlens", "channel"))

    def _create_array(self, name: str, like: Any) -> Any:
        """Create a dataset for all views, of the type and the channels of one."""
        views = self.views
        kind = np.asarray(like).dtype
        # Depths and places need more digits than radiance.
        wanted = self._dtype if name == RADIANCE else max(self._dtype, np.dtype("<f4"), key=lambda t: t.itemsize)
        dtype = wanted if kind.kind == "f" else kind.newbyteorder("<")
        channels = tuple(np.shape(like))[2:]
        tile = (1, 1, _even_tile_size(views.height), _even_tile_size(views.width), *channels)
        size = (views.rows, views.columns, views.height, views.width, *channels)
        dataset = self._create_dataset(name, size, dtype, tile)
        _label(dataset, AXES[: len(size)])
        # Views with poses of their own have image planes of their own too.
        if "t" in self._file:
            dataset.dims[2].attach_scale(self._file["t"])
            dataset.dims[3].attach_scale(self._file["s"])
        return dataset

    def _create_dataset(self, name: str, shape: tuple[int, ...], dtype: np.dtype[Any], tile: tuple[int, ...]) -> Any:
        # Without tiles there is nothing to compress or to sum.
        if 0 in shape:
            return self._file.create_dataset(name, shape, dtype)
        packed = {"compression": "gzip", "compression_opts": 1, "shuffle": True} if self._compress else {}
        fitting = tuple(min(n, k) for n, k in zip(shape, tile, strict=True))
        return self._file.create_dataset(name, shape, dtype, chunks=fitting, fletcher32=True, **packed)


def _even_tile_size(size: int) -> int:
    """Compute the size of a tile (px), so that the last is not mostly outside: all are of one size in a file."""
    return -(-size // -(-size // _TILE))


def _label(dataset: Any, labels: tuple[str, ...]) -> None:
    for axis, label in zip(dataset.dims, labels, strict=True):
        axis.label = label


# Integers of HDF5 have 64 bits.
_INTEGER_END = 2**63


def _write_settings(group: Any, settings: Mapping[str, str | float | int]) -> None:
    for name, value in settings.items():
        is_integer = isinstance(value, int) and not isinstance(value, bool) and abs(value) < _INTEGER_END
        if is_integer or isinstance(value, float):
            group.attrs[name] = value
        else:
            _write_string(group, name, str(value))


def _write_string(owner: Any, name: str, text: str) -> None:
    """Write a string of fixed length: those of variable length are in a heap without a checksum."""
    encoded = text.encode()
    owner.attrs[name] = np.array(encoded, dtype=f"S{max(len(encoded), 1)}")


def write(
    path: str | Path,
    field: LightField | PosedLightField,
    *,
    dtype: str = "float32",
    compress: bool = False,
    update: Update | None = None,
) -> None:
    """Write a light field as an `.lf` file.

    Parameters
    ----------
    dtype : see `Writer`; geometry and rays are float64 always.
    compress : see `Writer`.
    update : called with the progress: rows of views that are written, and all rows.

    Raises
    ------
    OutputError : the file cannot be written (full disk, quota, permission); what stood there before still does.
    """
    samples = field.samples
    places = None if samples is None else samples.place
    with Writer(
        path, field.views, dtype=dtype, compress=compress, settings=field.settings, microlenses=places
    ) as writer:
        for row in report_progress(range(field.views.rows), update):
            for column in range(field.views.columns):
                layers = {name: layer[row, column] for name, layer in field.layers.items()}
                view_samples = None if samples is None else samples.value[row, column]
                writer.put_view(row, column, field.radiance[row, column], layers, view_samples)
        if field.rays is not None:
            writer.write_rays(field.rays)
