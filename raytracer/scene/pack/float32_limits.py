"""Reject objects that float32 cannot hold at all: no ray would find them."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.core.geometry import Geometry, Primitive

MAX_COORDINATE = 1.844e18
"""Largest coordinate and radius (m) that Embree takes; it silently leaves out what lies beyond."""

_TINY, _HUGE = float(np.finfo(np.float32).tiny), float(np.finfo(np.float32).max)

MIN_EXTENT = float(np.sqrt(_TINY))
"""Smallest extent (m) whose square, as in an area, is a normal float32 number: 1.1e-19."""


def check_extent(geometry: Geometry) -> None:
    """Reject an object that is too far away, too large or too small to be hit by any ray.

    Parameters
    ----------
    geometry : the object as the ray caster gets it.

    Raises
    ------
    ValueError : a sentence that says how far, or how small.
    """
    for vertices in geometry.vertices:
        rows = vertices
        if geometry.indices is not None and not _reach(rows) <= MAX_COORDINATE:
            # A file may hold vertices that no triangle has.
            rows = vertices[np.unique(geometry.indices)]
        reach = _reach(rows)
        if not reach <= MAX_COORDINATE:
            far = f"{reach:.3g} m" if np.isfinite(reach) else f"more than {_HUGE:.2g} m"
            raise ValueError(
                f"lies {far} from the origin, or is as large, and rays find nothing beyond {MAX_COORDINATE:.3g} m"
            )
        extent = float(np.ptp(rows[:, :3].astype(np.float64), axis=0).max(initial=0.0))
        if geometry.primitive is not Primitive.TRIANGLE:
            extent += 2.0 * float(rows[:, 3].max(initial=0.0))
        # Triangles that vanish only where they lie may be placed elsewhere: there are warnings for that.
        is_lost = geometry.primitive is Primitive.TRIANGLE and extent == 0.0
        if extent < MIN_EXTENT and not is_lost:
            raise ValueError(f"is {extent:.3g} m large, and rays find nothing smaller than {MIN_EXTENT:.2g} m")


def check_poses(matrices: NDArray[Any]) -> None:
    """Reject poses (n, 4, 4) of instances that Embree, which inverts them in float32, cannot invert.

    Raises
    ------
    ValueError : a sentence that says by how much one scales, or how far it goes.
    """
    reach = float(np.abs(matrices[:, :3]).max(initial=0.0))
    if not reach <= MAX_COORDINATE:
        raise ValueError(f"moves or scales by {reach:.3g}, and rays find nothing beyond {MAX_COORDINATE:.3g} m")
    volume = np.abs(np.linalg.det(matrices[:, :3, :3]))
    wrong = ~((volume >= _TINY) & (volume <= _HUGE))
    if wrong.any():
        scale = float(np.cbrt(volume[int(np.argmax(wrong))]))
        raise ValueError(
            f"scales by {scale:.3g}, and float32 only undoes factors from {np.cbrt(_TINY):.2g} to {np.cbrt(_HUGE):.2g}"
        )


def _reach(rows: NDArray[np.float32]) -> float:
    return float(np.abs(rows).max(initial=0.0))
