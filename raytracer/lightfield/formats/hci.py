"""`parameters.cfg` of the 4D Light Field Benchmark of Konstanz and Heidelberg (HCI).

Views are `input_Cam000.png` and so on, by rows from the top left; `gt_depth_lowres.pfm` (m, along the axis) and
`gt_disp_lowres.pfm` (pixels from view to view, larger where it is nearer) are of the view in the middle.  The sensor's
size is that of the longer side of the image.

References: Honauer, Johannsen, Kondermann, Goldluecke 2016, "A Dataset and Evaluation Methodology for Depth Estimation
on 4D Light Fields"; the keys and the relation of disparity and depth are those of the benchmark's evaluation toolkit.
"""

import configparser
import io
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.views import Pose, Views
from raytracer.lightfield.formats.geometry import KnownGeometry, regular_grid
from raytracer.schema.units import METRES_PER_MILLIMETRE
from raytracer.util.errors import InputError
from raytracer.util.safe_open import read_regular

FILE = "parameters.cfg"

DISPARITY_MAP = "disp"
"""Kind of maps in names of the benchmark's files; that of distances is the name of the light field's layer."""

_LARGEST = 1 << 20
"""Most bytes of the file: those of the benchmark have one or two thousand."""

_GRID_TOLERANCE = 1e-6
"""Largest distance, in steps of one view, of a view from its place on a grid that counts as regular: numbers in
millimetres have six digits."""

_SENSOR_MM = 35.0
"""Sensor size written for views whose sensor is not known: that of the benchmark's scenes."""

_PINHOLE = 100.0
"""The f-number that the benchmark's scenes have, whose views are sharp throughout."""

_POSE_KEYS = tuple(f"center_cam_{name}" for name in ("x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad"))

_NO_POSE = dict.fromkeys(_POSE_KEYS, "0.0")
"""Pose written where none is known, since the benchmark's readers require one."""


class HciParameters(NamedTuple):
    """Contents of the file.

    rows, columns : number of views.
    width, height : pixels of a view.
    known : geometry of the views.
    pose : of the view in the middle; None if the file has none.
    """

    rows: int
    columns: int
    width: int
    height: int
    known: KnownGeometry
    pose: Pose | None


