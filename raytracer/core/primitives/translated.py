"""Primitives of any kind that move in a straight line at a constant speed while the shutter is open.

A moving primitive is the resting one, met by a ray that is shifted back; nothing of its kind's own code is repeated.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.geometry import Geometry, Hit, LightPoint, hit_offset, padded, plane_gap, row3
from raytracer.jit import kernel
from raytracer.primitives.interface import (
    areas,
    carry,
    concatenate,
    expect,
    geometry,
    group_key,
    has_vertex_normals,
    hit,
    pdf_point,
    row_of,
    sample_point,
    section,
    unmapped,
)
from raytracer.vec import add, dot, max_abs, norm, sub


class Translated(NamedTuple):
    """base, the table at the opening of the shutter; shift (n, 3) float64, how far each primitive goes till it closes.

    Raises
    ------
    NotImplementedError : from the functions of a kind of primitive that `base` is not.
    """

    base: Any
    shift: NDArray[np.float64]

    @property
    def material(self) -> Any:
        """The material reference of each primitive (n,) int32."""
        return self.base.material


def translated(base: Any, shift: NDArray[np.float64]) -> Translated:
    """A table whose primitives all go the same way, `shift` (3,) (m)."""
    return Translated(
        base, np.ascontiguousarray(np.broadcast_to(np.asarray(shift, np.float64), (len(base.material), 3)))
    )


@geometry.register(Translated)
def _(table: Translated) -> Geometry:
    """The base's buffers at two time steps at least."""
    start: Geometry = geometry(table.base)
    shift = table.shift
    if start.indices is not None:
        # Vertices go with the primitives that they belong to; objects share none.
        shift = np.zeros((len(start.vertices[0]), 3))
        shift[start.indices.reshape(len(table.shift), -1)] = table.shift[:, None, :]
    steps = start.vertices if len(start.vertices) > 1 else 2 * start.vertices
    moved = [
        _moved(vertices, fraction * shift)
        for vertices, fraction in zip(steps, np.linspace(0, 1, len(steps)), strict=True)
    ]
    return start._replace(vertices=tuple(moved))


def _moved(vertices: NDArray[np.float32], shift: NDArray[np.float64]) -> NDArray[np.float32]:
    """A copy of an Embree vertex buffer, with what stands behind the coordinates left alone."""
    if not shift.any():
        return vertices
    result = padded(vertices, np.float32)
    result[:, :3] = vertices[:, :3] + shift
    return result


@areas.register(Translated)
def _(table: Translated) -> NDArray[np.float64]:
    return np.asarray(areas(table.base))


@has_vertex_normals.register(Translated)
def has_vertex_normals_translated(table: Translated) -> bool:
    """Ask the table that moves."""
    return bool(has_vertex_normals(table.base))


@group_key.register(Translated)
def _(table: Translated) -> tuple[Any, ...]:
    return (Translated.__name__, *group_key(table.base))


@concatenate.register(Translated)
def _(first: Translated, tables: Sequence[Translated]) -> Translated:
    base = concatenate(first.base, [table.base for table in tables])
    return Translated(base, np.ascontiguousarray(np.concatenate([table.shift for table in tables])))


@unmapped.register(Translated)
def _(table: Translated) -> Translated:
    return Translated(unmapped(table.base), table.shift)


@section.register(Translated)
def _(table: Translated, start: int, stop: int) -> Translated:
    return Translated(section(table.base, start, stop), table.shift[start:stop])


@row_of.register(Translated)
def _(table, part):
    return row_of(table.base, part)


@expect.register(Translated)
def _(table, primitive):
    expect(table.base, primitive)


@kernel
def _shift_at(table, primitive, time):
    """How far a primitive has gone at a time, and its whole way."""
    shift = row3(table.shift, primitive)
    return (time * shift[0], time * shift[1], time * shift[2]), shift


@hit.register(Translated)
def _(table, primitive, origin, direction, near, time, accuracy):
    gone, shift = _shift_at(table, primitive, time)
    rest = hit(table.base, primitive, sub(origin, gone), direction, near, time, accuracy)

    # Vertices at the end of the way are rounded at its scale, too.
    offset = rest.offset + hit_offset(accuracy, max_abs(shift), 0.0)
    return Hit(
        add(rest.point, gone),
        rest.normal,
        rest.shading_normal,
        rest.u,
        rest.v,
        offset,
        rest.material,
        rest.tangent,
        rest.bitangent,
        rest.local,
    )


@sample_point.register(Translated)
def _(table, primitive, reference, u1, u2, time):
    gone, shift = _shift_at(table, primitive, time)
    rest = sample_point(table.base, primitive, sub(reference, gone), u1, u2, time)
    way = sub(add(rest.point, gone), reference)
    distance = norm(way)

    # The gap grows with the error at most as that of a plane does, which is linear.
    gap = rest.gap + plane_gap(max_abs(shift), 0.0, abs(dot(way, rest.normal)) / distance)
    return LightPoint(add(rest.point, gone), rest.normal, rest.pdf, gap, rest.u, rest.v, rest.local)


@pdf_point.register(Translated)
def _(table, primitive, reference, point, normal, time):
    gone, _ = _shift_at(table, primitive, time)
    return pdf_point(table.base, primitive, sub(reference, gone), sub(point, gone), normal, time)


@carry.register(Translated)
def _(table, primitive, hit, time):
    gone, _ = _shift_at(table, primitive, time)
    return add(carry(table.base, primitive, hit, time), gone)
