"""The geometry of an import: by the options of the user, else by a file beside the views, else in steps of one view."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.views import Views
from raytracer.lightfield.formats import geometry
from raytracer.lightfield.formats.base.light_field_format import ImportOptions
from raytracer.lightfield.formats.geometry import KnownGeometry
from raytracer.util.errors import InputError


def find_geometry(
    path: Path,
    steps: NDArray[np.float64],
    shape: Sequence[int],
    options: ImportOptions,
    *,
    beside: Path,
    is_placed: bool = False,
) -> tuple[Views, dict[str, str]]:
    """Find the geometry of views, and the settings that say its units.

    Parameters
    ----------
    path : of the light field, for messages.
    steps : right and up from the middle, in steps of one view, (rows, columns, 2).
    shape : of the views: rows, columns, height and width.
    beside : file of a geometry, if there is one.
    is_placed : True if `steps` are what names say.

    Raises InputError: options are not enough for metres, or the file is broken, or of other views.
    """
    height, width = shape[2:4]
    if options.has_metres:
        known = _known_geometry(path, options, options.optics.pixel(width, height), is_placed)
        return geometry.make_views(path, steps, width, height, known)
    if beside.exists():
        views, units = geometry.read(beside)
        check_same_size(beside, views, shape)
        return views, units
    return geometry.make_views(path, steps, width, height, KnownGeometry())


def _known_geometry(path: Path, options: ImportOptions, pixel: float | None, is_placed: bool) -> KnownGeometry:
    """Gather the geometry that options give, and refuse one that is not complete."""
    spacing, distance = options.spacing, options.focus_distance
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


def check_same_size(path: Path, views: Views, shape: Sequence[int]) -> None:
    """Refuse a geometry file of other views than there are."""
    stated = (views.rows, views.columns, views.height, views.width)
    if stated != tuple(shape[:4]):
        raise InputError(
            f"{path}: is the geometry of views (rows, columns, height, width) {stated}; there are {tuple(shape[:4])}"
        )
