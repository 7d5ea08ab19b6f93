"""Pictures with a camera each, `transforms.json`, as NeRF, instant-ngp and nerfstudio read them.

The cameras' axes are those of OpenGL: right, up and backward.  Views that are sheared to converge have principal points
off the middle (`cx` and `cy` of each frame).  An export writes `images/view_03_05.png`, and depths along the axis in
millimetres, nerfstudio's unit, as `depths/view_03_05.npy`, 0 where nothing is known.  An import makes views of one
plane of cameras that stand in one and look along one axis, and views with poses of their own of any others.
"""

import dataclasses
import json
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.film.formats.npy import encode_array
from raytracer.film.formats.registry import image_suffixes
from raytracer.film.light_field.field import DEPTH_LAYER, LightField
from raytracer.film.light_field.lazy_array import LazyArray
from raytracer.film.light_field.posed_field import PosedLightField
from raytracer.film.light_field.posed_views import PosedViews
from raytracer.film.light_field.views import Views
from raytracer.lightfield.formats.base.camera_frames import (
    Transforms,
    arrange,
    find_plane,
    make_posed_views,
    read_transforms,
)
from raytracer.lightfield.formats.base.lazy_views import LazyPictures
from raytracer.lightfield.formats.base.light_field_format import (
    METRES,
    AnyField,
    Exported,
    ExportOptions,
    ImportOptions,
    LightFieldFormat,
    note_left_out,
)
from raytracer.lightfield.formats.view_folder import check_no_others, check_view_suffix, write_views
from raytracer.schema.units import METRES_PER_MILLIMETRE
from raytracer.util import safe_open
from raytracer.util.atomic_write import write_bytes
from raytracer.util.errors import InputError
from raytracer.util.path_sandbox import PathSandbox, make_sandbox
from raytracer.util.progress import Update

FILE = "transforms.json"

_JSON, _NPY = ".json", ".npy"


# ---- Export


def _folder(path: Path) -> Path:
    return path.parent if path.suffix.lower() == _JSON else path


def _file(path: Path) -> Path:
    return path if path.suffix.lower() == _JSON else path / FILE


def _view_names(field: AnyField, suffix: str) -> list[list[str]]:
    views = field.views
    return [[f"view_{row:02d}_{column:02d}{suffix}" for column in range(views.columns)] for row in range(views.rows)]


def check_transforms(field: AnyField, path: Path, options: ExportOptions) -> None:
    """Check that pictures with cameras can be written; an InputError says why not."""
    if not field.is_metric:
        raise InputError(f"{path}: cameras need metres, which this light field has not: export as grid")
    suffix = options.suffix or ".png"
    check_view_suffix(path, suffix, options)
    check_no_others(_folder(path) / "images", {name for row in _view_names(field, suffix) for name in row})


def write_transforms(field: AnyField, path: Path, options: ExportOptions, update: Update | None) -> Exported:
    """Write a picture of each view, its depth if it is known, and the file of the cameras."""
    folder, file = _folder(path), _file(path)
    suffix = options.suffix or ".png"
    names = _view_names(field, suffix)
    written, clipped = write_views(field, folder / "images", names, options, update)
    posed = field.views if isinstance(field.views, PosedViews) else PosedViews.of(field.views)
    has_depth = DEPTH_LAYER in field.layers
    shared, frames = _cameras(posed)
    for (row, column), frame in zip(np.ndindex(posed.rows, posed.columns), frames, strict=True):
        name = names[row][column]
        frame["file_path"] = f"images/{name}"
        if has_depth:
            depth = np.asarray(field.layers[DEPTH_LAYER][row, column], dtype=np.float64) / METRES_PER_MILLIMETRE
            written.append(folder / "depths" / f"{Path(name).stem}{_NPY}")
            write_bytes(written[-1], encode_array(np.where(np.isfinite(depth), depth, 0.0)))
            frame["depth_file_path"] = f"depths/{written[-1].name}"
    own: dict[str, Any] = {"rows": posed.rows}
    if isinstance(field, LightField):
        views = field.views
        known = {"cell": views.cell, "aperture": views.aperture, "focal_length": views.focal_length}
        own |= {key: value for key, value in known.items() if value is not None}
    text = json.dumps({**shared, "rt": own, "frames": frames}, indent=1, allow_nan=False)
    write_bytes(file, (text + "\n").encode())
    return Exported([*written, file], clipped, note_left_out(field, [DEPTH_LAYER]))


