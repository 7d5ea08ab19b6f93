"""Affine transforms, as shapes use them."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raytracer.schema.transform import TRANSFORM_ROUNDING

Matrix = NDArray[np.float64]
"""To world space: (4, 4) float64, column vectors, last row 0 0 0 1."""


def transform_points(matrix: Matrix, rows: ArrayLike) -> NDArray[np.float64]:
    """Transform points (n, 3)."""
    return np.asarray(np.asarray(rows, np.float64) @ matrix[:3, :3].T + matrix[:3, 3])


def transform_vectors(matrix: Matrix, rows: ArrayLike) -> NDArray[np.float64]:
    """Transform differences of points (n, 3), which translation leaves alone."""
    return np.asarray(np.asarray(rows, np.float64) @ matrix[:3, :3].T)


def transform_normals(matrix: Matrix, rows: ArrayLike) -> NDArray[np.float64]:
    """Transform unit normals (n, 3) by the inverse transpose; they keep to their side under a mirror image.

    References: Pharr et al. 2023, "Physically Based Rendering", 4th ed., sec. 3.10.3.
    """
    turned = np.asarray(rows, np.float64) @ np.linalg.inv(matrix[:3, :3])
    return np.asarray(turned / np.linalg.norm(turned, axis=1, keepdims=True))


def is_mirrored(matrix: Matrix) -> bool:
    """Tell if the matrix mirrors, so that u x v must be turned back to stay outside."""
    return bool(np.linalg.det(matrix[:3, :3]) < 0.0)


def is_uniform(matrix: Matrix) -> bool:
    """Tell if the matrix scales by the same factor along all axes, and does not shear."""
    gram = matrix[:3, :3].T @ matrix[:3, :3]
    # Equal columns at right angles, up to the rounding of a product of rotations.
    return bool(np.abs(gram - gram[0, 0] * np.eye(3)).max() <= TRANSFORM_ROUNDING * gram[0, 0])


def uniform_scale(matrix: Matrix) -> float:
    """Return the one factor by which a matrix scales that `is_uniform`."""
    return float(np.sqrt(matrix[:3, 0] @ matrix[:3, 0]))


def material_references(material: int, count: int = 1) -> NDArray[np.int32]:
    """Repeat a material reference for `count` primitives."""
    return np.full(count, material, np.int32)
