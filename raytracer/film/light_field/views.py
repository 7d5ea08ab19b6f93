"""Geometry of the views of a light field: their places, and the directions of their pixels.

Views stand in one plane, that of a lens or of an array of cameras, and look along one axis.  Positions in that plane
are right and up from the middle (m).  Images are those at a distance of 1: tangents to the right of the axis and up.
A view at `u` sees along the slope `x - w0 u` what the middle would see at `x` in the plane at the distance `1 / w0`,
where all views see the same at the same pixel: what is there stands still from view to view.  So a point at the
distance `1 / w` and at `x` from the middle is at `x - u (w - w0)` in the view at `u`.

References: Levoy & Hanrahan 1996, "Light Field Rendering"; Gortler et al. 1996, "The Lumigraph"; Isaksen, McMillan,
Gortler 2000, "Dynamically Reparameterized Light Fields"; Ng 2005, "Fourier Slice Photography", sec. 3.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Plane(NamedTuple):
    """The image plane at a distance of 1: size of a pixel, left and top edge, right and up from the axis (tangents)."""

    pixel: float
    left: float
    top: float


class Pose(NamedTuple):
    """Pose of the views in the scene: their middle (m), and the unit vectors right, up and forward."""

    origin: tuple[float, float, float]
    right: tuple[float, float, float]
    up: tuple[float, float, float]
    forward: tuple[float, float, float]

    @classmethod
    def of(cls, rows: Iterable[Iterable[float]]) -> "Pose":
        """Make a pose of four triples of any numbers."""
        return cls(*((float(x), float(y), float(z)) for x, y, z in rows))


@dataclass(frozen=True)
class Views:
    """The geometry of a light field: rows x columns views of height x width pixels.

    Attributes
    ----------
    position (m) : float64 (rows, columns, 2), of each view in their plane, right and up; row 0 is the highest, column
        0 the leftmost, as seen from behind.
    plane : the image plane of every view, at a distance of 1.
    width, height (px) : of a view.
    inverse_focus (1/m) : one over the distance of the plane in which the same pixel of all views sees the same point;
        0 for infinity, where views are parallel.
    cell (m) : width and height of the part of their plane over which each view gathers light; None for points.
    aperture (m) : diameter of the lens behind which the views are; None for an array of cameras.
    focal_length (mm) : of that lens, which `alpha` and f-numbers refer to; None if not known.
    pose : in the scene; None if not known.
    coverage : float64 (rows, columns), part of each view's cell that the lens's opening leaves open, 0 to 1; None where
        it is the disc of the diameter `aperture`, or there is no lens.

    Raises
    ------
    ValueError : sizes are inconsistent, or numbers are not finite.
    """

    position: NDArray[np.float64]
    plane: Plane
    width: int
    height: int
    inverse_focus: float = 0.0
    cell: tuple[float, float] | None = None
    aperture: float | None = None
    focal_length: float | None = None
    pose: Pose | None = None
    coverage: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        shape = np.shape(self.position)
        if len(shape) != 3 or shape[2] != 2 or 0 in shape:
            raise ValueError(f"position must have the shape (rows, columns, 2), got {shape}")
        if self.width < 1 or self.height < 1:
            raise ValueError(f"views must have pixels, got {self.width} x {self.height}")
        if self.coverage is not None:
            if np.shape(self.coverage) != shape[:2]:
                raise ValueError(f"coverage must have the shape {shape[:2]}, got {np.shape(self.coverage)}")
            if not ((self.coverage >= 0.0) & (self.coverage <= 1.0)).all():
                raise ValueError("the coverage of views must be from 0 to 1")
        numbers = [*self.plane, self.inverse_focus, *(self.cell or ()), self.aperture or 0.0, self.focal_length or 0.0]
        numbers += [number for triple in self.pose or () for number in triple]
        if not (np.isfinite(self.position).all() and all(map(math.isfinite, numbers)) and self.plane.pixel > 0.0):
            raise ValueError("numbers of a light field's geometry must be finite, and its pixels have a size")

    @property
    def rows(self) -> int:
        """Rows of views."""
        return int(self.position.shape[0])

    @property
    def columns(self) -> int:
        """Views in a row."""
        return int(self.position.shape[1])

    @property
    def focus_distance(self) -> float:
        """Distance (m) of the plane in which all views see the same; inf if they are parallel."""
        return math.inf if self.inverse_focus == 0.0 else 1.0 / self.inverse_focus

    def farthest(self, eye: NDArray[np.float64]) -> float:
        """Compute the distance (m) of the view that is farthest from a point; from the middle if no pose is known."""
        middle = np.zeros(3)
        right_up = np.eye(3)[:2]
        if self.pose is not None:
            middle, right_up = np.subtract(self.pose.origin, eye), np.array([self.pose.right, self.pose.up])
        return float(np.linalg.norm(middle + self.position @ right_up, axis=-1).max())

    def shift(self, inverse_distance: float) -> NDArray[np.float64]:
        """Compute the disparity of a distance in all views against the middle: (rows, columns, 2) px right and down."""
        moved = self.position * ((self.inverse_focus - inverse_distance) / self.plane.pixel)
        return np.asarray(moved * np.array([1.0, -1.0]))

    def nearest(self, right: float = 0.0, up: float = 0.0) -> tuple[int, int]:
        """Find row and column of the view nearest to a place in their plane (m); the middle by default."""
        away = ((self.position - np.array([right, up])) ** 2).sum(axis=-1)
        row, column = np.unravel_index(int(away.argmin()), away.shape)
        return int(row), int(column)