def _cameras(posed: PosedViews) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Make the keys that all cameras share, and those of each frame.

    Readers take a key of the whole file before that of a frame, so that none stands there which frames differ in.
    """
    pose = posed.pose.reshape(-1, 4, 3)
    pixel, left, top = posed.plane.reshape(-1, 3).T
    numbers = {"fl_x": 1.0 / pixel, "fl_y": 1.0 / pixel, "cx": -left / pixel, "cy": top / pixel}
    shared: dict[str, Any] = {"camera_model": "OPENCV", "w": posed.width, "h": posed.height}
    frames: list[dict[str, Any]] = [{} for _ in pose]
    if (pixel == pixel[0]).all():
        shared["camera_angle_x"] = 2.0 * math.atan(0.5 * posed.width * float(pixel[0]))
    for key, values in numbers.items():
        if (values == values[0]).all():
            shared[key] = float(values[0])
            continue
        for frame, value in zip(frames, values.tolist(), strict=True):
            frame[key] = value
    for frame, (origin, right, up, forward) in zip(frames, pose, strict=True):
        matrix = np.eye(4)
        matrix[:3] = np.stack([right, up, -forward, origin], axis=1)
        frame["transform_matrix"] = matrix.tolist()
    return shared, frames


# ---- Import


def _is_input(path: Path, options: ImportOptions) -> bool:
    del options
    return (path / FILE).is_file() if path.is_dir() else path.suffix.lower() == _JSON


def read_cameras(path: Path, options: ImportOptions) -> AnyField:
    """Read pictures with cameras, which are read as they are asked for."""
    if options.has_metres:
        raise InputError(
            f"{path}: says where its cameras are: --spacing, --focus-distance and --vfov do not go with it"
        )
    file = _file(path)
    given = read_transforms(file)
    sandbox = make_sandbox(file.parent, options.allow_files)
    pictures = [_find(file, sandbox, frame.file) for frame in given.frames]
    depths = [None if frame.depth_file is None else _find(file, sandbox, frame.depth_file) for frame in given.frames]
    count = len(given.frames)
    stated = given.own.get("rows")
    rows = stated if isinstance(stated, int) and stated > 0 and count % stated == 0 else None
    in_order = LazyPictures([pictures])
    height, width = in_order.shape[2:4]
    posed = make_posed_views(file, given.frames, width, height, rows or 1)
    planar = find_plane(posed)
    order = np.arange(count).reshape(rows or 1, -1).tolist()
    if planar is not None and rows is None:
        order = arrange(posed)
        frames = [given.frames[number] for row in order for number in row]
        posed = make_posed_views(file, frames, width, height, len(order))
        planar = find_plane(posed)
    radiance = in_order.rearrange([[pictures[number] for number in row] for row in order])
    layers: dict[str, Any] = {}
    if all(depth is not None for depth in depths):
        files = [[depths[number] for number in row] for row in order]
        layers[DEPTH_LAYER] = LazyDepths(files, radiance.shape[2:4], given.depth_scale)
    settings = {"naming": "transforms"}
    if planar is None:
        return PosedLightField(radiance, posed, layers, settings)
    return LightField(radiance, _with_lens(file, planar, given), layers, settings=settings)


def _with_lens(file: Path, planar: Views, given: Transforms) -> Views:
    """Add to the geometry of views in a plane what this program wrote of their lens."""
    numbers = {key: value for key, value in given.own.items() if key in ("aperture", "focal_length")}
    try:
        lens: dict[str, Any] = {key: float(value) for key, value in numbers.items()}
        if "cell" in given.own:
            right, up = map(float, given.own["cell"])
            lens["cell"] = right, up
        return dataclasses.replace(planar, **lens)
    except (ValueError, TypeError, LookupError, OverflowError) as error:
        raise InputError(f"{file}: rt must hold what rt wrote of the lens: cell, aperture and focal_length") from error


def _find(file: Path, sandbox: PathSandbox, name: str) -> Path:
    """Find a file that a frame names, relative to the folder, and with or without its suffix."""
    if not name.isprintable():
        raise InputError(f"{file}: names a file by letters that cannot be printed: {ascii(name)[:80]}")
    if not Path(name).name:
        raise InputError(f"{file}: names a picture or a depth by {name!r}, which is no file")
    if not sandbox.allows(name):
        raise InputError(f"{file}: {sandbox.refusal_message(name)}")
    path = file.parent / name
    with safe_open.name_read_errors(path):
        if path.suffix and path.exists():
            return path
        known = (path.with_name(path.name + suffix) for suffix in image_suffixes())
        return next((each for each in known if each.exists()), path)


class LazyDepths(LazyArray):
    """Depths of views in a file each, float64 (rows, columns, height, width) in metres; NaN where a file has 0.

    scale : metres of one unit.

    Raises InputError, when one is read: a file is broken, or of another size than the views.
    """

    def __init__(self, files: Sequence[Sequence[Path | None]], size: Sequence[int], scale: float) -> None:
        self._files, self._scale = files, scale
        super().__init__((len(files), len(files[0]), size[0], size[1]), np.dtype(np.float64))

    def _read(self, ahead: tuple[slice, ...]) -> NDArray[Any]:
        rows, columns, *within = (range(size)[part] for part, size in zip(ahead, self.shape, strict=True))
        depths = [self._depth(self._files[row][column])[ahead[2:]] for row in rows for column in columns]
        return np.array(depths, dtype=self.dtype).reshape([len(rows), len(columns), *map(len, within)])

    def _depth(self, path: Path | None) -> NDArray[np.float64]:
        assert path is not None
        with safe_open.name_read_errors(path):
            stored = _READERS.get(path.suffix.lower(), _read_png)(path)
        if stored.shape != self.shape[2:]:
            height, width = self.shape[2:]
            raise InputError(f"{path}: must be a depth for each of {width} x {height} pixels, is {stored.shape}")
        depth = stored.astype(np.float64) * self._scale
        return np.where(depth > 0.0, depth, np.nan)


def _read_npy(path: Path) -> NDArray[Any]:
    array = safe_open.parse_npy(safe_open.read_regular(path))
    return array.reshape(array.shape[:2]) if array.ndim == 3 and array.shape[2] == 1 else array


def _read_png(path: Path) -> NDArray[Any]:
    """Read integers of 16 bits, of one channel."""
    from raytracer.film.formats.base.image_format import wrap_decode_errors
    from raytracer.film.formats.base.pillow import open_with_pillow

    with wrap_decode_errors(path.suffix), open_with_pillow(safe_open.read_regular(path), ("PNG", "TIFF")) as file:
        return np.asarray(file)


_READERS: dict[str, Callable[[Path], NDArray[Any]]] = {_NPY: _read_npy}


FORMATS = (
    LightFieldFormat(
        "transforms",
        "a folder of pictures with transforms.json",
        is_input=_is_input,
        read=read_cameras,
        is_output=lambda path: path.suffix.lower() == _JSON,
        check=check_transforms,
        write=write_transforms,
        takes=frozenset({"suffix", "bits"}),
        # Metres have a sentence of their own.
        import_takes=METRES | {"allow_files"},
        takes_posed=True,
        folder=_folder,
        order=10,
    ),
)
