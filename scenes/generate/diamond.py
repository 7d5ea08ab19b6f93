"""Write ``scenes/diamond.ply``: a round brilliant, 10 mm wide, with its table up and its girdle's top at y = 0.

In metres, 57 facets and a girdle of 64; a second run writes the same bytes:

    python scenes/generate/diamond.py [OUT.ply]

References: Tolkowsky 1919, "Diamond Design" (the angles of crown and pavilion).
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, HalfspaceIntersection

RADIUS = 5e-3
GIRDLE_FACES = 64

# In units of the radius, and degrees.
GIRDLE = 0.05
TABLE = 0.53
CROWN, STAR, UPPER = 34.5, 20.5, 41.0
PAVILION, LOWER = 40.75, 42.2


def planes() -> NDArray[np.float64]:
    """Return rows (normal, offset) of the half-spaces, normal . x + offset <= 0, in units of the radius."""

    def ring(count: int, turn: float, slope: float, reach: float, height: float) -> list[list[float]]:
        """Facets that fall from the axis by `slope` (deg), each through a point at a distance and a height."""
        sine, cosine = np.sin(np.radians(slope)), np.cos(np.radians(slope))
        angles = 2.0 * np.pi * (np.arange(count) + turn) / count
        return [[sine * np.cos(a), cosine, sine * np.sin(a), -(sine * reach + cosine * height)] for a in angles]

    top = (1.0 - TABLE) * np.tan(np.radians(CROWN))
    rows = [[0.0, 1.0, 0.0, -top]]
    rows += ring(8, 0.0, CROWN, 1.0, 0.0)
    rows += ring(8, 0.5, STAR, TABLE * np.cos(np.pi / 8.0), top)
    rows += ring(16, 0.5, UPPER, 1.0, 0.0)
    rows += ring(GIRDLE_FACES, 0.5, 90.0, np.cos(np.pi / GIRDLE_FACES), 0.0)
    # Facets of the pavilion look down.
    rows += [[x, -y, z, d] for x, y, z, d in ring(16, 0.5, LOWER, 1.0, GIRDLE)]
    rows += [[x, -y, z, d] for x, y, z, d in ring(8, 0.0, PAVILION, 1.0, GIRDLE)]
    return np.array(rows)


def solid(half_spaces: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Return the vertices (n, 3) and the triangles (m, 3), anticlockwise from outside, of what half-spaces share."""
    found = HalfspaceIntersection(half_spaces, np.zeros(3)).intersections
    # Facets that meet in one point meet there within rounding.
    corners = np.unique(np.round(found, 9), axis=0)
    hull = ConvexHull(corners)
    triangles = hull.simplices.copy()
    a, b, c = (corners[triangles[:, i]] for i in range(3))
    inwards = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) < 0.0
    triangles[inwards] = triangles[inwards][:, ::-1]
    return corners, triangles.astype(np.int32)


def ply(half_spaces: NDArray[np.float64] | None = None, unit: float = RADIUS) -> bytes:
    """Return a stone as a binary PLY file, the brilliant by default; `unit` is what lengths are given in (m)."""
    corners, triangles = solid(planes() if half_spaces is None else half_spaces)
    vertices = unit * corners
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(vertices)}\nproperty float x\nproperty float y\nproperty float z\n"
        f"element face {len(triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    faces = np.empty(len(triangles), np.dtype([("count", "u1"), ("corners", "<i4", 3)]))
    faces["count"], faces["corners"] = 3, triangles
    return header.encode("ascii") + vertices.astype("<f4").tobytes() + faces.tobytes()


def main() -> None:
    """Write the mesh to the path given, or beside the scene that shows it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    default = Path(__file__).resolve().parent.parent / "diamond.ply"
    parser.add_argument("out", nargs="?", type=Path, default=default, help="default: scenes/diamond.ply")
    arguments = parser.parse_args()
    arguments.out.write_bytes(ply())


if __name__ == "__main__":
    main()
