"""Scatter: a group, or an object that has a name, placed many times at random on a parallelogram.

In a scene:

    - {type: scatter, of: tree, count: 10000, seed: 1, corner: [-50, 0, -50], edges: [[100, 0, 0], [0, 0, 100]],
       scale: [0.7, 1.3], turn: 360, tilt: 4, spacing: 0.6}

Each copy is scaled, turned about `axis` by up to `turn`, tilted away from it by up to `tilt`, and moved to its place.
The same seed gives the same places.
"""

import math
from typing import Annotated, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator, model_validator

from raytracer.plugins.shapes.base.interface import Assets, PlacementSpec
from raytracer.schema.fields import Count, Direction, NonNegativeLength, Point, PositiveNumber, Quantity
from raytracer.schema.spec import field_error
from raytracer.schema.transform import matrix_of

_MOST = 10_000_000
_TRIES = 100
"""Places that are tried for each copy before an area counts as full."""

_FULLEST, _FEWEST = 0.75, 20
"""Points at random, each as far from all others as a disc is wide, fill 0.547 of an area with such discs: 0.6965 points
on each square of the spacing, a few more at its rim.  Of more, and more than a few, nobody need try.

References: Feder 1980, "Random sequential adsorption", Journal of Theoretical Biology 87(2).
"""

_CERTAINLY = 1.0 - 2.0**-20
"""Of a spacing: what is nearer than this part of it is too near however distances are rounded."""

Turn: TypeAlias = Annotated[float, Quantity("angle", low=0.0, high=360.0)]
Tilt: TypeAlias = Annotated[float, Quantity("angle", low=0.0, high=90.0)]
Rows: TypeAlias = NDArray[np.float64]


class Scatter(PlacementSpec):
    """Many copies of a group or an object, placed at random."""

    type: Literal["scatter"] = "scatter"
    count: Annotated[int, Count(1, _MOST)] = Field(description="how many copies")
    seed: Annotated[int, Count(0, 2**32 - 1)] = Field(default=0, description="another seed gives other places")
    corner: Point = Field(description="a corner of the parallelogram on which they stand (m)")
    edges: tuple[Point, Point] = Field(description="its two edges from the corner (m)")
    scale: tuple[PositiveNumber, PositiveNumber] = Field(
        default=(1.0, 1.0), description="least and greatest factor, between which each is drawn"
    )
    axis: Direction = Field(default=(0.0, 1.0, 0.0), description="axis about which copies are turned")
    turn: Turn = Field(default=360.0, description="greatest angle of the turn, from 0 on")
    tilt: Tilt = Field(default=0.0, description="greatest angle by which the axis is tilted, to any side")
    spacing: NonNegativeLength = Field(default=0.0, description="least distance between any two places (m)")

    @field_validator("edges")
    @classmethod
    def _has_area(cls, edges: tuple[Point, Point]) -> tuple[Point, Point]:
        if not np.any(np.cross(*edges)):
            raise ValueError("the two edges must be neither zero nor parallel, or there is no area to stand on")
        return edges

    @model_validator(mode="after")
    def _is_a_range(self) -> "Scatter":
        if self.scale[0] > self.scale[1]:
            field_error("scale", f"must be the least factor, then the greatest, got {list(self.scale)}")
        return self

    def poses(self, assets: Assets) -> Rows:
        """Return the matrices (count, 4, 4) of the copies, `transform` included.

        Raises
        ------
        ValueError : there is no room for so many at this spacing.
        """
        from scipy.spatial.transform import Rotation

        # Plain uniform numbers, of a generator that is named: these will not change with NumPy's version.
        random = np.random.Generator(np.random.PCG64(self.seed))
        places = self._places(random)
        scale, turn, tilt, side = random.random((4, self.count))
        low, high = self.scale
        axis = np.array(self.axis) / np.linalg.norm(self.axis)
        least = np.eye(3)[int(np.argmin(np.abs(axis)))]
        across = np.cross(axis, least)
        across /= np.linalg.norm(across)
        angle = 2.0 * math.pi * side
        about = np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * np.cross(axis, across)

        turned = Rotation.from_rotvec(math.radians(self.turn) * turn[:, None] * axis)
        # Uniform over the solid angle of the cone.
        away = np.arccos(1.0 - tilt * (1.0 - math.cos(math.radians(self.tilt))))
        tilted = Rotation.from_rotvec(away[:, None] * about)
        result = np.zeros((self.count, 4, 4))
        result[:, :3, :3] = (low + (high - low) * scale)[:, None, None] * (tilted * turned).as_matrix()
        result[:, :3, 3] = places
        result[:, 3, 3] = 1.0
        return np.asarray(matrix_of(self.transform) @ result)

    def _places(self, random: np.random.Generator) -> Rows:
        """Draw points (count, 3) of the parallelogram, none nearer to another than `spacing`.

        References: Bridson 2007, "Fast Poisson Disk Sampling in Arbitrary Dimensions", SIGGRAPH sketches (the grid).
        """
        corner, edges = np.array(self.corner), np.array(self.edges)
        if self.spacing == 0.0:
            return np.asarray(corner + random.random((self.count, 2)) @ edges)

        sides = np.linalg.norm(edges, axis=1)
        area = float(np.linalg.norm(np.cross(*edges)) + self.spacing * sides.sum() + math.pi * self.spacing**2)
        most = _FULLEST * area / self.spacing**2
        if self.count > max(_FEWEST, most):
            raise ValueError(
                f"there is no room: at a spacing of {self.spacing:g} m, {most:.0f} copies of {self.count} would find a "
                "place at most"
            )

        # Throw darts; cells are as wide as the spacing, so that only neighbours can be too near.
        cells: dict[tuple[int, int, int], list[Rows]] = {}
        placed: list[Rows] = []
        square = self.spacing**2
        around = [(i, j, k) for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1)]
        for _ in range(_TRIES):
            for point in _far_enough(corner + random.random((self.count, 2)) @ edges, placed, self.spacing):
                x, y, z = (int(cell) for cell in np.floor((point - corner) / self.spacing))
                near = (other for i, j, k in around for other in cells.get((x + i, y + j, z + k), ()))
                if all(float(np.dot(point - other, point - other)) >= square for other in near):
                    cells.setdefault((x, y, z), []).append(point)
                    placed.append(point)
                    if len(placed) == self.count:
                        return np.array(placed)
        raise ValueError(
            f"there is no room: at a spacing of {self.spacing:g} m, {len(placed)} copies of {self.count} found a place"
        )


def _far_enough(points: Rows, placed: list[Rows], spacing: float) -> Rows:
    """Return those of `points` (n, 3) that are not certainly too near to one of `placed`."""
    if not placed:
        return points
    from scipy.spatial import KDTree

    distance, _ = KDTree(np.array(placed)).query(points, distance_upper_bound=spacing)
    return np.asarray(points[distance >= _CERTAINLY * spacing])
