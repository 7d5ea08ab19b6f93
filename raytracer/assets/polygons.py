"""What the mesh formats share: what a reader hands over, polygons into triangles, equal vertices into one."""

import warnings
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Integers = NDArray[np.integer[Any]]
Floats = NDArray[np.floating[Any]]


class Parts(NamedTuple):
    """A mesh as a file has it, not yet checked: vertices (n, 3), faces (m, 3), normals (n, 3) or None."""

    vertices: Floats
    faces: Integers
    normals: Floats | None


class BrokenMeshError(ValueError):
    """A mesh file that cannot be read; its text completes the sentence "FILE: ..."."""


def parse_floats(text: bytes) -> NDArray[np.float64]:
    """Numbers of a text that holds nothing else, separated by white space, float64 (n,).

    Raises
    ------
    ValueError : there is something else in it.
    """
    return _parse(text, np.float64)


def parse_integers(text: bytes) -> NDArray[np.int64]:
    """Integers of a text that holds nothing else, separated by white space, int64 (n,).

    Raises
    ------
    ValueError : there is something else in it.
    """
    return _parse(text, np.int64)


def _parse(text: bytes, dtype: type[np.generic]) -> NDArray[Any]:
    # Before version 2.3, NumPy stopped at what is no number and warned.
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)
        try:
            return np.fromstring(text.decode("latin-1"), dtype=dtype, sep=" ")
        except DeprecationWarning as error:
            raise ValueError(str(error)) from error


def fan(counts: Integers, corners: Integers) -> Integers:
    """Triangles (m, 3) of convex polygons: `counts` (p,) corners each, one after the other in `corners`.

    Every polygon is cut into the triangles between its first corner and each of its other edges.

    Raises
    ------
    BrokenMeshError : a polygon has fewer than three corners.
    """
    if np.any(counts < 3):
        raise BrokenMeshError("has a face with fewer than 3 corners")
    if np.all(counts == 3):
        return corners.reshape(-1, 3)
    triangles = counts.astype(np.int64) - 2
    first = np.repeat(np.cumsum(counts, dtype=np.int64) - counts, triangles)
    nth = np.arange(triangles.sum()) - np.repeat(np.cumsum(triangles) - triangles, triangles)
    return np.stack([corners[first], corners[first + nth + 1], corners[first + nth + 2]], axis=1)


def weld(points: Floats) -> tuple[Integers, Integers]:
    """Make equal `points` (n, 3) one: the index of a point of each kind (k,), and the kind of each point (n,).

    Equal means equal in every bit but the sign of zero; NaN equals nothing.
    """
    order = np.lexsort(points.T)
    ordered = points[order]
    new = np.ones(len(points), dtype=bool)
    np.any(ordered[1:] != ordered[:-1], axis=1, out=new[1:])
    kind = np.empty(len(points), dtype=np.int64)
    kind[order] = np.cumsum(new) - 1
    return order[new], kind
