"""`.lf` files: a light field with its geometry, as HDF5.

What is in them is written down in docs/lightfield-format.md.  The radiance is in tiles of each view, so that a part of
it is read without the rest, and each tile has a checksum.

References: The HDF Group, "HDF5 File Format Specification", version 3.0; "HDF5 Dimension Scale Specification".
"""

import contextlib
import itertools
import math
import stat
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from raytracer.errors import InputError, one_line, shortened
from raytracer.plenoptic.field import LightField, Rays, Samples
from raytracer.plenoptic.lazy import Lazy
from raytracer.plenoptic.views import Plane, Pose, Views
from raytracer.wholefiles import told, whole

SUFFIX = ".lf"
FORMAT = "rt light field"
VERSION = 1

TYPES = ("float16", "float32", "float64")
"""What numbers of a file can be."""

_TILE = 128
"""Pixels along the edge of a tile: as quick as whole views to write and read, and a part of a view costs little."""

_RAYS_A_TILE = 16_384

_CACHE_BYTES = 16 << 20
"""Of tiles that were read, so that reading row by row does not read each again."""

_LARGEST_RATIO = 1_100
"""What deflate compresses, at most, is 1032 to 1 (zlib's own documentation); and a little for checksums."""

_SHUFFLE, _DEFLATE, _FLETCHER = 2, 1, 3
_FILTERS = [_SHUFFLE, _DEFLATE, _FLETCHER]
"""Registered numbers of the filters that tiles may go through, once each and in this order: for others HDF5 looks for
plug-ins, LZF's tiles are not checked while they are unpacked, and deflated twice, a kilobyte is a gigabyte."""

_SUM_BYTES = 4
"""Of the checksum behind a tile."""

_LEAST_GAIN = 64
"""Deflated, a tile grows by less than this part of it, or by less than as many bytes."""

_RADIANCE = "radiance"
_MICROLENSES = "microlenses"
_AXES = ("v", "u", "t", "s", "channel")
_NUMBERS = ("pixel", "left", "top", "inverse_focus")
_OPTIONAL = ("aperture", "focal_length")


# ---- Arrays in a file


