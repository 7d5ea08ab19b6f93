"""Traversal of a grid of voxels by rays: densities, and blocks of voxels whose largest densities bound those within.

A `medium` here is a record of one grid: see `media.grid.GridRow`.
"""

import math
from typing import NamedTuple

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.vec import Vec3, madd

BLOCK = 8
"""Voxels along an edge of the blocks whose largest densities bound those within."""


@kernel
def _turned(medium, vector):
    """Transform a world vector to voxels."""
    return (
        medium.x[0] * vector[0] + medium.x[1] * vector[1] + medium.x[2] * vector[2],
        medium.y[0] * vector[0] + medium.y[1] * vector[1] + medium.y[2] * vector[2],
        medium.z[0] * vector[0] + medium.z[1] * vector[1] + medium.z[2] * vector[2],
    )


@kernel
def _between(position, size):
    """Return (lower voxel, upper voxel, weight of the upper) of a coordinate; values belong to middles of voxels."""
    middle = min(max(position - 0.5, 0.0), size - 1.0)
    lower = int(middle)
    return lower, min(lower + 1, size - 1), middle - lower


@kernel
def density_at(medium, point):
    """Interpolate the density at a point in voxels, linearly along the three axes."""
    size_x, size_y, size_z = medium.shape
    x0, x1, wx = _between(point[0], size_x)
    y0, y1, wy = _between(point[1], size_y)
    z0, z1, wz = _between(point[2], size_z)
    at = medium.density
    base_00 = medium.first + (x0 * size_y + y0) * size_z
    base_01 = medium.first + (x0 * size_y + y1) * size_z
    base_10 = medium.first + (x1 * size_y + y0) * size_z
    base_11 = medium.first + (x1 * size_y + y1) * size_z
    near = (1.0 - wy) * ((1.0 - wz) * at[base_00 + z0] + wz * at[base_00 + z1]) + wy * (
        (1.0 - wz) * at[base_01 + z0] + wz * at[base_01 + z1]
    )
    far = (1.0 - wy) * ((1.0 - wz) * at[base_10 + z0] + wz * at[base_10 + z1]) + wy * (
        (1.0 - wz) * at[base_11 + z0] + wz * at[base_11 + z1]
    )
    return (1.0 - wx) * near + wx * far


class MajorantTraversal(NamedTuple):
    """State of a ray on its way through the blocks.

    Distances but the first are from the ray's entry into the box, so that none is lost to rounding far from its origin.

    before (m) : distance from the ray's origin to its entry into the box.
    start : entry point in voxels.
    way : direction in voxels per metre.
    at (m) : distance that the ray has come.
    end (m) : distance at which it leaves the box.
    block : indices of the block that it is in.
    out (m) : distances at which it leaves that block along each axis.
    majorant (1/m) : the largest extinction in that block.
    """

    before: float
    start: Vec3
    way: Vec3
    at: float
    end: float
    block: tuple[int, int, int]
    out: Vec3
    majorant: float


@kernel
def _entry(start, way, size):
    """Return the distance at which a ray enters 0 .. size along an axis; infinity where it never does."""
    if way == 0.0:
        return 0.0 if 0.0 <= start <= size else math.inf
    return ((0.0 if way > 0.0 else size) - start) / way


@kernel
def _exit(start, way, size):
    """Return the distance at which a ray leaves 0 .. size along an axis."""
    if way == 0.0:
        return math.inf
    return ((size if way > 0.0 else 0.0) - start) / way


@kernel
def _block_of(position, count):
    return min(max(int(position / BLOCK), 0), count - 1)


@kernel
def _out(start, way, block):
    """Return the distance at which a ray leaves a block along an axis."""
    if way == 0.0:
        return math.inf
    return (BLOCK * (block + 1 if way > 0.0 else block) - start) / way


@kernel
def _block_majorant(medium, block):
    _, count_y, count_z = medium.blocks
    return (
        medium.extinction
        * medium.majorant[medium.first_majorant + (block[0] * count_y + block[1]) * count_z + block[2]]
    )


@kernel
def begin_traversal(medium, origin, direction, distance):
    """Begin the traversal of a ray up to `distance`; one that misses the box is at its `end` at once."""
    start, way = _turned(medium, origin), _turned(medium, direction)
    start = (start[0] + medium.shift[0], start[1] + medium.shift[1], start[2] + medium.shift[2])
    sx, sy, sz = medium.shape
    near = max(max(0.0, _entry(start[0], way[0], sx)), max(_entry(start[1], way[1], sy), _entry(start[2], way[2], sz)))
    far = min(min(distance, _exit(start[0], way[0], sx)), min(_exit(start[1], way[1], sy), _exit(start[2], way[2], sz)))
    if not near < far:
        return MajorantTraversal(far, start, way, 0.0, 0.0, (0, 0, 0), (math.inf, math.inf, math.inf), 0.0)
    start = madd(start, near, way)
    block = (
        _block_of(start[0], medium.blocks[0]),
        _block_of(start[1], medium.blocks[1]),
        _block_of(start[2], medium.blocks[2]),
    )
    out = (_out(start[0], way[0], block[0]), _out(start[1], way[1], block[1]), _out(start[2], way[2], block[2]))
    return MajorantTraversal(near, start, way, 0.0, far - near, block, out, _block_majorant(medium, block))


@kernel
def advance_traversal(medium, walk, thickness):
    """Advance until the integral of the majorant has grown by `thickness`, or to the end.

    References: Amanatides, Woo 1987, "A Fast Voxel Traversal Algorithm for Ray Tracing".
    """
    at, end, out, bound = walk.at, walk.end, walk.out, walk.majorant
    x, y, z = walk.block
    start, way = walk.start, walk.way
    while at < end:
        leave = min(min(out[0], out[1]), min(out[2], end))
        within = bound * (leave - at)
        if within > thickness:
            at += thickness / bound
            break
        thickness -= max(0.0, within)
        at = leave
        if at >= end:
            break
        if out[0] == leave:
            x += 1 if way[0] > 0.0 else -1
            out = (_out(start[0], way[0], x), out[1], out[2])
        elif out[1] == leave:
            y += 1 if way[1] > 0.0 else -1
            out = (out[0], _out(start[1], way[1], y), out[2])
        else:
            z += 1 if way[2] > 0.0 else -1
            out = (out[0], out[1], _out(start[2], way[2], z))
        count_x, count_y, count_z = medium.blocks
        if not (0 <= x < count_x and 0 <= y < count_y and 0 <= z < count_z):
            # The last block's far face lies on or behind the box's, but for rounding.
            at = end
            break
        bound = _block_majorant(medium, (x, y, z))
    return MajorantTraversal(walk.before, start, way, at, end, (x, y, z), out, bound)


@kernel
def extinction_at(medium, walk):
    """Return the extinction (1/m) where a traversal is."""
    point = (
        walk.start[0] + walk.at * walk.way[0],
        walk.start[1] + walk.at * walk.way[1],
        walk.start[2] + walk.at * walk.way[2],
    )
    return medium.extinction * density_at(medium, point)
