"""The geometry of an import: by the options of the user, by files that say it, or else in steps of one view."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.views import Plane, Views
from raytracer.lightfield.formats import geometry
from raytracer.lightfield.formats.base.light_field_format import ImportOptions
from raytracer.lightfield.formats.geometry import KnownGeometry
from raytracer.util.errors import InputError

Geometry: TypeAlias = tuple[Views, dict[str, str]]
"""A geometry, and the settings that say its units."""


def find_geometry(
    path: Path,
    steps: NDArray[np.float64],
    shape: Sequence[int],
    options: ImportOptions,
    *,
    beside: Path | None,
    stated: Callable[[], Geometry] | None = None,
    is_placed: bool = False,
) -> Geometry:
    """Find the geometry of views, and the settings that say its units.

    Options that tell all in metres need no file; single ones replace what a file in metres says.

    Parameters
    ----------
    path : of the light field, for messages.
    steps : right and up from the middle, in steps of one view, (rows, columns, 2).
    shape : of the views: rows, columns, height and width.
    beside : file of a geometry, if there is one.
    stated : reads what is known of the geometry where there is no such file.
    is_placed : True if `steps` are what names say.

    Raises InputError: options are not enough for metres, or the file is broken, or of other views.
    """
    height, width = shape[2:4]
    pixel = options.optics.pixel(width, height)
    if options.spacing is not None and options.focus_distance is not None and pixel is not None:
        known = KnownGeometry(_both(path, options.spacing, is_placed), options.focus_distance, pixel)
        return geometry.make_views(path, steps, width, height, known)
    found: Geometry | None = None
    if beside is not None and beside.exists():
        found = geometry.read(beside)
        check_same_size(beside, found[0], shape)
    elif stated is not None:
        found = stated()
    if options.has_metres:
        if found is None or found[1]:
            raise _tell_missing(path, options, pixel)
        return _replace(path, found[0], steps, options, is_placed), {}
    return geometry.make_views(path, steps, width, height, KnownGeometry()) if found is None else found


def _tell_missing(path: Path, options: ImportOptions, pixel: float | None) -> InputError:
    """Make the error of options that are not enough for metres."""
    given = {
        "--spacing": options.spacing,
        "--focus-distance (inf for parallel views)": options.focus_distance,
        "--vfov, or --focal-length with --sensor": pixel,
    }
    missing = " and ".join(name for name, value in given.items() if value is None)
    return InputError(f"{path}: metres need also {missing}; without any of them, places are in steps of one view")


def _both(path: Path, spacing: float | tuple[float, float], is_placed: bool) -> tuple[float, float]:
    """Return the spacing to the right and that down; an InputError says that names leave one only."""
    both = spacing if isinstance(spacing, tuple) else (spacing, spacing)
    if is_placed and both[0] != both[1]:
        raise InputError(
            f"{path}: names say where views are: --spacing is one length, that from view to view on average"
        )
    return both


def _replace(path: Path, views: Views, steps: NDArray[np.float64], options: ImportOptions, is_placed: bool) -> Views:
    """Replace what options say in a geometry in metres; the pose stays."""
    pixel = options.optics.pixel(views.width, views.height)
    changes: dict[str, Any] = {}
    if options.spacing is not None:
        # What a file says of the lens goes with the places that it says.
        with np.errstate(over="ignore"):
            position = steps * np.array(_both(path, options.spacing, is_placed))
        changes |= {"position": position, "cell": None, "aperture": None, "coverage": None}
    if options.focus_distance is not None:
        changes["inverse_focus"] = 1.0 / options.focus_distance
    if pixel is not None:
        scale = pixel / views.plane.pixel
        changes["plane"] = Plane(pixel, scale * views.plane.left, scale * views.plane.top)
    elif any(value is not None for value in options.optics):
        raise InputError(f"{path}: --focal-length and --sensor go together")
    try:
        return replace(views, **changes)
    except ValueError as error:
        raise InputError(f"{path}: {error}") from error


def check_same_size(path: Path, views: Views, shape: Sequence[int]) -> None:
    """Refuse a geometry file of other views than there are."""
    stated = (views.rows, views.columns, views.height, views.width)
    if stated != tuple(shape[:4]):
        raise InputError(
            f"{path}: is the geometry of views (rows, columns, height, width) {stated}; there are {tuple(shape[:4])}"
        )