class Stored(Lazy):
    """An array in a file.

    Raises, when it is read
    -----------------------
    InputError : the file is damaged, or has been closed.
    """

    def __init__(self, dataset: Any, path: Path, name: str) -> None:
        super().__init__(tuple(dataset.shape), dataset.dtype.newbyteorder("="))
        self._dataset = dataset
        self._path = path
        self._name = name
        self._is_packed = _DEFLATE in _filters(dataset)
        self._seen = set[tuple[int, ...]]()

    def __repr__(self) -> str:
        return f"<{self._name} of {self._path}: {self.shape}, {self.dtype}>"

    def _read(self, ahead: tuple[slice, ...]) -> NDArray[Any]:
        if not self._dataset:
            raise InputError(f"{self._path}: has been closed")
        try:
            if self._is_packed:
                self._check_tiles(ahead)
            return np.asarray(self._dataset[ahead], dtype=self.dtype)
        except (OSError, RuntimeError, ValueError, zlib.error) as error:
            raise InputError(f"{self._path}: {self._name} is damaged") from error

    def _check_tiles(self, ahead: tuple[slice, ...]) -> None:
        """Make sure that tiles unpack to what they should, before HDF5 does it.

        It makes room for whatever they unpack to, and where that is too little takes the rest from its own memory.
        """
        tile = self._dataset.chunks
        size = math.prod(tile) * self._dataset.dtype.itemsize
        spans = (range(s.start // k * k, s.stop, k) for s, k in zip(ahead, tile, strict=True))
        for place in itertools.product(*spans):
            if place in self._seen:
                continue
            _, data = self._dataset.id.read_direct_chunk(place)
            unpacking = zlib.decompressobj()
            if len(unpacking.decompress(data, size + 1)) != size or not unpacking.eof:
                raise ValueError("a tile unpacks to another size")
            self._seen.add(place)


# ---- Writing


class Writer:
    """A file to which views are written as they come: one, or whole rows of views, at a time.

    with Writer("x.lf", views, settings={"spp": 16}) as writer:
        writer.put(0, radiance)      # (rows, columns, height, width, 3), from row 0 on

    The file appears when all is written; after an error, nothing does.

    Parameters
    ----------
    dtype : of the radiance in the file, one of `TYPES`; layers have float32 at least, or whole numbers as they are.
    compress : by deflate; rendered noise shrinks by a fifth, and takes fifteen times as long to write, five to read.
    settings : what it was made with; may be added to until the end (`writer.settings`).
    microlenses : places (n, 2) of those that pixels are interpolated between (`field.Samples`), of which each view then
        brings what it saw there.

    Raises
    ------
    OutputError : the file cannot be written (full disk, quota, permission).
    ValueError : an array of another size, a view written twice or not at all.
    """

    def __init__(
        self,
        path: str | Path,
        views: Views,
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
        self._sink: _Sink | None = None

    def __enter__(self) -> "Writer":
        return self._context.__enter__()

    def __exit__(self, *error: Any) -> bool | None:
        return self._context.__exit__(*error)

    def put(self, row: int, radiance: Any, layers: Mapping[str, Any] | None = None) -> None:
        """Write rows of views, from `row` on.

        Parameters
        ----------
        radiance : (rows, columns, height, width, 3).
        layers : by name, (rows, columns, height, width) or with a last axis of channels; the same names every time.
        """
        layers = layers or {}
        for name, array in {"radiance": radiance, **layers}.items():
            if tuple(np.shape(array))[:2] != (len(radiance), self.views.columns):
                wanted = (len(radiance), self.views.columns)
                raise ValueError(f"{name} must be rows of views, {wanted}, got {np.shape(array)}")
        # View by view: the whole may come from a file that does not fit into memory.
        for i in range(len(radiance)):
            for column in range(self.views.columns):
                found = {name: layer[i, column] for name, layer in layers.items()}
                self.put_view(row + i, column, radiance[i, column], found)

    def put_view(
        self, row: int, column: int, radiance: Any, layers: Mapping[str, Any] | None = None, samples: Any = None
    ) -> None:
        """Write one view: radiance (height, width, 3), and layers by name, the same names for every view.

        samples : (n, 3), what it saw by each of the microlenses, where there are any.
        """
        layers = layers or {}
        microlenses = None if self._microlenses is None else (len(self._microlenses), 3)
        if (None if samples is None else np.shape(samples)) != microlenses:
            raise ValueError(
                f"samples must be of shape {microlenses}, got {None if samples is None else np.shape(samples)}"
            )
        size = (self.views.height, self.views.width)
        for name, array in {"radiance": radiance, **layers}.items():
            channels = np.shape(array)[2:]
            if np.shape(array)[:2] != size or len(channels) > 1 or (name == "radiance" and channels != (3,)):
                raise ValueError(f"{name} must be a view of {size}, got {np.shape(array)}")
        if (row, column) not in self._missing:
            raise ValueError(f"the view in row {row}, column {column} is written already, or is not there")
        if self._layers is None:
            self._layers = {name: self._made(f"layers/{name}", layer) for name, layer in layers.items()}
        if self._layers.keys() != layers.keys():
            raise ValueError(f"layers must be {sorted(self._layers)} for every view, got {sorted(layers)}")
        for name, array in {**layers, _RADIANCE: radiance}.items():
            made = self._radiance if name == _RADIANCE else self._layers[name]
            # What float16 cannot hold becomes inf, as it should.
            with np.errstate(over="ignore"):
                made[row, column] = np.asarray(array).astype(made.dtype)
        if samples is not None:
            with np.errstate(over="ignore"):
                self._samples[row, column] = np.asarray(samples).astype(self._samples.dtype)
        self._check()
        self._missing.discard((row, column))

    def keep(self, rays: Rays) -> None:
        """Write the rays themselves, besides."""
        for name, array in rays._asdict().items():
            shape = tuple(np.shape(array))
            made = self._dataset(f"rays/{name}", shape, np.dtype("<f8"), (_RAYS_A_TILE, *shape[1:]))
            for start in range(0, len(array), _RAYS_A_TILE):
                made[start : start + _RAYS_A_TILE] = array[start : start + _RAYS_A_TILE]
                self._check()
            made.dims[0].label = "ray"

    @contextlib.contextmanager
    def _open(self) -> Iterator["Writer"]:
        import h5py

        with whole(self.path) as aside, contextlib.ExitStack() as stack:
            with told(self.path):
                self._sink = _Sink(stack.enter_context(aside.open("w+b")))
            with h5py.File(self._sink, "w", libver=("v110", "v110")) as self._file:
                self._describe()
                self._check()
                yield self
                if self._missing:
                    raise ValueError(f"{len(self._missing)} views were not written, the first is {min(self._missing)}")
                _write_settings(self._file.create_group("settings"), self.settings)
            self._check()

    def _check(self) -> None:
        """Raise what kept the file from being written."""
        error = None if self._sink is None else self._sink.error
        if error is not None:
            with told(self.path):
                raise error

    def _describe(self) -> None:
        """Write everything but what the views saw."""
        from raytracer import __version__

        file, views = self._file, self.views
        plane = views.plane
        file.attrs["version"] = VERSION
        _write_text(file, "format", FORMAT)
        _write_text(file, "creator", f"rt {__version__}")
        numbers = {**plane._asdict(), "inverse_focus": views.inverse_focus, "focus_distance": views.focus_distance}
        numbers |= {name: value for name in _OPTIONAL if (value := getattr(views, name)) is not None}
        for name, number in numbers.items():
            file.attrs[name] = float(number)
        if views.cell is not None:
            file.attrs["cell"] = np.array(views.cell, dtype="<f8")
        if views.pose is not None:
            file.attrs["pose"] = np.array(views.pose, dtype="<f8")
        for name, unit in _UNITS.items():
            _write_text(file, f"{name}_unit", unit)

        position = np.asarray(views.position, dtype="<f8")
        made = self._dataset("position", position.shape, position.dtype, position.shape)
        made[...] = position
        _label(made, ("v", "u", "axis"))
        _write_text(made, "unit", "m")

        # What programs find at the axes; the places of views are in `position`, since they need not be on a grid.
        across, down = np.arange(views.width) + 0.5, np.arange(views.height) + 0.5
        scales = {"s": plane.left + plane.pixel * across, "t": plane.top - plane.pixel * down}
        for axis, scale in scales.items():
            file[axis] = scale.astype("<f8")
            file[axis].make_scale(axis)
            _write_text(file[axis], "unit", "tangent")
        self._radiance = self._made(_RADIANCE, np.empty((0, 0, 3)))
        _write_text(self._radiance, "primaries", "Rec. 709")
        if self._microlenses is not None:
            self._describe_microlenses(self._microlenses)

    def _describe_microlenses(self, places: NDArray[np.float64]) -> None:
        """Write where the microlenses are, and make room for what views saw by them."""
        count, views = len(places), self.views
        made = self._dataset(f"{_MICROLENSES}/place", (count, 2), np.dtype("<f8"), (_RAYS_A_TILE, 2))
        made[...] = places
        _label(made, ("microlens", "axis"))
        _write_text(made, "unit", "pixel of a view")
        size = (views.rows, views.columns, count, 3)
        self._samples = self._dataset(f"{_MICROLENSES}/value", size, self._dtype, (1, 1, _RAYS_A_TILE, 3))
        _label(self._samples, ("v", "u", "microlens", "channel"))

    def _made(self, name: str, like: Any) -> Any:
        """A dataset for all views, of the type and the channels of one."""
        views = self.views
        kind = np.asarray(like).dtype
        # Depths and places need more digits than radiance.
        wanted = self._dtype if name == _RADIANCE else max(self._dtype, np.dtype("<f4"), key=lambda t: t.itemsize)
        dtype = wanted if kind.kind == "f" else kind.newbyteorder("<")
        channels = tuple(np.shape(like))[2:]
        tile = (1, 1, _even(views.height), _even(views.width), *channels)
        size = (views.rows, views.columns, views.height, views.width, *channels)
        made = self._dataset(name, size, dtype, tile)
        _label(made, _AXES[: len(size)])
        made.dims[2].attach_scale(self._file["t"])
        made.dims[3].attach_scale(self._file["s"])
        return made

    def _dataset(self, name: str, shape: tuple[int, ...], dtype: np.dtype[Any], tile: tuple[int, ...]) -> Any:
        # Without tiles there is nothing to compress or to sum.
        if 0 in shape:
            return self._file.create_dataset(name, shape, dtype)
        packed = {"compression": "gzip", "compression_opts": 1, "shuffle": True} if self._compress else {}
        fitting = tuple(min(n, k) for n, k in zip(shape, tile, strict=True))
        return self._file.create_dataset(name, shape, dtype, chunks=fitting, fletcher32=True, **packed)


class _Sink:
    """A file for HDF5 to write, which keeps to itself what goes wrong.

    HDF5 cannot close a file that it could not write, and ends the process at its exit.  So it is told that all is
    well, and whoever writes looks at `error`.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self.error: BaseException | None = None

    def write(self, data: memoryview) -> int:
        self._do(lambda: self._file.write(data))
        return len(data)

    def truncate(self, size: int) -> int:
        self._do(lambda: self._file.truncate(size))
        return size

    def flush(self) -> None:
        self._do(self._file.flush)

    def seek(self, place: int, whence: int = 0) -> int:
        return self._file.seek(place, whence)

    def tell(self) -> int:
        return self._file.tell()

    def read(self, size: int = -1) -> bytes:
        return self._file.read(size)

    def readinto(self, data: memoryview) -> int:
        return self._file.readinto(data)  # type: ignore[attr-defined, no-any-return]

    def _do(self, act: Callable[[], object]) -> None:
        try:
            if self.error is None:
                act()
        except BaseException as error:  # noqa: BLE001
            self.error = error


_UNITS = {
    "pixel": "tangent",
    "left": "tangent",
    "top": "tangent",
    "inverse_focus": "1/m",
    "focus_distance": "m",
    "cell": "m",
    "aperture": "m",
    "focal_length": "mm",
    "pose": "m, and unit vectors",
}


def _even(size: int) -> int:
    """Pixels of a tile, so that the last one is not mostly outside: all are of one size in a file."""
    return -(-size // -(-size // _TILE))


def _label(dataset: Any, labels: tuple[str, ...]) -> None:
    for axis, label in zip(dataset.dims, labels, strict=True):
        axis.label = label


# Whole numbers of HDF5 have 64 bits.
_LARGEST_WHOLE = 2**63


def _write_settings(group: Any, settings: Mapping[str, str | float | int]) -> None:
    for name, value in settings.items():
        is_whole = isinstance(value, int) and not isinstance(value, bool) and abs(value) < _LARGEST_WHOLE
        if is_whole or isinstance(value, float):
            group.attrs[name] = value
        else:
            _write_text(group, name, str(value))


def _write_text(owner: Any, name: str, text: str) -> None:
    """Write a text of fixed length: those of variable length are in a heap without a checksum."""
    encoded = text.encode()
    owner.attrs[name] = np.array(encoded, dtype=f"S{max(len(encoded), 1)}")


def write(
    path: str | Path,
    field: LightField,
    *,
    dtype: str = "float32",
    compress: bool = False,
    update: Callable[[float, float], object] | None = None,
) -> None:
    """Write a light field as an `.lf` file.

    Parameters
    ----------
    dtype : see `Writer`; geometry and rays are float64 always.
    compress : see `Writer`.
    update : told of the progress: rows of views that are written, and all.

    Raises
    ------
    OutputError : the file cannot be written (full disk, quota, permission); what stood there before still does.
    """
    samples = field.samples
    places = None if samples is None else samples.place
    with Writer(
        path, field.views, dtype=dtype, compress=compress, settings=field.settings, microlenses=places
    ) as writer:
        for row in range(field.views.rows):
            for column in range(field.views.columns):
                layers = {name: layer[row, column] for name, layer in field.layers.items()}
                seen = None if samples is None else samples.value[row, column]
                writer.put_view(row, column, field.radiance[row, column], layers, seen)
            if update is not None:
                update(row + 1, field.views.rows)
        if field.rays is not None:
            writer.keep(field.rays)


# ---- Reading


@dataclass(frozen=True, eq=False, repr=False)
class OpenField(LightField):
    """A light field in a file, which is open until `close`, the end of a `with` block, or nothing holds it any more."""

    file: Any = None

    def __enter__(self) -> "OpenField":
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Let go of the file; its arrays cannot be read any more."""
        self.file.close()


def open(path: str | Path) -> OpenField:  # noqa: A001
    """The light field in a file; its arrays are read as they are asked for, by slices, and are `Stored`.

    Raises
    ------
    InputError : the file is missing, truncated, damaged, another kind of file, of a newer version, or its geometry
        makes no sense.
    """
    path = Path(path)
    file = _opened(path)
    try:
        return _field(file, path)
    except InputError:
        file.close()
        raise
    except (OSError, RuntimeError, KeyError, ValueError, TypeError) as error:
        # HDF5 says in its own words what it cannot make sense of.
        file.close()
        raise InputError(f"{path}: is damaged") from error


def _opened(path: Path) -> Any:
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
        return h5py.File(path, "r", locking=False, rdcc_nbytes=_CACHE_BYTES)
    except (OSError, RuntimeError) as error:
        is_short = "truncated" in str(error)
        raise InputError(f"{path}: is {'truncated: its end is missing' if is_short else 'damaged'}") from error


def _field(file: Any, path: Path) -> OpenField:
    kind = _text(file, "format", path)
    if kind != FORMAT:
        raise InputError(f"{path}: is an HDF5 file, but no light field: its attribute format is not {FORMAT!r}")
    version = _number(file, "version", path)
    if version != VERSION:
        raise InputError(f"{path}: is of version {version:g} of the format; this program reads version {VERSION}")

    # Shapes first: everything else has to go with them.
    radiance = _array(file, "radiance", path, axes=5)
    rows, columns, height, width, channels = radiance.shape
    if channels != 3:
        raise InputError(f"{path}: radiance must have 3 channels (red, green, blue), not {channels}")
    position = _array(file, "position", path, axes=3)
    if position.shape != (rows, columns, 2):
        raise InputError(f"{path}: position must be of shape {(rows, columns, 2)} as radiance is, not {position.shape}")

    cell, pose = _numbers(file, "cell", path, (2,)), _numbers(file, "pose", path, (4, 3))
    if pose is not None and not np.isfinite(pose).all():
        raise InputError(f"{path}: its pose must be of finite numbers")
    pixel, left, top, inverse_focus = (_number(file, name, path) for name in _NUMBERS)
    aperture, focal_length = (_numbers(file, name, path, ()) for name in _OPTIONAL)
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
            pose=None if pose is None else Pose(*(_triple(row) for row in pose)),
        )
    except ValueError as error:
        raise InputError(f"{path}: {error}") from error

    size, layers = radiance.shape[:4], {}
    for name in _members(file, "layers", path):
        layer = _array(file, f"layers/{name}", path, axes=None, kinds="fiub")
        if layer.shape[:4] != size or layer.ndim > len(_AXES):
            raise InputError(f"{path}: layer {name} must be of shape {size} as radiance is, not {layer.shape}")
        layers[name] = layer
    samples = _samples(file, path, (rows, columns))
    return OpenField(radiance, views, layers, _rays(file, path), _settings(file, path), samples, file)


def _samples(file: Any, path: Path, size: tuple[int, int]) -> Samples | None:
    if not _members(file, _MICROLENSES, path):
        return None
    place, value = (_array(file, f"{_MICROLENSES}/{name}", path, axes=n) for name, n in (("place", 2), ("value", 4)))
    if place.shape[1] != 2 or value.shape != (*size, place.shape[0], 3):
        wanted = f"(n, 2) and {(*size, 'n', 3)}"
        raise InputError(f"{path}: {_MICROLENSES} must be of shapes {wanted}, not {place.shape} and {value.shape}")
    places = np.asarray(place, dtype=np.float64)
    if not np.isfinite(places).all():
        raise InputError(f"{path}: places of {_MICROLENSES} must be finite")
    return Samples(places, value)


_RAYS = {"place": 2, "value": 2, "weight": 1}


def _rays(file: Any, path: Path) -> Rays | None:
    if not _members(file, "rays", path):
        return None
    place, value, weight = (_array(file, f"rays/{name}", path, axes=axes) for name, axes in _RAYS.items())
    count = len(weight)
    if place.shape != (count, 4) or value.shape != (count, 3):
        shapes = ", ".join(str(array.shape) for array in (place, value, weight))
        raise InputError(f"{path}: rays must be of shapes (n, 4), (n, 3) and (n,), not {shapes}")
    return Rays(place, value, weight)  # type: ignore[arg-type]


def _settings(file: Any, path: Path) -> dict[str, str | float | int]:
    group = _member(file, "settings", path)
    if group is None:
        return {}
    found: dict[str, str | float | int] = {}
    for name in group.attrs:
        value = _attribute(group, name, path)
        if isinstance(value, str | int | float):
            found[_name(name, "settings", path)] = value
    return found


def _triple(row: Any) -> tuple[float, float, float]:
    x, y, z = map(float, row)
    return x, y, z


# ---- What a file claims


def _member(file: Any, name: str, path: Path) -> Any:
    """An object of the file itself, None where there is none: links to other files are not followed."""
    import h5py

    parent = file
    for part in name.split("/"):
        link = parent.get(part, getlink=True) if isinstance(parent, h5py.Group) else None
        if link is None:
            return None
        if not isinstance(link, h5py.HardLink):
            raise InputError(f"{path}: {name} must be in the file itself, and is a link")
        parent = parent[part]
    return parent


def _members(file: Any, name: str, path: Path) -> list[str]:
    """Names in a group; none where there is no such group."""
    import h5py

    group = _member(file, name, path)
    if group is None:
        return []
    if not isinstance(group, h5py.Group):
        raise InputError(f"{path}: {name} must be a group")
    return [_name(member, name, path) for member in group]


def _name(found: str | bytes, kind: str, path: Path) -> str:
    """A name of somebody's choice, if it can be told and written; h5py has bytes for one that is no UTF-8."""
    if isinstance(found, str) and found.isprintable():
        return found
    raise InputError(f"{path}: a name in {kind} is of letters that cannot be printed: {shortened(ascii(found))}")


def _array(file: Any, name: str, path: Path, *, axes: int | None, kinds: str = "f") -> Stored:
    """A dataset that holds as much as it claims to."""
    import h5py

    dataset = _member(file, name, path)
    if not isinstance(dataset, h5py.Dataset):
        raise InputError(f"{path}: has no dataset {name}")
    if dataset.dtype.kind not in kinds or dataset.dtype.subdtype is not None:
        wanted = "floating-point numbers" if kinds == "f" else "numbers"
        raise InputError(f"{path}: {name} must be of {wanted}, not of {shortened(one_line(str(dataset.dtype)))}")
    shape = dataset.shape
    is_ray = name.startswith("rays/")
    if shape is None or len(shape) not in ((axes,) if axes else (4, 5)) or (0 in shape and not is_ray):
        raise InputError(f"{path}: {name} must have {axes or '4 or 5'} axes, none of them empty; its shape is {shape}")
    filters = _filters(dataset)
    if dataset.is_virtual or dataset.external or filters != [known for known in _FILTERS if known in filters]:
        raise InputError(f"{path}: {name} must be in the file itself, plain or compressed by deflate")
    if not _is_plain(dataset.id.get_type(), dataset.dtype):
        raise InputError(f"{path}: {name} is of numbers that no processor has")

    # Values that were never written read as zeros, as many as a file cares to claim.
    claimed = math.prod(shape) * dataset.dtype.itemsize
    held = dataset.id.get_storage_size()
    if claimed > held * (1 if dataset.compression is None else _LARGEST_RATIO) or held > file.id.get_filesize():
        raise InputError(
            f"{path}: {name} claims to be of shape {shape}, {claimed} bytes; the file holds {held} of them"
        )
    if dataset.chunks is not None:
        _check_tiles(dataset, path, name)
    return Stored(dataset, path, name)


def _check_tiles(dataset: Any, path: Path, name: str) -> None:
    """Make sure that a dataset is in tiles of a sensible size, that all are there, and that none is too much to unpack.

    HDF5 writes beyond its arrays where the index of the tiles has been made for another size than they have.
    """
    shape, tile = dataset.shape, dataset.chunks
    if math.prod(tile) > math.prod(shape) + _RAYS_A_TILE:
        raise InputError(f"{path}: {name} is in tiles of {tile}, more than there is of it")
    if dataset.maxshape != shape:
        raise InputError(f"{path}: {name} must be of a fixed size")
    tiles = math.prod(-(-n // k) for n, k in zip(shape, tile, strict=True))
    if dataset.id.get_num_chunks() != tiles:
        raise InputError(f"{path}: {name} has {dataset.id.get_num_chunks()} of {tiles} tiles, and must have all")

    filters = _filters(dataset)
    size, behind = math.prod(tile) * dataset.dtype.itemsize, _SUM_BYTES if _FLETCHER in filters else 0
    places, wrong = set[tuple[int, ...]](), list[int]()

    def see(found: Any) -> None:
        if all(at % k == 0 and at < n for at, n, k in zip(found.chunk_offset, shape, tile, strict=True)):
            places.add(found.chunk_offset)
        most = size + size // _LEAST_GAIN + _LEAST_GAIN
        packed = found.size - behind
        if found.filter_mask != 0 or not (0 < packed <= most if _DEFLATE in filters else packed == size):
            wrong.append(found.size)

    dataset.id.chunk_iter(see)
    if len(places) != tiles:
        raise InputError(f"{path}: {name} has {len(places)} of {tiles} tiles, and must have all")
    if wrong:
        raise InputError(f"{path}: {name} has a tile of {wrong[0]} bytes, which is not what {size} bytes take")


def _filters(dataset: Any) -> list[int]:
    """Numbers of the filters through which a dataset is read."""
    properties = dataset.id.get_create_plist()
    return [properties.get_filter(i)[0] for i in range(properties.get_nfilters())]


def _is_plain(stored: Any, dtype: np.dtype[Any]) -> bool:
    """Whether numbers are stored as `dtype` has them: HDF5's own types may have any number of bits anywhere."""
    import h5py

    return bool(stored == h5py.h5t.py_create(dtype, logical=True))


def _attribute(owner: Any, name: str, path: Path) -> Any:
    """A text, a number, or an array of float64; None where there is none, or it is of another kind."""
    import h5py

    if name not in owner.attrs:
        return None
    attribute = owner.attrs.get_id(name)
    if attribute.get_storage_size() > _LARGEST_ATTRIBUTE:
        raise InputError(f"{path}: its attribute {name} is larger than {_LARGEST_ATTRIBUTE} bytes")
    # HDF5 does not come back from some damaged heaps, in which values of variable length are.
    if h5py.check_vlen_dtype(attribute.dtype) is not None or h5py.check_ref_dtype(attribute.dtype) is not None:
        raise InputError(f"{path}: its attribute {name} must be of fixed length")
    stored, dtype = attribute.get_type(), attribute.dtype
    if not (isinstance(stored, h5py.h5t.TypeStringID) or (dtype.kind in "fiub" and _is_plain(stored, dtype))):
        return None
    value = owner.attrs[name]
    if isinstance(value, str):
        # Bytes that are no UTF-8 are kept by h5py as surrogates, which nothing can write.
        value = value.encode("utf-8", "surrogateescape")
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    if isinstance(value, np.integer) and value.ndim == 0:
        return int(value)
    if isinstance(value, np.floating) and value.ndim == 0:
        return float(value)
    if isinstance(value, np.ndarray) and value.dtype.kind in "fiu":
        return value.astype(np.float64)
    return None


# Scenes' own texts are among settings.
_LARGEST_ATTRIBUTE = 1 << 24


def _text(file: Any, name: str, path: Path) -> str | None:
    value = _attribute(file, name, path)
    return value if isinstance(value, str) else None


def _numbers(file: Any, name: str, path: Path, shape: tuple[int, ...]) -> NDArray[np.float64] | None:
    """An attribute of numbers, None where there is none."""
    if name not in file.attrs:
        return None
    value = _attribute(file, name, path)
    if value is None or isinstance(value, str) or np.shape(value) != shape:
        wanted = "a number" if shape == () else f"numbers of shape {shape}"
        raise InputError(f"{path}: its attribute {name} must be {wanted}")
    return np.asarray(value, dtype=np.float64)


def _number(file: Any, name: str, path: Path) -> float:
    value = _numbers(file, name, path, ())
    if value is None:
        raise InputError(f"{path}: has no attribute {name}")
    return float(value)
