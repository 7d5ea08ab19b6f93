"""The interface of primitives: Embree geometry, float64 hits, and sampled points of emitters.

A kind's file holds its packed table (one row a primitive) and its cases of the functions below.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import generic, overridable, switch
from raytracer.core.geometry import Geometry

Boxes = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Least and greatest coordinates (n, 3) (m), by row."""


@generic
def hit(table, primitive, origin, direction, near, time, accuracy):
    """Solve the hit of a ray with `primitive`, which Embree found at distance `near`: a geometry.Hit.

    `time` is None if nothing in the scene moves, else the fraction of the shutter's opening that has passed, 0 to 1.
    """


@overridable
def row_of(table, part):
    """Return the row of the table that has this part of its geometry; each row is one part by default."""
    return part


@overridable
def prefetch_primitive(table, primitive):
    """Prefetch the data of a primitive that `hit` will read; nothing for small tables."""


@generic
def sample_point(table, primitive, reference, u1, u2, time):
    """Sample a point on an emitting primitive for a shaded point at `reference`: a geometry.LightPoint."""


@generic
def pdf_point(table, primitive, reference, point, normal, time):
    """Compute the density of `sample_point` in solid angle (1/sr) at `point`, whose outside normal is `normal`."""


@overridable
def reproject_at_time(table, primitive, hit, time):
    """Return the position of a Hit's point at another time, for a primitive whose table says how it moves."""
    return hit.local


row_of_any = switch(row_of)
hit_any = switch(hit)
prefetch_primitive_any = switch(prefetch_primitive)
sample_point_any = switch(sample_point)
pdf_point_any = switch(pdf_point)
reproject_at_time_any = switch(reproject_at_time)


@generic
def geometry(table: Any) -> Geometry:
    """Make the buffers that Embree is built from."""
    raise NotImplementedError


@generic
def areas(table: Any) -> NDArray[np.float64]:
    """Compute the area of each primitive (m^2), shape (n,)."""
    raise NotImplementedError


@overridable
def boxes(table: Any, rows: NDArray[np.int64]) -> Boxes | None:
    """Return the least and the greatest coordinates (n, 3) of each of these rows; None for what moves."""
    return None


def bounds(table: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the least and the greatest coordinates (3,) of all primitives of a table at rest."""
    lower, upper = boxes(table, np.arange(len(table.material)))
    return lower.min(axis=0), upper.max(axis=0)


@overridable
def has_vertex_normals(table: Any) -> bool:
    """Return True if surfaces are shaded with other normals than their own; by default they are not."""
    return False


@overridable
def group_key(table: Any) -> tuple[Any, ...]:
    """Return a sortable key, equal for tables that can be concatenated: by default the class and its fields of None."""
    return (type(table).__name__, *(name for name, field in table._asdict().items() if field is None))


@overridable
def slice_rows(table: Any, start: int, stop: int) -> Any:
    """Slice a table from row `start` on and before `stop`, for `geometry`; all fields are rows by default."""
    if start == 0 and stop == len(table.material):
        return table
    return type(table)(*(column[start:stop] if isinstance(column, np.ndarray) else column for column in table))


@overridable
def concatenate(first: Any, tables: Sequence[Any]) -> Any:
    """Concatenate the rows of all `tables`, which are of the class of `first`; all fields are rows by default."""
    return type(first)(*(np.ascontiguousarray(np.concatenate(rows)) for rows in zip(*tables, strict=True)))


@overridable
def without_uv(table: Any) -> Any:
    """Drop texture coordinates, which a scene without textures does not use."""
    return table


@overridable
def subdivide_large(table: Any, eye: NDArray[np.float64]) -> Any:
    """Subdivide surfaces, seen from `eye` (3,), that are so large that float32 blurs them near the eye.

    Parameters
    ----------
    table : without texture coordinates, which parts would not keep.
    """
    return table
