"""The geometry of light fields of other programs: from options, or a file beside the views."""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.views import Plane, Pose, Views
from raytracer.util.errors import InputError
from raytracer.util.safe_open import read_regular

FILE = "geometry.json"
"""Name of the file, in a folder of views, that holds their geometry as this program writes it."""

_LARGEST = 1 << 26
"""Most bytes of a file: room for a million views' places, more than folders have."""

_NUMBERS = ("inverse_focus", "aperture", "focal_length")


class KnownGeometry(NamedTuple):
    """Known parts of the geometry of a light field; None where they are not known.

    spacing : from view to view, right and down (m).
    focus_distance : of the plane in which all views see the same (m); inf for parallel ones.
    pixel : edge of a pixel in the image at a distance of 1 (tangent).
    """

    spacing: tuple[float, float] | None = None
    focus_distance: float | None = None
    pixel: float | None = None


class ViewOptics(NamedTuple):
    """The field of view of a view, as options give it: directly, or by a focal length and a sensor.

    vfov : vertical field of view (degrees).
    focal_length, sensor : focal length, and width of the sensor (mm).
    """

    vfov: float | None = None
    focal_length: float | None = None
    sensor: float | None = None

    def pixel(self, width: int, height: int) -> float | None:
        """Compute the edge of a pixel at a distance of 1, of views of width x height; None if not given."""
        if self.vfov is not None:
            return 2.0 * math.tan(math.radians(0.5 * self.vfov)) / height
        if self.focal_length is not None and self.sensor is not None:
            return self.sensor / self.focal_length / width
        return None


def regular_grid(rows: int, columns: int) -> NDArray[np.float64]:
    """Place views on a regular grid, in steps of one view: (rows, columns, 2), right and up from the middle."""
    right = np.arange(columns) - 0.5 * (columns - 1)
    up = 0.5 * (rows - 1) - np.arange(rows)
    return np.stack(np.broadcast_arrays(right, up[:, None]), axis=-1)


def make_views(
    path: Path, steps: NDArray[np.float64], width: int, height: int, known: KnownGeometry
) -> tuple[Views, dict[str, str]]:
    """Make the geometry of views at `steps` (steps of one view, right and up), and the settings that say its units.

    Without metres a distance `1 / w` is where what is seen moves by `w` pixels from view to view.

    Raises InputError: the lengths of a file are so large or small that numbers do not hold the places of its views.
    """
    if known.spacing is None or known.focus_distance is None or known.pixel is None:
        return Views(steps, Plane(1.0, -0.5 * width, 0.5 * height), width, height), {"units": "views"}
    plane = Plane(known.pixel, -0.5 * width * known.pixel, 0.5 * height * known.pixel)
    inverse = 0.0 if math.isinf(known.focus_distance) else 1.0 / known.focus_distance
    with np.errstate(over="ignore"):
        position = steps * np.array(known.spacing)
    try:
        return Views(position, plane, width, height, inverse), {}
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None


def beside(path: Path) -> Path:
    """Return the file beside a picture or an array of views that holds their geometry: `NAME.geometry.json`."""
    return path.with_suffix(f".{FILE}")


class StatedLayout(NamedTuple):
    """Layout that the file beside a picture states of the views in it.

    name : of the layout; None if it does not say, or means a file of the same name with another suffix.
    rows, columns : of views.
    """

    name: str | None
    rows: int
    columns: int


def read_layout(path: Path) -> StatedLayout | None:
    """Read what the file beside a picture says of its layout; None if there is none, or a broken one."""
    try:
        text = read_regular(beside(path), _LARGEST)
        views, _ = parse(beside(path), text)
    except (OSError, ValueError, InputError):
        return None
    values = json.loads(text)
    name = values.get("layout")
    is_of_this = isinstance(name, str) and values.get("suffix") == path.suffix.lower()
    return StatedLayout(name if is_of_this else None, views.rows, views.columns)


def stated_layout(path: Path) -> str | None:
    """Read which layout the file beside a picture says that it has; see `read_layout`."""
    stated = read_layout(path)
    return None if stated is None else stated.name


def to_json(views: Views, units: str | float | None, more: Mapping[str, str] | None = None) -> bytes:
    """Write a geometry as JSON (UTF-8), and more keys."""
    values: dict[str, Any] = {"width": views.width, "height": views.height, **views.plane._asdict()}
    values |= {name: getattr(views, name) for name in _NUMBERS}
    values |= {"cell": views.cell, "pose": None if views.pose is None else views.pose._asdict()}
    values |= {"units": units, **(more or {}), "position": views.position.tolist()}
    given = {name: value for name, value in values.items() if value is not None}
    return (json.dumps(given, indent=1, allow_nan=False) + "\n").encode()


def read(path: Path) -> tuple[Views, dict[str, str]]:
    """Read a geometry from a JSON file, and the settings that say its units; an InputError says that it is none."""
    try:
        text = read_regular(path, _LARGEST)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    return parse(path, text)


def parse(path: Path, text: str | bytes) -> tuple[Views, dict[str, str]]:
    """Parse a geometry of a file, as JSON; see `read`."""
    try:
        values = json.loads(text)
        pose, cell = values.get("pose"), values.get("cell")
        views = Views(
            position=np.array(values["position"], dtype=np.float64),
            plane=Plane(*(float(values[name]) for name in Plane._fields)),
            width=int(values["width"]),
            height=int(values["height"]),
            inverse_focus=float(values["inverse_focus"]),
            cell=None if cell is None else (float(cell[0]), float(cell[1])),
            aperture=None if "aperture" not in values else float(values["aperture"]),
            focal_length=None if "focal_length" not in values else float(values["focal_length"]),
            pose=None if pose is None else Pose.of(pose[name] for name in Pose._fields),
        )
    except KeyError as error:
        raise InputError(f"{path}: is no geometry of a light field: it has no {error}") from error
    except (ValueError, TypeError, LookupError, AttributeError, ArithmeticError, RecursionError) as error:
        raise InputError(f"{path}: is no geometry of a light field, or a broken one") from error
    return views, {"units": "views"} if values.get("units") == "views" else {}
