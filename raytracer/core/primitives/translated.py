"""Primitives of any kind that move in a straight line at constant speed while the shutter is open.

A moving primitive is the resting one, met by a ray that is shifted back; nothing of its kind's own code is repeated.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.geometry import Geometry, Hit, LightPoint, hit_offset, pad_buffer, plane_gap, row3
from raytracer.core.primitives.base import interface
from raytracer.core.vec import add, dot, max_abs, norm, sub


class Translated(NamedTuple):
    """Table of moving primitives: the table at the opening of the shutter, and their displacements till it closes (m).

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


def translate_table(base: Any, shift: NDArray[np.float64]) -> Translated:
    """Make a table whose primitives all move by `shift` (3,) (m)."""
    return Translated(
        base, np.ascontiguousarray(np.broadcast_to(np.asarray(shift, np.float64), (len(base.material), 3)))
    )


@interface.geometry.register(Translated)
def geometry_translated(table: Translated) -> Geometry:
    """Make the base's buffers at two time steps at least."""
    start: Geometry = interface.geometry(table.base)
    shift = table.shift
    if start.indices is not None:
        # Vertices move with the primitives that they belong to; objects share none.
        shift = np.zeros((len(start.vertices[0]), 3))
        shift[start.indices.reshape(len(table.shift), -1)] = table.shift[:, None, :]
    steps = start.vertices if len(start.vertices) > 1 else 2 * start.vertices
    moved = [
        _moved(vertices, fraction * shift)
        for vertices, fraction in zip(steps, np.linspace(0, 1, len(steps)), strict=True)
    ]
    return start._replace(vertices=tuple(moved))


def _moved(vertices: NDArray[np.float32], shift: NDArray[np.float64]) -> NDArray[np.float32]:
    """Copy an Embree vertex buffer with its coordinates displaced, and its further columns as they are."""
    if not shift.any():
        return vertices
    result = pad_buffer(vertices, np.float32)
    result[:, :3] = vertices[:, :3] + shift
    return result


@interface.group_key.register(Translated)
def group_key_translated(table: Translated) -> tuple[Any, ...]:
    return (Translated.__name__, *interface.group_key(table.base))


@interface.concatenate.register(Translated)
def concatenate_translated(first: Translated, tables: Sequence[Translated]) -> Translated:
    base = interface.concatenate(first.base, [table.base for table in tables])
    return Translated(base, np.ascontiguousarray(np.concatenate([table.shift for table in tables])))


@interface.without_uv.register(Translated)
def without_uv_translated(table: Translated) -> Translated:
    return Translated(interface.without_uv(table.base), table.shift)


@interface.slice_rows.register(Translated)
def slice_rows_translated(table: Translated, start: int, stop: int) -> Translated:
    return Translated(interface.slice_rows(table.base, start, stop), table.shift[start:stop])


def _ask_base(function: Any) -> None:
    """Register the case of a function that does for the table that moves what it does for it at rest."""

    def case(table, *arguments):
        return function(table.base, *arguments)

    function.register(Translated)(case)


for _function in (interface.areas, interface.has_vertex_normals, interface.row_of, interface.prefetch_primitive):
    _ask_base(_function)


@kernel
def _shift_at(table, primitive, time):
    """Return the displacement of a primitive at a time, and its whole one."""
    shift = row3(table.shift, primitive)
    return (time * shift[0], time * shift[1], time * shift[2]), shift


@interface.hit.register(Translated)
def hit_translated(table, primitive, origin, direction, near, time, accuracy):
    gone, shift = _shift_at(table, primitive, time)
    rest = interface.hit(table.base, primitive, sub(origin, gone), direction, near, time, accuracy)

    # Vertices at the end of the motion are rounded at the scale of its displacement, too.
    point, normal, shading, u, v, offset, material, tangent, bitangent, local = rest
    offset += hit_offset(accuracy, max_abs(shift), 0.0)
    return Hit(add(point, gone), normal, shading, u, v, offset, material, tangent, bitangent, local)


@interface.sample_point.register(Translated)
def sample_point_translated(table, primitive, reference, u1, u2, time):
    gone, shift = _shift_at(table, primitive, time)
    rest = interface.sample_point(table.base, primitive, sub(reference, gone), u1, u2, time)
    way = sub(add(rest.point, gone), reference)
    distance = norm(way)

    # The gap grows with the error at most as that of a plane does, which is linear.
    gap = rest.gap + plane_gap(max_abs(shift), 0.0, abs(dot(way, rest.normal)) / distance)
    return LightPoint(add(rest.point, gone), rest.normal, rest.pdf, gap, rest.u, rest.v, rest.local)


@interface.pdf_point.register(Translated)
def pdf_point_translated(table, primitive, reference, point, normal, time):
    gone, _ = _shift_at(table, primitive, time)
    return interface.pdf_point(table.base, primitive, sub(reference, gone), sub(point, gone), normal, time)


@interface.reproject_at_time.register(Translated)
def reproject_at_time_translated(table, primitive, hit, time):
    gone, _ = _shift_at(table, primitive, time)
    return add(interface.reproject_at_time(table.base, primitive, hit, time), gone)
