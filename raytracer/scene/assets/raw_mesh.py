"""Meshes as files have them, and what the readers of formats share: welding, and cutting polygons into triangles."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.util.safe_open import BrokenFileError

Integers = NDArray[np.integer[Any]]
Floats = NDArray[np.floating[Any]]


class RawMesh(NamedTuple):
    """A mesh as a file has it, not yet checked.

    vertices : (n, 3).
    faces : (m, 3).
    normals : (n, 3), or None.
    uv : (n, 2), or None.
    kinds : (m,), number of each face's material in the file; None if it has none.
    """

    vertices: NDArray[np.float64]
    faces: Integers
    normals: NDArray[np.float64] | None = None
    uv: NDArray[np.float64] | None = None
    kinds: NDArray[np.int32] | None = None


class Polygons(NamedTuple):
    """Lists of numbers, as the corners of polygons.

    values : of all lists, one after the other (k,).
    sizes : of the lists (m,).
    """

    values: NDArray[Any]
    sizes: Integers

    def astype(self, kind: np.dtype[Any]) -> "Polygons":
        """Convert the numbers to a type."""
        return self._replace(values=self.values.astype(kind))


def parse_numbers(text: bytes) -> NDArray[np.float64]:
    """Parse numbers that white space separates.

    Raises
    ------
    ValueError, DeprecationWarning : there is something else.
    """
    return np.fromstring(text, sep=" ")


def weld(points: Floats) -> tuple[Integers, Integers]:
    """Weld equal `points` (n, 3): the index of a point of each kind (k,), and the kind of each point (n,).

    Equal means equal in every bit but the sign of zero; NaN equals nothing.
    """
    order = np.lexsort(points.T)
    ordered = points[order]
    new = np.ones(len(points), dtype=bool)
    np.any(ordered[1:] != ordered[:-1], axis=1, out=new[1:])
    kind = np.empty(len(points), dtype=np.int64)
    kind[order] = np.cumsum(new) - 1
    return order[new], kind


def triangulate(polygons: Polygons, *, by_size: bool = True) -> Integers:
    """Cut polygons of 3 corners and more into triangles (t, 3): quads along 0-2, larger ones into fans from corner 0.

    by_size : triangles first, then the first and the second halves of quads, then fans; or as the polygons come.

    Raises
    ------
    BrokenFileError : a polygon has fewer corners.
    """
    corners, sizes = polygons
    if (sizes == 3).all():
        return corners.reshape(-1, 3)
    if (sizes < 3).any():
        raise BrokenFileError("has a face with fewer than 3 corners")
    counts = sizes - 2
    nth = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    size = np.repeat(sizes, counts)
    first = np.repeat(np.cumsum(sizes) - sizes, counts)
    triangles: Integers = first[:, None] + np.stack([np.zeros_like(nth), nth + 1, nth + 2], axis=1)
    second_halves = (size == 4) & (nth == 1)
    triangles[second_halves] = first[second_halves, None] + np.array([2, 3, 0])
    if by_size:
        triangles = triangles[np.argsort(np.minimum(size, 5) + second_halves * 0.5, kind="stable")]
    return corners[triangles]
