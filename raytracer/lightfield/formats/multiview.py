"""OpenEXR files of several views, .exr: a part for each view, or the views as layers of one part.

An export writes a part for each view with the attribute `view`, channels R, G and B, and the layers as channels of
their names; the attribute `rt.lightfield` of the first part holds the geometry.  An import also takes the files of
other programs: stereo pictures, and any number of views; they make one row, `left` first and `right` last.

References: Academy Software Foundation, "Storing Multi-View Images in OpenEXR Files", and "OpenEXR File Layout".
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.field import DEPTH_LAYER, LightField
from raytracer.film.light_field.lazy_array import LazyArray
from raytracer.film.light_field.views import Views
from raytracer.lightfield.formats import geometry
from raytracer.lightfield.formats.base.exr_parts import SUFFIX, DecodedPart, Header, read_headers, read_parts
from raytracer.lightfield.formats.base.import_geometry import check_same_size, find_geometry
from raytracer.lightfield.formats.base.light_field_format import (
    METRES,
    Exported,
    ExportOptions,
    ImportOptions,
    LightFieldFormat,
    note_left_out,
)
from raytracer.lightfield.formats.base.scanline_exr import Part, map_parts, open_writer
from raytracer.util import safe_open
from raytracer.util.errors import InputError, abbreviate
from raytracer.util.progress import Update, report_progress

GEOMETRY = "rt.lightfield"
"""The attribute with the geometry of the views, as JSON, and the types of the channels."""

_COLOURS = ("R", "G", "B")

_LEFT, _RIGHT = "left", "right"
"""Names of the views of the two eyes, which the convention fixes."""

_TYPES = ("f2", "f4", "u4")
"""Types of the channels of a file."""


# ---- Export


def check_multiview(field: LightField, path: Path, options: ExportOptions) -> None:
    """Check that a file of all views can be written: an InputError says why not."""
    del field, options
    if path.suffix.lower() != SUFFIX:
        raise InputError(f"{path}: views of one file are written as {SUFFIX}")


def _channel_type(dtype: "np.dtype[Any]") -> "np.dtype[Any] | None":
    """Choose the type of a channel for an array; None where no type of the format holds it."""
    if dtype.kind == "f":
        return np.dtype(np.float16 if dtype.itemsize == 2 else np.float32)
    is_small = dtype.kind == "b" or (dtype.kind == "u" and dtype.itemsize <= 4)
    return np.dtype(np.uint32) if is_small else None


def write_multiview(field: LightField, path: Path, options: ExportOptions, update: Update | None) -> Exported:
    """Write a part for each view, view by view; layers of signed or long integers, and rays, are left out."""
    del options
    views = field.views
    types: dict[str, np.dtype[Any]] = dict.fromkeys(_COLOURS, np.dtype(np.float32))
    if field.radiance.dtype.itemsize == 2:
        types = dict.fromkeys(_COLOURS, np.dtype(np.float16))
    layers: dict[str, list[str]] = {}
    for name, layer in field.layers.items():
        kind = _channel_type(layer.dtype)
        channels = [f"{name}.{i}" for i in range(layer.shape[4])] if len(layer.shape) == 5 else [name]
        if kind is not None and not set(channels) & set(types):
            layers[name] = channels
            types |= dict.fromkeys(channels, kind)
    stated = json.loads(geometry.to_json(views, field.settings.get("units")))
    stated |= {"channels": {name: kind.str[1:] for name, kind in types.items()}, "layers": layers}
    at = list(np.ndindex(views.rows, views.columns))
    names = [f"view_{row:02d}_{column:02d}" for row, column in at]
    parts = [Part(name, types, {GEOMETRY: json.dumps(stated)} if i == 0 else {}) for i, name in enumerate(names)]
    with open_writer(path, parts, views.width, views.height) as writer:
        for number, place in enumerate(report_progress(at, update)):
            radiance = np.asarray(field.radiance[place])
            rows = {name: radiance[..., i] for i, name in enumerate(_COLOURS)}
            for name, channels in layers.items():
                planes = np.asarray(field.layers[name][place]).reshape(views.height, views.width, len(channels))
                rows |= {channel: planes[..., i] for i, channel in enumerate(channels)}
            writer.put(number, 0, rows)
    return Exported([path], notes=note_left_out(field, layers))


# ---- Import


def _is_input(path: Path, options: ImportOptions) -> bool:
    """Return True for an .exr file that names several views."""
    del options
    if path.suffix.lower() != SUFFIX or not path.is_file():
        return False
    with safe_open.name_read_errors(path):
        return _names_views(read_headers(path))


def _names_views(headers: Sequence[Header]) -> bool:
    return bool(_stated_views(headers[0])) or len({_view_of(header) for header in headers} - {None}) > 1


def _stated_views(header: Header) -> list[str]:
    """List the views that a part says it has as layers; none if it does not."""
    stated = header.attributes.get("multiView")
    return [name for name in stated if isinstance(name, str)] if isinstance(stated, list) else []


def _view_of(header: Header) -> str | None:
    view = header.attributes.get("view")
    # Of another type, it may not even be text.
    return view if isinstance(view, str) else None


def read_multiview(path: Path, options: ImportOptions) -> LightField:
    """Read the views of a file: those of this program are mapped into memory, others decoded at once."""
    with safe_open.name_read_errors(path):
        headers = read_headers(path)
        own = _read_own(path, headers, options)
        if own is not None:
            return own
        views = _views_of(read_parts(path))
    if len(views) < 2:
        raise InputError(f"{path}: holds fewer than two views with channels R, G and B, or Y")
    depths = [view.depth for view in views if view.depth is not None]
    depths = depths if len(depths) == len(views) else []
    colours = [plane for view in views for plane in view.colours]
    windows = sorted({plane.window for plane in (*colours, *depths)})
    if len(windows) > 1:
        told = ", ".join(map(str, windows))
        raise InputError(f"{path}: holds views of different sizes, or parts of them: the data windows {told}")
    planes = np.array([plane.values for plane in colours], dtype=np.float64)
    radiance = np.moveaxis(planes.reshape(1, len(views), len(_COLOURS), *planes.shape[1:]), 2, -1)
    steps = geometry.regular_grid(1, len(views))
    layers = {DEPTH_LAYER: np.array([plane.values for plane in depths], dtype=np.float64)[None]} if depths else {}
    found, units = find_geometry(path, steps, radiance.shape, options, beside=geometry.beside(path))
    return LightField(radiance, found, layers, settings={"naming": "multiview", **units})


def _read_own(path: Path, headers: Sequence[Header], options: ImportOptions) -> LightField | None:
    """Map the views of a file that this program wrote, and has not been changed; None for any other."""
    text = headers[0].attributes.get(GEOMETRY)
    if not isinstance(text, str):
        return None
    views, stated_units, channels, stated_layers = _parse_geometry(path, text)
    first = headers[0]
    if views.rows * views.columns != len(headers):
        raise InputError(f"{path}: is the geometry of {views.rows * views.columns} views, and there are {len(headers)}")
    check_same_size(path, views, (views.rows, views.columns, first.height, first.width))
    types = {name: np.dtype(kind) for name, kind in channels.items()}
    if not set(_COLOURS) <= set(types) or any(set(header.names) != set(types) for header in headers):
        raise InputError(f"{path}: has other channels than it says")
    parts = [Part(_view_of(header) or "", types) for header in headers]
    blocks = map_parts(path, parts, views.width, views.height)
    if blocks is None:
        # Another program has written it again.
        blocks = _decode_blocks(path, views, types)
    radiance = LazyChannels(blocks, views, _COLOURS)
    layers = {name: LazyChannels(blocks, views, names) for name, names in stated_layers.items()}
    steps = geometry.regular_grid(views.rows, views.columns)
    found, units = find_geometry(
        path, steps, radiance.shape, options, beside=None, stated=lambda: (views, stated_units)
    )
    try:
        return LightField(radiance, found, layers, settings={"naming": "multiview", **units})
    except ValueError as error:
        raise InputError(f"{path}: {error}") from error


class _OwnGeometry(NamedTuple):
    """Contents of the attribute of the geometry.

    units : the settings of its units.
    channels : types by name.
    layers : names of the channels of each.
    """

    views: Views
    units: dict[str, str]
    channels: dict[str, str]
    layers: dict[str, list[str]]


def _parse_geometry(path: Path, text: str) -> _OwnGeometry:
    """Parse the attribute of the geometry; an InputError says what is wrong with it."""
    views, units = geometry.parse(path, text)
    values = json.loads(text)
    channels, layers = values.get("channels"), values.get("layers", {})
    if not isinstance(channels, dict) or not all(kind in _TYPES for kind in channels.values()):
        raise InputError(f"{path}: is a broken file of views: it does not say the types of its channels")
    is_known = isinstance(layers, dict) and all(
        isinstance(names, list) and names and all(isinstance(name, str) and name in channels for name in names)
        for names in layers.values()
    )
    if not is_known:
        raise InputError(f"{path}: is a broken file of views: it has not the channels of its layers")
    for name in layers:
        # What an .lf file cannot hold, in which layers have a path.
        if not name.isprintable() or "/" in name or name in ("", "."):
            raise InputError(f"{path}: is a broken file of views: no layer can be called {abbreviate(ascii(name))}")
    return _OwnGeometry(views, units, channels, layers)


def _decode_blocks(path: Path, views: Views, types: Mapping[str, "np.dtype[Any]"]) -> list[NDArray[Any]]:
    """Decode all parts, as structured arrays of rows (height,)."""
    # First, since they refuse a size that is not in the file: NumPy has no type for a row of any width.
    parts = read_parts(path)
    first = parts[0].header
    is_same = all(part.header.window == first.window for part in parts)
    if not is_same or (first.height, first.width) != (views.height, views.width):
        raise InputError(f"{path}: holds views of different sizes, or parts of them")
    kind = np.dtype([(f"channel {name}", each, (views.width,)) for name, each in types.items()])
    blocks = []
    for part in parts:
        rows = np.zeros(views.height, kind)
        for name in types:
            rows[f"channel {name}"] = part.planes[name]
        blocks.append(rows)
    return blocks


class LazyChannels(LazyArray):
    """Channels of all views, (rows, columns, height, width), or with a last axis of channels if there are several.

    blocks : of each view, rows with a field for each channel.
    """

    def __init__(self, blocks: Sequence[NDArray[Any]], views: Views, names: Sequence[str]) -> None:
        self._blocks, self._names = blocks, [f"channel {name}" for name in names]
        channels = (len(names),) if len(names) > 1 else ()
        kind = blocks[0].dtype[self._names[0]].base.newbyteorder("=")
        super().__init__((views.rows, views.columns, views.height, views.width, *channels), kind)

    def _read(self, ahead: tuple[slice, ...]) -> NDArray[Any]:
        rows, columns, *within = (range(size)[part] for part, size in zip(ahead, self.shape, strict=True))
        parts = np.zeros([len(rows), len(columns), *map(len, within)], self.dtype)
        for r, c in np.ndindex(len(rows), len(columns)):
            block = self._blocks[rows[r] * self.shape[1] + columns[c]][ahead[2]]
            planes = [block[name][:, ahead[3]] for name in self._names]
            parts[r, c] = np.stack(planes, axis=-1)[..., ahead[4]] if len(self.shape) == 5 else planes[0]
        return parts


class _Plane(NamedTuple):
    """A channel of a view of another program.

    values : numbers (height, width).
    window (px) : left, top, right and bottom of its part's data window.
    """

    values: NDArray[Any]
    window: tuple[int, int, int, int]


class _View(NamedTuple):
    """A view of another program.

    colours : red, green and blue.
    depth : of its pixels, None if the file has none.
    """

    colours: list[_Plane]
    depth: _Plane | None


def _views_of(parts: Sequence[DecodedPart]) -> list[_View]:
    """List the views of a file from left to right."""
    planes: dict[str, dict[str, _Plane]] = {}
    if stated := _stated_views(parts[0].header):
        for channel, plane in parts[0].planes.items():
            view, name = _split_name(channel, stated)
            planes.setdefault(view, {}).setdefault(name, _Plane(plane, parts[0].header.window))
        order = [name for name in stated if name in planes]
    else:
        for part in parts:
            for channel, plane in part.planes.items():
                of_view = planes.setdefault(str(_view_of(part.header)), {})
                of_view.setdefault(channel, _Plane(plane, part.header.window))
        order = list(planes)
    order.sort(key=lambda name: (name != _LEFT) + (name == _RIGHT))
    return [view for view in map(_make_view, (planes[name] for name in order)) if view is not None]


def _split_name(channel: str, views: Sequence[str]) -> tuple[str, str]:
    """Split the name of a channel, `layer.view.channel`, into its view and the rest; the first view has no name."""
    *before, last = channel.split(".")
    if before and before[-1] in views:
        return before[-1], ".".join((*before[:-1], last))
    return views[0], channel


def _make_view(planes: Mapping[str, _Plane]) -> _View | None:
    names = next((names for names in (_COLOURS, ("Y", "Y", "Y")) if all(name in planes for name in names)), None)
    if names is None:
        return None
    depth = next((planes[name] for name in ("Z", "depth.Z", "depth") if name in planes), None)
    return _View([planes[name] for name in names], depth)


FORMATS = (
    LightFieldFormat(
        "multiview",
        "an .exr file with a part for each view",
        is_input=_is_input,
        read=read_multiview,
        is_output=lambda path: path.suffix.lower() == SUFFIX and not path.is_dir(),
        check=check_multiview,
        write=write_multiview,
        takes=frozenset(),
        import_takes=METRES,
        order=30,
    ),
)
