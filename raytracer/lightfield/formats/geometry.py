"""The geometry of light fields of other programs: from options, or a file beside the views."""

import json
import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.errors import InputError
from raytracer.plenoptic.views import Plane, Pose, Views
from raytracer.untrusted import contents

FILE = "geometry.json"
"""In a folder of views: their geometry, as this program writes it beside them."""


_LARGEST = 1 << 26
"""Bytes of a file: a million views' places, and more than folders have."""

_NUMBERS = ("inverse_focus", "aperture", "focal_length")


class Known(NamedTuple):
    """What is known of how a light field was taken; None where it is not.

    spacing : from view to view, right and down (m).
    focus_distance : of the plane in which all views see the same (m); inf for parallel ones.
    pixel : edge of a pixel in the image at a distance of 1 (tangent).
    """

    spacing: tuple[float, float] | None = None
    focus_distance: float | None = None
    pixel: float | None = None


class Optics(NamedTuple):
    """How wide views see: by a vertical field of view (degrees), or a focal length and a sensor's width (mm)."""

    vfov: float | None = None
    focal_length: float | None = None
    sensor: float | None = None

    def pixel(self, width: int, height: int) -> float | None:
        """Edge of a pixel at a distance of 1, of views of width x height; None if that is not said."""
        if self.vfov is not None:
            return 2.0 * math.tan(math.radians(0.5 * self.vfov)) / height
        if self.focal_length is not None and self.sensor is not None:
            return self.sensor / self.focal_length / width
        return None


def regular(rows: int, columns: int) -> NDArray[np.float64]:
    """Views on a grid, in steps of one view: (rows, columns, 2), right and up from the middle."""
    right = np.arange(columns) - 0.5 * (columns - 1)
    up = 0.5 * (rows - 1) - np.arange(rows)
    return np.stack(np.broadcast_arrays(right, up[:, None]), axis=-1)


def views(steps: NDArray[np.float64], width: int, height: int, known: Known) -> tuple[Views, dict[str, str]]:
    """The geometry of views at `steps` (steps of one view, right and up), and the settings that say its units.

    Without metres a distance `1 / w` is where what is seen moves by `w` pixels from view to view.

    Raises
    ------
    ValueError : the lengths are so large or small that numbers do not hold the places of the views.
    """
    if known.spacing is None or known.focus_distance is None or known.pixel is None:
        return Views(steps, Plane(1.0, -0.5 * width, 0.5 * height), width, height), {"units": "views"}
    plane = Plane(known.pixel, -0.5 * width * known.pixel, 0.5 * height * known.pixel)
    inverse = 0.0 if math.isinf(known.focus_distance) else 1.0 / known.focus_distance
    with np.errstate(over="ignore"):
        position = steps * np.array(known.spacing)
    return Views(position, plane, width, height, inverse), {}


def text(views: Views, units: str | None) -> bytes:
    """A geometry as JSON."""
    found: dict[str, Any] = {"width": views.width, "height": views.height, **views.plane._asdict()}
    found |= {name: getattr(views, name) for name in _NUMBERS}
    found |= {"cell": views.cell, "pose": None if views.pose is None else views.pose._asdict()}
    found |= {"units": units, "position": views.position.tolist()}
    given = {name: value for name, value in found.items() if value is not None}
    return (json.dumps(given, indent=1, allow_nan=False) + "\n").encode()


def read(path: Path) -> tuple[Views, dict[str, str]]:
    """A geometry from JSON, and the settings that say its units.

    Raises
    ------
    InputError : the file cannot be read, or is no geometry.
    """
    try:
        found = json.loads(contents(path, _LARGEST))
        pose = found.get("pose")
        cell = found.get("cell")
        views = Views(
            position=np.array(found["position"], dtype=np.float64),
            plane=Plane(*(float(found[name]) for name in Plane._fields)),
            width=int(found["width"]),
            height=int(found["height"]),
            inverse_focus=float(found["inverse_focus"]),
            cell=None if cell is None else (float(cell[0]), float(cell[1])),
            aperture=None if "aperture" not in found else float(found["aperture"]),
            focal_length=None if "focal_length" not in found else float(found["focal_length"]),
            pose=None if pose is None else Pose(*(_triple(pose[name]) for name in Pose._fields)),
        )
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    except KeyError as error:
        raise InputError(f"{path}: is no geometry of a light field: it has no {error}") from error
    except (ValueError, TypeError, LookupError, AttributeError, ArithmeticError, RecursionError) as error:
        raise InputError(f"{path}: is no geometry of a light field, or a broken one") from error
    return views, {"units": "views"} if found.get("units") == "views" else {}


def _triple(numbers: Any) -> tuple[float, float, float]:
    x, y, z = map(float, numbers)
    return x, y, z
