"""Grid: smoke, clouds and steam, from a file of densities.

In a scene:

    plume: {type: grid, file: plume.npy, min: [-1, 0, -1], max: [1, 3, 1], extinction: 8, albedo: 0.95}
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from raytracer.geometry import row3
from raytracer.jit import kernel
from raytracer.media.interface import (
    FLIGHT_NUMBERS,
    Asymmetry,
    Flight,
    MediumSpec,
    evaluate_phase,
    flight_numbers,
    fly,
    moved,
    row,
    scatter_phase,
    shadow_numbers,
    transmittance,
)
from raytracer.media.phase import pdf_henyey_greenstein, sample_henyey_greenstein
from raytracer.spec import Albedo, NonNegativeNumber, Point, Transform, at, matrix_of
from raytracer.vec import Vec3, madd

BLOCK = 8
"""Voxels along an edge of the blocks whose largest densities bound those within."""

_FEW = 0.05
"""Estimates of transmittance below this end by chance: what is left of them is not worth many steps."""

MOST_THICK = FLIGHT_NUMBERS / (math.sqrt(3.0) * BLOCK)
"""The largest optical thickness of a voxel: light that crosses a block then takes no more numbers than a flight has.

Where a block is dense here and empty there, each number takes it a mean free path of the densest voxel on.  Thicker
ones would look no different: light gets no further into a voxel than a thousandth of it.
"""


class Grid(MediumSpec):
    """Densities on a grid of voxels, in a box; nothing outside of it.

    The density is interpolated between the middles of voxels, and constant from the outermost ones to the box's faces.
    Times `extinction` it is what is lost per metre, in all channels alike, of which `albedo` is scattered, by Henyey
    and Greenstein's phase function.  An object's transform does not move the grid that fills it.

    References: Woodcock et al. 1965, "Techniques Used in the GEM Code for Monte Carlo Neutronics Calculations" (delta
    tracking); Novák et al. 2014, "Residual Ratio Tracking for Estimating Attenuation in Participating Media".
    """

    loads: ClassVar[dict[str, str]] = {"file": "grid"}

    type: Literal["grid"] = "grid"
    file: str = Field(
        description="NumPy file (.npy) of densities, indexed by x, y, z; relative to the scene", min_length=1
    )
    min: Point = Field(default=(0.0, 0.0, 0.0), description="corner of the box with the least coordinates (m)")
    max: Point = Field(default=(1.0, 1.0, 1.0), description="opposite corner (m)")
    transform: Transform | None = Field(default=None, description="moves the box, as that of an object does")
    extinction: NonNegativeNumber = Field(default=1.0, description="lost per metre (1/m) where the density is 1")
    albedo: Albedo = Field(default=(1.0, 1.0, 1.0), description="the fraction of that which is scattered, by channel")
    g: Asymmetry = Field(
        default=0.0, description="mean cosine of scattering: 1 forwards, 0 to all sides, -1 back to where it came from"
    )

    @model_validator(mode="after")
    def _box_has_a_volume(self) -> "Grid":
        if any(low >= high for low, high in zip(self.min, self.max, strict=True)):
            raise ValueError("min must be less than max in every coordinate")
        return self

    def is_clear(self, assets: Mapping[str, Any]) -> bool:
        return self.extinction == 0.0 or not assets["file"].any()

    def check(self, assets: Mapping[str, Any]) -> None:
        density = assets["file"]
        # The longest edge that a voxel may have in a skewed box is one over the least stretch of the map to voxels.
        edge = 1.0 / np.linalg.svd(self._to_voxels(density.shape)[:, :3], compute_uv=False).min()
        thickness = self.extinction * float(density.max()) * edge
        if thickness > MOST_THICK:
            at(
                "extinction",
                f"makes the densest voxels {thickness:.3g} mean free paths thick, where {MOST_THICK:.0f} are the most; "
                f"with {self.extinction * MOST_THICK / thickness:.3g} or less, or a finer grid, it looks as solid",
            )

    def scatters(self) -> bool:
        return any(self.albedo)

    @staticmethod
    def pack(specs: Sequence["Grid"], assets: Sequence[Mapping[str, Any]]) -> "GridTable":
        grids = [files["file"] for files in assets]
        bounds = [block_maxima(grid) for grid in grids]
        to_voxels = [spec._to_voxels(grid.shape) for spec, grid in zip(specs, grids, strict=True)]
        return GridTable(
            density=np.concatenate([np.ascontiguousarray(grid, np.float32).ravel() for grid in grids]),
            first=_starts(grids),
            shape=np.array([grid.shape for grid in grids], np.int32),
            bound=np.concatenate([bound.ravel() for bound in bounds]),
            first_bound=_starts(bounds),
            blocks=np.array([bound.shape for bound in bounds], np.int32),
            to_voxels=np.ascontiguousarray(to_voxels, np.float64),
            extinction=np.array([spec.extinction for spec in specs], np.float64),
            albedo=np.array([spec.albedo for spec in specs], np.float64),
            g=np.array([spec.g for spec in specs], np.float64),
        )

    def _to_voxels(self, shape: tuple[int, ...]) -> NDArray[np.float64]:
        """The affine map (3, 4) from world space to voxels, of which `shape` fill the box."""
        low, high = np.array(self.min), np.array(self.max)
        size = np.array(shape) / (high - low)
        to_box = np.linalg.inv(matrix_of(self.transform))
        result = size[:, None] * to_box[:3]
        result[:, 3] -= size * low
        return np.asarray(result)


def _starts(arrays: Sequence[NDArray[Any]]) -> NDArray[np.int64]:
    """Where each array begins when they stand one after another."""
    return np.cumsum([0, *(array.size for array in arrays[:-1])], dtype=np.int64)


def block_maxima(density: NDArray[Any]) -> NDArray[np.float32]:
    """The largest interpolated density within each block of BLOCK voxels an edge: float32 (ceil(n / BLOCK), ...).

    Interpolation reaches half a voxel into the neighbours.
    """
    result = np.asarray(density, np.float32)
    for axis in range(3):
        size = result.shape[axis]
        slabs = [
            result.take(range(max(0, start - 1), min(size, start + BLOCK + 1)), axis).max(axis)
            for start in range(0, size, BLOCK)
        ]
        result = np.stack(slabs, axis)
    return np.ascontiguousarray(result)


class GridTable(NamedTuple):
    """One row a grid.

    density and bound float32, all grids' values, and all blocks' largest ones; first, first_bound (n,) int64, where a
    grid's begin; shape, blocks (n, 3) int32, how many there are along each axis; to_voxels (n, 3, 4), the affine map
    from world space; extinction (n,), 1/m at density 1; albedo (n, 3); g (n,): float64.
    """

    density: NDArray[np.float32]
    first: NDArray[np.int64]
    shape: NDArray[np.int32]
    bound: NDArray[np.float32]
    first_bound: NDArray[np.int64]
    blocks: NDArray[np.int32]
    to_voxels: NDArray[np.float64]
    extinction: NDArray[np.float64]
    albedo: NDArray[np.float64]
    g: NDArray[np.float64]


class GridRow(NamedTuple):
    """One medium; `x`, `y` and `z` are the rows of the map to voxels, without the displacement `shift`."""

    density: NDArray[np.float32]
    first: int
    shape: tuple[int, int, int]
    bound: NDArray[np.float32]
    first_bound: int
    blocks: tuple[int, int, int]
    x: Vec3
    y: Vec3
    z: Vec3
    shift: Vec3
    extinction: float
    albedo: Vec3
    g: float


@moved.register(GridTable)
def _(table: GridTable, by: Vec3) -> GridTable:
    to_voxels = table.to_voxels.copy()
    to_voxels[:, :, 3] -= table.to_voxels[:, :, :3] @ by
    return table._replace(to_voxels=to_voxels)


@kernel
def _int3(table, index):
    return (np.int64(table[index, 0]), np.int64(table[index, 1]), np.int64(table[index, 2]))


@kernel
def _turn(maps, index, axis):
    return (maps[index, axis, 0], maps[index, axis, 1], maps[index, axis, 2])


@row.register(GridTable)
def _(table, index):
    return GridRow(
        table.density,
        table.first[index],
        _int3(table.shape, index),
        table.bound,
        table.first_bound[index],
        _int3(table.blocks, index),
        _turn(table.to_voxels, index, 0),
        _turn(table.to_voxels, index, 1),
        _turn(table.to_voxels, index, 2),
        (table.to_voxels[index, 0, 3], table.to_voxels[index, 1, 3], table.to_voxels[index, 2, 3]),
        table.extinction[index],
        row3(table.albedo, index),
        table.g[index],
    )


@kernel
def _turned(medium, vector):
    """A world vector in voxels."""
    return (
        medium.x[0] * vector[0] + medium.x[1] * vector[1] + medium.x[2] * vector[2],
        medium.y[0] * vector[0] + medium.y[1] * vector[1] + medium.y[2] * vector[2],
        medium.z[0] * vector[0] + medium.z[1] * vector[1] + medium.z[2] * vector[2],
    )


@kernel
def _between(position, size):
    """(lower voxel, upper voxel, weight of the upper) for a coordinate; values belong to the middles of voxels."""
    middle = min(max(position - 0.5, 0.0), size - 1.0)
    lower = int(middle)
    return lower, min(lower + 1, size - 1), middle - lower


@kernel
def density_at(medium, point):
    """The density at a point in voxels, by linear interpolation along the three axes."""
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


# ---- A walk through the blocks


class Walk(NamedTuple):
    """A ray on its way through the blocks.

    before, the distance (m) to where it is in the box for the first time, from which on it is followed, lest steps be
    lost beside the way of a ray from far away; start and way, the ray in voxels from there on, whose parameter is the
    distance in metres; at, how far it has come; end, where it leaves; block, where it is; out, the distances at which
    it leaves the block along each axis; bound (1/m), the largest extinction there.
    """

    before: float
    start: Vec3
    way: Vec3
    at: float
    end: float
    block: tuple[int, int, int]
    out: Vec3
    bound: float


@kernel
def _entry(start, way, size):
    """Distance at which a ray enters 0 .. size along an axis; where it never does, infinity."""
    if way == 0.0:
        return 0.0 if 0.0 <= start <= size else math.inf
    return ((0.0 if way > 0.0 else size) - start) / way


@kernel
def _exit(start, way, size):
    """Distance at which a ray leaves 0 .. size along an axis."""
    if way == 0.0:
        return math.inf
    return ((size if way > 0.0 else 0.0) - start) / way


@kernel
def _block_of(position, count):
    return min(max(int(position / BLOCK), 0), count - 1)


@kernel
def _out(start, way, block):
    """Distance at which a ray leaves a block along an axis."""
    if way == 0.0:
        return math.inf
    return (BLOCK * (block + 1 if way > 0.0 else block) - start) / way


@kernel
def _bound(medium, block):
    _, count_y, count_z = medium.blocks
    return medium.extinction * medium.bound[medium.first_bound + (block[0] * count_y + block[1]) * count_z + block[2]]


@kernel
def begin_walk(medium, origin, direction, distance):
    """The Walk of a ray up to `distance`; it is over at once, at its `end`, where the ray misses the box."""
    start, way = _turned(medium, origin), _turned(medium, direction)
    start = (start[0] + medium.shift[0], start[1] + medium.shift[1], start[2] + medium.shift[2])
    sx, sy, sz = medium.shape
    near = max(max(0.0, _entry(start[0], way[0], sx)), max(_entry(start[1], way[1], sy), _entry(start[2], way[2], sz)))
    far = min(min(distance, _exit(start[0], way[0], sx)), min(_exit(start[1], way[1], sy), _exit(start[2], way[2], sz)))
    if not near < far:
        return Walk(far, start, way, 0.0, 0.0, (0, 0, 0), (math.inf, math.inf, math.inf), 0.0)
    start = madd(start, near, way)
    block = (
        _block_of(start[0], medium.blocks[0]),
        _block_of(start[1], medium.blocks[1]),
        _block_of(start[2], medium.blocks[2]),
    )
    out = (_out(start[0], way[0], block[0]), _out(start[1], way[1], block[1]), _out(start[2], way[2], block[2]))
    return Walk(near, start, way, 0.0, far - near, block, out, _bound(medium, block))


@kernel
def walk_on(medium, walk, thickness):
    """Go on until the integral of the bound has grown by `thickness`, or to the end.

    References: Amanatides, Woo 1987, "A Fast Voxel Traversal Algorithm for Ray Tracing".
    """
    at, end, out, bound = walk.at, walk.end, walk.out, walk.bound
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
        bound = _bound(medium, (x, y, z))
    return Walk(walk.before, start, way, at, end, (x, y, z), out, bound)


@kernel
def _extinction_at(medium, walk):
    point = (
        walk.start[0] + walk.at * walk.way[0],
        walk.start[1] + walk.at * walk.way[1],
        walk.start[2] + walk.at * walk.way[2],
    )
    return medium.extinction * density_at(medium, point)


@fly.register(GridRow)
def _(medium, origin, direction, distance, throughput, draws, numbers):
    """Collide as often as the bound says, and take it for real as often as the density says (delta tracking)."""
    walk = begin_walk(medium, origin, direction, distance)
    while walk.at < walk.end:
        u1, u2 = flight_numbers(draws, numbers)
        numbers += 1
        walk = walk_on(medium, walk, -math.log1p(-u2))
        if walk.at < walk.end and u1 * walk.bound < _extinction_at(medium, walk):
            return Flight(walk.before + walk.at, medium.albedo, numbers)
    return Flight(math.inf, (1.0, 1.0, 1.0), numbers)


@transmittance.register(GridRow)
def _(medium, origin, direction, distance, draws, numbers):
    """The product over such collisions of the chance that each is not real (ratio tracking)."""
    walk = begin_walk(medium, origin, direction, distance)
    through = 1.0
    while walk.at < walk.end and through > 0.0:
        u1, u2 = shadow_numbers(draws, numbers)
        numbers += 1
        walk = walk_on(medium, walk, -math.log1p(-u2))
        if walk.at < walk.end:
            through *= max(0.0, 1.0 - _extinction_at(medium, walk) / walk.bound)
            if through < _FEW:
                through = _FEW if u1 * _FEW < through else 0.0
    return (through, through, through), numbers


@scatter_phase.register(GridRow)
def _(medium, direction, u1, u2):
    return sample_henyey_greenstein(direction, medium.g, u1, u2)


@evaluate_phase.register(GridRow)
def _(medium, direction, outgoing):
    return pdf_henyey_greenstein(direction, outgoing, medium.g)
