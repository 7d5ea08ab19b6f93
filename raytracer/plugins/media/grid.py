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

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.geometry import row3
from raytracer.core.vec import Vec3
from raytracer.plugins.media.base import interface
from raytracer.plugins.media.base.voxel_traversal import BLOCK, advance_traversal, begin_traversal, extinction_at
from raytracer.schema.fields import Albedo, NonNegativeNumber, Point
from raytracer.schema.spec import field_error
from raytracer.schema.transform import Transform, matrix_of

_FEW = 0.05
"""Estimates of transmittance below this are ended by Russian roulette: the rest is not worth many steps."""

MAX_OPTICAL_THICKNESS = interface.NUMBERS_PER_DISTANCE / (math.sqrt(3.0) * BLOCK)
"""Largest optical thickness of a voxel, with which light crosses a block by the random numbers of one distance.

In a block that is dense here and empty there, each number takes light on by a mean free path of the densest voxel.
Thicker voxels would look no different: light gets no further into one than a thousandth of it.
"""


class Grid(interface.MediumSpec):
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
    g: interface.Asymmetry = Field(
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
        if thickness > MAX_OPTICAL_THICKNESS:
            field_error(
                "extinction",
                f"makes the densest voxels {thickness:.3g} mean free paths thick, where "
                f"{MAX_OPTICAL_THICKNESS:.0f} are the most; "
                f"with {self.extinction * MAX_OPTICAL_THICKNESS / thickness:.3g} or less, or a finer grid, it "
                f"looks as solid",
            )

    def scatters(self) -> bool:
        return any(self.albedo)

    @staticmethod
    def pack(specs: Sequence["Grid"], assets: Sequence[Mapping[str, Any]]) -> "GridTable":
        grids = [files["file"] for files in assets]
        bounds = [block_majorants(grid) for grid in grids]
        to_voxels = [spec._to_voxels(grid.shape) for spec, grid in zip(specs, grids, strict=True)]
        return GridTable(
            density=np.concatenate([np.ascontiguousarray(grid, np.float32).ravel() for grid in grids]),
            first=_starts(grids),
            shape=np.array([grid.shape for grid in grids], np.int32),
            majorant=np.concatenate([bound.ravel() for bound in bounds]),
            first_majorant=_starts(bounds),
            blocks=np.array([bound.shape for bound in bounds], np.int32),
            to_voxels=np.ascontiguousarray(to_voxels, np.float64),
            extinction=np.array([spec.extinction for spec in specs], np.float64),
            albedo=np.array([spec.albedo for spec in specs], np.float64),
            g=np.array([spec.g for spec in specs], np.float64),
        )

    def _to_voxels(self, shape: tuple[int, ...]) -> NDArray[np.float64]:
        """Return the affine map (3, 4) from world space to voxels, of which `shape` fill the box."""
        low, high = np.array(self.min), np.array(self.max)
        size = np.array(shape) / (high - low)
        to_box = np.linalg.inv(matrix_of(self.transform))
        result = size[:, None] * to_box[:3]
        result[:, 3] -= size * low
        return np.asarray(result)


def _starts(arrays: Sequence[NDArray[Any]]) -> NDArray[np.int64]:
    """Return the offset of each array when they stand one after another."""
    return np.cumsum([0, *(array.size for array in arrays[:-1])], dtype=np.int64)


def block_majorants(density: NDArray[Any]) -> NDArray[np.float32]:
    """Return the largest interpolated density in each block of BLOCK voxels an edge: float32 (ceil(n / BLOCK), ...).

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
    """Packed grids, one row each.

    density float32 : values of all grids, one after another.
    first (n,) int64 : offset of each grid's values.
    shape (n, 3) int32 : voxels along each axis.
    majorant float32 : largest densities of all blocks of all grids.
    first_majorant (n,) int64 : offset of each grid's blocks.
    blocks (n, 3) int32 : blocks along each axis.
    to_voxels (n, 3, 4) float64 : affine map from world space.
    extinction (n,) float64 : at density 1 (1/m).
    albedo (n, 3), g (n,) float64 : of the scattering.
    """

    density: NDArray[np.float32]
    first: NDArray[np.int64]
    shape: NDArray[np.int32]
    majorant: NDArray[np.float32]
    first_majorant: NDArray[np.int64]
    blocks: NDArray[np.int32]
    to_voxels: NDArray[np.float64]
    extinction: NDArray[np.float64]
    albedo: NDArray[np.float64]
    g: NDArray[np.float64]


class GridRow(NamedTuple):
    """One packed grid, as in `GridTable`; `x`, `y`, `z` are the rows of the map to voxels, `shift` its displacement."""

    density: NDArray[np.float32]
    first: int
    shape: tuple[int, int, int]
    majorant: NDArray[np.float32]
    first_majorant: int
    blocks: tuple[int, int, int]
    x: Vec3
    y: Vec3
    z: Vec3
    shift: Vec3
    extinction: float
    albedo: Vec3
    g: float


@interface.translate_media.register(GridTable)
def translate_media_grid_table(table: GridTable, by: Vec3) -> GridTable:
    to_voxels = table.to_voxels.copy()
    to_voxels[:, :, 3] -= table.to_voxels[:, :, :3] @ by
    return table._replace(to_voxels=to_voxels)


@kernel
def _int3(table, index):
    return (np.int64(table[index, 0]), np.int64(table[index, 1]), np.int64(table[index, 2]))


@kernel
def _turn(maps, index, axis):
    return (maps[index, axis, 0], maps[index, axis, 1], maps[index, axis, 2])


@interface.row.register(GridTable)
def row_grid_table(table, index):
    return GridRow(
        table.density,
        table.first[index],
        _int3(table.shape, index),
        table.majorant,
        table.first_majorant[index],
        _int3(table.blocks, index),
        _turn(table.to_voxels, index, 0),
        _turn(table.to_voxels, index, 1),
        _turn(table.to_voxels, index, 2),
        (table.to_voxels[index, 0, 3], table.to_voxels[index, 1, 3], table.to_voxels[index, 2, 3]),
        table.extinction[index],
        row3(table.albedo, index),
        table.g[index],
    )


@interface.sample_distance.register(GridRow)
def sample_distance_grid_row(medium, origin, direction, distance, throughput, draws, numbers):
    """Draw collisions by the majorant, and accept each by the density over it (delta tracking)."""
    walk = begin_traversal(medium, origin, direction, distance)
    while walk.at < walk.end:
        u1, u2 = interface.distance_numbers(draws, numbers)
        numbers += 1
        walk = advance_traversal(medium, walk, -math.log1p(-u2))
        if walk.at < walk.end and u1 * walk.majorant < extinction_at(medium, walk):
            return interface.DistanceSample(walk.before + walk.at, medium.albedo, numbers)
    return interface.DistanceSample(math.inf, (1.0, 1.0, 1.0), numbers)


@interface.transmittance.register(GridRow)
def transmittance_grid_row(medium, origin, direction, distance, draws, numbers):
    """Multiply the probabilities that such collisions are not accepted (ratio tracking)."""
    walk = begin_traversal(medium, origin, direction, distance)
    through = 1.0
    while walk.at < walk.end and through > 0.0:
        u1, u2 = interface.shadow_numbers(draws, numbers)
        numbers += 1
        walk = advance_traversal(medium, walk, -math.log1p(-u2))
        if walk.at < walk.end:
            through *= max(0.0, 1.0 - extinction_at(medium, walk) / walk.majorant)
            if through < _FEW:
                through = _FEW if u1 * _FEW < through else 0.0
    return (through, through, through), numbers
