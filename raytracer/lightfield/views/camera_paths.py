"""Camera paths: a pinhole that moves within the aperture, for parallax from one picture.

Views between others are synthesised; see `synthesis.view_at`.
"""

import math
from collections.abc import Iterator, Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.views import Views
from raytracer.lightfield.coverage import within_lens
from raytracer.lightfield.depth.depth_map import Depth
from raytracer.lightfield.views.synthesis import view_at
from raytracer.util.errors import InputError

Path = Literal["circle", "right", "up", "eight"]
PATHS: tuple[Path, ...] = ("circle", "right", "up", "eight")

_FEWEST = 2


def path_places(
    views: Views, path: Path = "circle", *, frames: int = 24, radius: float | None = None
) -> NDArray[np.float64]:
    """Sample places along a closed path, right and up from the middle (m), (frames, 2).

    Parameters
    ----------
    path : a circle; to the right and back; up and back; or an eight that lies on its side.
    radius : half of the path's width (m); default: as far as all of it is among the views.

    Raises
    ------
    InputError : there is no such path, or too few frames, or the path leaves the views.
    """
    if path not in PATHS:
        raise InputError(f"no path {path}; there are {', '.join(PATHS)}")
    if frames < _FEWEST:
        raise InputError(f"a path needs at least {_FEWEST} frames, got {frames}")
    places = views.position[within_lens(views)]
    if len(places) == 1:
        raise InputError("a path needs at least two views, and the light field has one")
    reach = np.minimum(places.max(axis=0), -places.min(axis=0))
    most = float(
        {"circle": reach.min(), "right": reach[0], "up": reach[1], "eight": min(reach[0], 2.0 * reach[1])}[path]
    )
    if path == "circle" and views.aperture is not None:
        most = min(most, 0.5 * views.aperture)
    size = most if radius is None else radius
    # Allow for the rounding of the places.
    if not 0.0 < size <= most * (1.0 + float(np.finfo(np.float32).eps)):
        raise InputError(f"a path of {size:g} m to each side does not fit: it must be within 0..{most:g} m for {path}")
    angle = 2.0 * math.pi * np.arange(frames) / frames
    shape = {
        "circle": (np.cos(angle), np.sin(angle)),
        "right": (np.sin(angle), np.zeros(frames)),
        "up": (np.zeros(frames), np.sin(angle)),
        "eight": (np.sin(angle), 0.5 * np.sin(2.0 * angle)),
    }[path]
    return size * np.stack(shape, axis=-1)


def look_around(
    field: LightField,
    places: Sequence[tuple[float, float]] | NDArray[np.float64],
    *,
    depth: Depth | None = None,
    distance: float | None = None,
) -> Iterator[NDArray[np.float64]]:
    """Render the views from one place after the other (m): float64 (height, width, 3) each; see `synthesis.view_at`."""
    for right, up in np.asarray(places, dtype=np.float64):
        yield view_at(field, float(right), float(up), depth=depth, distance=distance)
