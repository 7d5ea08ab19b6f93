"""Affine matrices as rows of scale, skew, shift, rotation and translation, which interpolate part by part.

References: Shoemake 1985, "Animating Rotation with Quaternion Curves", SIGGRAPH; Embree 4 API reference
(RTCQuaternionDecomposition).
"""

import math
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raytracer.schema.transform import Matrix

# Columns of a row of a trajectory, in the order of RTCQuaternionDecomposition.
SCALE, SKEW, SHIFT, QUATERNION, TRANSLATION = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 13), slice(13, 16)

Rows: TypeAlias = NDArray[np.float64]


def quaternion_of(rotation: Matrix) -> NDArray[np.float64]:
    """Compute the unit quaternion (r, i, j, k) of a rotation matrix (3, 3).

    References: Shepperd 1978, "Quaternion from Rotation Matrix", J. Guidance and Control 1(3).
    """
    x, y, z = np.diag(rotation)
    squares = np.array([1.0 + x + y + z, 1.0 + x - y - z, 1.0 - x + y - z, 1.0 - x - y + z])
    largest = int(np.argmax(squares))
    m = rotation
    products = {
        0: (squares[0], m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]),
        1: (m[2, 1] - m[1, 2], squares[1], m[0, 1] + m[1, 0], m[0, 2] + m[2, 0]),
        2: (m[0, 2] - m[2, 0], m[0, 1] + m[1, 0], squares[2], m[1, 2] + m[2, 1]),
        3: (m[1, 0] - m[0, 1], m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], squares[3]),
    }
    q = np.array(products[largest])
    return np.asarray(q / np.linalg.norm(q))


def quaternion_product(p: NDArray[np.float64], q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute the quaternion of the rotation q followed by p."""
    real = p[0] * q[0] - np.dot(p[1:], q[1:])
    return np.array([real, *(p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:]))])


def orthogonal_triangular(linear: Matrix) -> tuple[Matrix, Matrix]:
    """Factor a matrix (3, 3) into a rotation and an upper triangular one, whose last diagonal entry has its sign."""
    rotation, triangle = np.linalg.qr(linear)
    signs = np.where(np.diag(triangle) < 0.0, -1.0, 1.0)
    rotation, triangle = rotation * signs, signs[:, None] * triangle
    if np.linalg.det(rotation) < 0.0:
        rotation[:, 2], triangle[2] = -rotation[:, 2], -triangle[2]
    return rotation, triangle


def make_row(
    translation: Any, quaternion: NDArray[np.float64], triangle: Matrix, shift: Any = (0.0, 0.0, 0.0)
) -> NDArray[np.float64]:
    """Make the row of a trajectory that is the matrix translation . rotation . (triangle | shift)."""
    skew = triangle[[0, 0, 1], [1, 2, 2]]
    return np.concatenate([np.diag(triangle), skew, shift, quaternion, translation])


def decompose(matrix: Matrix) -> NDArray[np.float64]:
    """Decompose an affine matrix (4, 4) into a row (16,): scale, skew, shift, quaternion, translation."""
    rotation, triangle = orthogonal_triangular(matrix[:3, :3])
    return make_row(matrix[:3, 3], quaternion_of(rotation), triangle)


def compose(row: NDArray[np.float64]) -> Matrix:
    """Compute the affine matrix (4, 4) of a row of a trajectory."""
    r, (i, j, k) = row[QUATERNION][0], row[QUATERNION][1:]
    rotation = np.array(
        [
            [1.0 - 2.0 * (j * j + k * k), 2.0 * (i * j - r * k), 2.0 * (i * k + r * j)],
            [2.0 * (i * j + r * k), 1.0 - 2.0 * (i * i + k * k), 2.0 * (j * k - r * i)],
            [2.0 * (i * k - r * j), 2.0 * (j * k + r * i), 1.0 - 2.0 * (i * i + j * j)],
        ]
    )
    result = np.eye(4)
    result[:3, :3] = rotation @ triangle_of(row)
    result[:3, 3] = rotation @ row[SHIFT] + row[TRANSLATION]
    return result


def interpolate_rows(row: NDArray[np.float64], other: NDArray[np.float64], fraction: float) -> NDArray[np.float64]:
    """Interpolate between two rows of a trajectory."""
    result = row + fraction * (other - row)
    p, q = row[QUATERNION], other[QUATERNION]
    if np.dot(p, q) < 0.0:
        q = -q
    angle = 2.0 * math.atan2(float(np.linalg.norm(q - p)), float(np.linalg.norm(q + p)))
    if angle > 0.0:
        p = (math.sin((1.0 - fraction) * angle) * p + math.sin(fraction * angle) * q) / math.sin(angle)
    result[QUATERNION] = p
    return result


def triangle_of(row: NDArray[np.float64]) -> Matrix:
    """Return the scale and skew of a row of a trajectory as an upper triangular matrix (3, 3)."""
    triangle = np.diag(row[SCALE])
    triangle[[0, 0, 1], [1, 2, 2]] = row[SKEW]
    return triangle