def read(path: Path) -> HciParameters:
    """Read a `parameters.cfg`; an InputError says what is missing, or what number makes no sense."""
    parser = configparser.ConfigParser(interpolation=None)
    try:
        parser.read_string(read_regular(path, _LARGEST).decode("utf-8"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    except (configparser.Error, UnicodeError) as error:
        raise InputError(f"{path}: is no file of parameters, with sections and KEY = VALUE") from error

    def number(section: str, key: str) -> float:
        if not parser.has_option(section, key):
            raise InputError(f"{path}: has no {key} in [{section}]")
        try:
            return float(parser.get(section, key))
        except ValueError:
            value = parser.get(section, key)
            raise InputError(f"{path}: {key} must be a number, not {value!r:.40}") from None

    def positive(section: str, key: str) -> float:
        value = number(section, key)
        if not value > 0.0:
            raise InputError(f"{path}: {key} must be greater than 0, not {value:g}")
        return value

    def count(section: str, key: str) -> int:
        value = positive(section, key)
        if not math.isfinite(value) or value != int(value):
            raise InputError(f"{path}: {key} must be an integer, not {value:g}")
        return int(value)

    width, height = count("intrinsics", "image_resolution_x_px"), count("intrinsics", "image_resolution_y_px")
    focal_length = positive("intrinsics", "focal_length_mm")
    pixel = positive("intrinsics", "sensor_size_mm") / focal_length / max(width, height)
    spacing = positive("extrinsics", "baseline_mm") * METRES_PER_MILLIMETRE
    distance = positive("extrinsics", "focus_distance_m")
    if not math.isfinite(pixel + spacing + 1.0 / distance) or pixel == 0.0:
        raise InputError(f"{path}: its lengths must be finite, and none so small that nothing is left of it")
    pose = None
    if all(parser.has_option("extrinsics", name) for name in _POSE_KEYS):
        pose = _pose([number("extrinsics", name) for name in _POSE_KEYS])
    return HciParameters(
        rows=count("extrinsics", "num_cams_y"),
        columns=count("extrinsics", "num_cams_x"),
        width=width,
        height=height,
        known=KnownGeometry((spacing, spacing), distance, pixel),
        pose=pose,
    )


def _pose(numbers: list[float]) -> Pose | None:
    """Convert a place (m) and angles (radians) to a pose; None if they are not finite.

    The camera looks down with its top to +y, and is turned about x, y and z in this order, as Blender's.
    """
    from scipy.spatial.transform import Rotation

    if not all(map(math.isfinite, numbers)):
        return None
    right, up, backward = Rotation.from_euler("xyz", numbers[3:]).as_matrix().T
    return Pose.of([numbers[:3], right, up, -backward])


def grid_spacing(views: Views) -> float:
    """Measure the distance from view to view (m) of a regular grid, the same to the right and down.

    Raises ValueError: they are on no such grid, or look past the middle of their images.
    """
    rows, columns = views.rows, views.columns
    wide = float(np.ptp(views.position[..., 0])) / max(columns - 1, 1)
    high = float(np.ptp(views.position[..., 1])) / max(rows - 1, 1)
    step = max(wide, high)
    away = views.position - views.position.mean(axis=(0, 1)) - step * regular_grid(rows, columns)
    if step <= 0.0 or np.abs(away).max() > _GRID_TOLERANCE * step:
        raise ValueError("its views are not on a grid of one spacing, which parameters.cfg cannot tell")
    plane = views.plane
    off = max(abs(plane.left + 0.5 * views.width * plane.pixel), abs(plane.top - 0.5 * views.height * plane.pixel))
    if off > _GRID_TOLERANCE * plane.pixel * max(views.width, views.height):
        raise ValueError("its views look past the middle of their images, which parameters.cfg cannot tell")
    return step


def to_cfg(views: Views, name: str, disparity: NDArray[np.float64] | None) -> bytes:
    """Write a `parameters.cfg` (UTF-8), with all keys that the benchmark's own readers require.

    disparity : of the view in the middle (pixels from view to view), for the range that is noted; None if not known.
    """
    longer = max(views.width, views.height)
    focal_length = views.focal_length or _SENSOR_MM / (views.plane.pixel * longer)
    # A view's f-number is that of the disc as large as its cell.
    diameter = 0.0 if views.cell is None else 2.0 * math.sqrt(views.cell[0] * views.cell[1] / math.pi)
    f_number = focal_length * METRES_PER_MILLIMETRE / diameter if diameter > 0.0 else _PINHOLE
    parser = configparser.ConfigParser(interpolation=None)
    parser["intrinsics"] = {
        "focal_length_mm": repr(focal_length),
        "image_resolution_x_px": str(views.width),
        "image_resolution_y_px": str(views.height),
        "sensor_size_mm": repr(views.plane.pixel * longer * focal_length),
        "fstop": repr(f_number),
    }
    parser["extrinsics"] = {
        "num_cams_x": str(views.columns),
        "num_cams_y": str(views.rows),
        "baseline_mm": repr(grid_spacing(views) / METRES_PER_MILLIMETRE),
        "focus_distance_m": repr(views.focus_distance),
        **_pose_keys(views.pose),
    }
    known = None if disparity is None else disparity[np.isfinite(disparity)]
    low, high = (0.0, 0.0) if known is None or known.size == 0 else (float(known.min()), float(known.max()))
    parser["meta"] = {
        "scene": name,
        "category": "additional",
        **dict.fromkeys(("date", "version", "authors", "contact"), ""),
        "disp_min": repr(low),
        "disp_max": repr(high),
        "frustum_disp_min": repr(low),
        "frustum_disp_max": repr(high),
        "depth_map_scale": "1.0",
    }
    buffer = io.StringIO()
    parser.write(buffer)
    return buffer.getvalue().encode()


def _pose_keys(pose: Pose | None) -> dict[str, str]:
    """Convert a pose to the keys of the file; zeros if there is none, or it is mirrored."""
    from scipy.spatial.transform import Rotation

    if pose is None:
        return _NO_POSE
    backward = -np.array(pose.forward)
    axes = np.stack([np.array(pose.right), np.array(pose.up), backward], axis=1)
    if np.linalg.det(axes) <= 0.0:
        return _NO_POSE
    angles = Rotation.from_matrix(axes).as_euler("xyz")
    return {key: repr(float(value)) for key, value in zip(_POSE_KEYS, (*pose.origin, *angles), strict=True)}


def depth_to_disparity(depth: NDArray[np.float64], views: Views, step: float) -> NDArray[np.float64]:
    """Convert depth (m) to disparity: pixels by which a point moves left from a view to the next on its right."""
    with np.errstate(divide="ignore"):
        return np.asarray(step * (1.0 / depth - views.inverse_focus) / views.plane.pixel)


def disparity_to_depth(disparity: NDArray[np.float64], views: Views, step: float) -> NDArray[np.float64]:
    """Convert disparity (pixels from view to view) to depth (m)."""
    # A file may hold any numbers.
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        return np.asarray(1.0 / (disparity * views.plane.pixel / step + views.inverse_focus))
