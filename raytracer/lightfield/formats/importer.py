"""Import of light fields of other programs: folders of views, arrays, and pictures that show all views."""

import contextlib
import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypedDict, Unpack

import numpy as np
from numpy.typing import NDArray

from raytracer.film import image_file
from raytracer.film.formats import pfm
from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.views import Views
from raytracer.lightfield.formats import folders, geometry, hci
from raytracer.lightfield.formats.folders import ViewFiles, list_images
from raytracer.lightfield.formats.geometry import KnownGeometry, ViewOptics
from raytracer.lightfield.formats.lazy_views import LazyNpy, LazyPictures, PartialLayer, split_montage
from raytracer.util.errors import InputError
from raytracer.util.safe_open import read_regular

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


def _ground_truth_layers(folder: Path, views: Views) -> dict[str, PartialLayer]:
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
