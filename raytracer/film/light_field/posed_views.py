"""Geometry of views that each have a pose of their own: round an object, on the walls of a room, along a path.

The views of `Views` stand in one plane and look along one axis; these stand and look anywhere.  Images are those at a
distance of 1 in front of each view, as there: tangents to the right of its axis and up.

Reference: Buehler et al. 2001, "Unstructured Lumigraph Rendering", sec. 3 (views anywhere).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.views import Plane, Pose, Views

POSE_SHAPE = (4, 3)
PLANE_NUMBERS = len(Plane._fields)

ORTHONORMAL_SLACK = 16.0 * float(np.finfo(np.float32).eps)
"""Difference of a view's axes from orthogonal unit vectors up to which they count as such: other programs write poses
in float32."""

IDENTITY = Pose((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, -1.0))
"""The pose of views whose place in the scene is not known."""


@dataclass(frozen=True)
class PosedViews:
    """Geometry of rows x columns views of height x width pixels, each with a pose of its own.

    Rows and columns are only the order in which views are kept; they need not be neighbours.

    Attributes
    ----------
    pose : float64 (rows, columns, 4, 3), of each view in the scene: its position (m), and the unit vectors right, up
        and forward.
    plane : float64 (rows, columns, 3), the image plane of each at a distance of 1: size of a pixel, left and top edge
        (tangents), as in `Plane`.
    width, height (px) : of a view.

    Raises
    ------
    ValueError : sizes are inconsistent, numbers are not finite, or axes are not orthogonal unit vectors of which up is
        to the left of right, as seen against forward.
    """

    pose: NDArray[np.float64]
    plane: NDArray[np.float64]
    width: int
    height: int

    def __post_init__(self) -> None:
        shape = np.shape(self.pose)
        if len(shape) != 4 or shape[2:] != POSE_SHAPE or 0 in shape:
            raise ValueError(f"pose must have the shape (rows, columns, 4, 3), got {shape}")
        if np.shape(self.plane) != (*shape[:2], PLANE_NUMBERS):
            wanted = (*shape[:2], PLANE_NUMBERS)
            raise ValueError(f"plane must have the shape {wanted}, got {np.shape(self.plane)}")
        if self.width < 1 or self.height < 1:
            raise ValueError(f"views must have pixels, got {self.width} x {self.height}")
        if not (np.isfinite(self.pose).all() and np.isfinite(self.plane).all() and (self.plane[..., 0] > 0.0).all()):
            raise ValueError("numbers of a light field's geometry must be finite, and its pixels have a size")
        axes = self.pose[..., 1:, :]
        off = np.abs(axes @ np.swapaxes(axes, -1, -2) - np.eye(3)).max(axis=(-1, -2))
        mirrored = np.linalg.det(axes) > 0.0
        if (off > ORTHONORMAL_SLACK).any() or mirrored.any():
            row, column = np.argwhere((off > ORTHONORMAL_SLACK) | mirrored)[0].tolist()
            raise ValueError(
                f"the axes of view {row},{column} must be orthogonal unit vectors: right, up, and forward, which is "
                "up x right"
            )

    @classmethod
    def of(cls, views: Views) -> "PosedViews":
        """Convert views in one plane: each has the pose of all, moved to its place, and the image plane that it sees.

        Views whose place in the scene is not known stand about the origin, and look along -z.
        """
        pose = np.array(IDENTITY if views.pose is None else views.pose)
        poses = np.broadcast_to(pose, (views.rows, views.columns, *POSE_SHAPE)).copy()
        poses[..., 0, :] += views.position @ pose[1:3]
        planes = np.broadcast_to(np.array(views.plane), (views.rows, views.columns, PLANE_NUMBERS)).copy()
        planes[..., 1:] -= views.inverse_focus * views.position
        return cls(poses, planes, views.width, views.height)

    @property
    def rows(self) -> int:
        """Rows of views."""
        return int(self.pose.shape[0])

    @property
    def columns(self) -> int:
        """Views in a row."""
        return int(self.pose.shape[1])

    def part(self, rows: slice, columns: slice) -> "PosedViews":
        """Return the geometry of some rows and columns of views."""
        return PosedViews(self.pose[rows, columns], self.plane[rows, columns], self.width, self.height)

    def farthest(self, eye: NDArray[np.float64]) -> float:
        """Compute the distance (m) of the view that is farthest from a point."""
        return float(np.linalg.norm(self.pose[..., 0, :] - eye, axis=-1).max())

    def focus_point(self) -> NDArray[np.float64] | None:
        """Find the point (3,) nearest to the lines of sight of the middles of all pictures; None if these are parallel.

        It is the one with the least sum of squared distances: of views round an object, the middle of that.
        """
        origin = self.pose[..., 0, :].reshape(-1, 3)
        half = 0.5 * np.array([self.width, -self.height])
        middle = self.plane[..., 1:] + self.plane[..., :1] * half
        ahead = self.pose[..., 3, :] + np.einsum("vua,vuai->vui", middle, self.pose[..., 1:3, :])
        ahead = ahead.reshape(-1, 3) / np.linalg.norm(ahead, axis=-1).reshape(-1, 1)
        across = np.eye(3) - ahead[:, :, None] * ahead[:, None, :]
        total = across.sum(axis=0)
        # Rounding leaves this much of what is 0 for parallel lines.
        if np.linalg.eigvalsh(total)[0] <= len(ahead) * ORTHONORMAL_SLACK:
            return None
        return np.asarray(np.linalg.solve(total, np.einsum("nij,nj->i", across, origin)))
