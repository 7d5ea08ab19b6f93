"""What every primitive kind gives: its Embree geometry, the float64 hit, and points on it when it emits.

A kind's file holds its packed table (one row a primitive) and its cases of the functions below.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.geometry import Geometry
from raytracer.jit import generic, switch


@generic
def hit(table, primitive, origin, direction, near, time, accuracy):
    """The point where a ray meets `primitive`, which Embree found at distance `near`: a geometry.Hit.

    `time` is None if nothing in the scene moves, else the fraction of the shutter's opening that has passed, 0 to 1.
    """
    raise NotImplementedError


@generic
def row_of(table, part):
    """The row of the table that Embree met in this part of its geometry; each row is one part by default."""
    raise NotImplementedError


@row_of.register(tuple)
def _(table, part):
    return part


@generic
def expect(table, primitive):
    """Fetch what `hit` will read of a primitive, if that may be far away; nothing for small tables."""
    raise NotImplementedError


@expect.register(tuple)
def _(table, primitive):
    return


@generic
def sample_point(table, primitive, reference, u1, u2, time):
    """A point on an emitting primitive, drawn for a shaded point at `reference`: a geometry.LightPoint."""
    raise NotImplementedError


@generic
def pdf_point(table, primitive, reference, point, normal, time):
    """Density of `sample_point` in solid angle (1/sr) at `point`, whose outside normal is `normal`."""
    raise NotImplementedError


@generic
def carry(table, primitive, hit, time):
    """Where the point of a geometry.Hit is at another time, for a primitive whose table says how it moves."""
    raise NotImplementedError


@carry.register(tuple)
def _(table, primitive, hit, time):
    return hit.local


row_of_any = switch(row_of)
hit_any = switch(hit)
expect_any = switch(expect)
sample_point_any = switch(sample_point)
pdf_point_any = switch(pdf_point)
carry_any = switch(carry)


@generic
def geometry(table: Any) -> Geometry:
    """The buffers that Embree is built from."""
    raise NotImplementedError(type(table))


@generic
def areas(table: Any) -> NDArray[np.float64]:
    """Area of each primitive (m^2), shape (n,)."""
    raise NotImplementedError(type(table))


@generic
def bounds(table: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The least and the greatest coordinates (3,) of what rests, over all primitives."""
    raise NotImplementedError(type(table))


@generic
def has_vertex_normals(table: Any) -> bool:
    """Tell whether surfaces are shaded with other normals than their own, by default not."""
    raise NotImplementedError(type(table))


@has_vertex_normals.register(tuple)
def has_vertex_normals_default(table: Any) -> bool:
    """Tell that shading follows the surface."""
    return False


@generic
def group_key(table: Any) -> tuple[Any, ...]:
    """Tables with equal keys can be concatenated; keys can be sorted.  The class and what it lacks, by default."""
    return (type(table).__name__, *(name for name, field in table._asdict().items() if field is None))


@generic
def section(table: Any, start: int, stop: int) -> Any:
    """A table of the rows from `start` on and before `stop`, for `geometry`; all fields are rows by default."""
    if start == 0 and stop == len(table.material):
        return table
    return type(table)(*(column[start:stop] if isinstance(column, np.ndarray) else column for column in table))


@generic
def concatenate(first: Any, tables: Sequence[Any]) -> Any:
    """One table with the rows of all `tables`, which are of the class of `first`; all fields are rows by default."""
    fields = zip(*tables, strict=True)
    return type(first)(*(np.ascontiguousarray(np.concatenate(columns)) for columns in fields))


@generic
def unmapped(table: Any) -> Any:
    """The table without texture coordinates, which a scene without textures has no use for."""
    raise NotImplementedError(type(table))


@unmapped.register(tuple)
def _(table: Any) -> Any:
    return table


@generic
def graded(table: Any, eye: NDArray[np.float64]) -> Any:
    """The same surfaces, seen from `eye` (3,), with parts where one is so large that float32 blurs it near the eye.

    Parameters
    ----------
    table : without texture coordinates, which parts would not keep.
    """
    raise NotImplementedError(type(table))


@graded.register(tuple)
def _(table: Any, eye: NDArray[np.float64]) -> Any:
    return table
