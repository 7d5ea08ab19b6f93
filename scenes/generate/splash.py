"""Write ``scenes/lecture/splash.ply``: the crown that a drop raises from a layer of milk.

A wall around the y axis with points at equal angles, in metres; a second run writes the same bytes:

    python scenes/generate/splash.py [OUT.ply]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

POINTS = 14
AROUND = 8 * POINTS
UP = 12
RADIUS = 0.013
WALL = 0.008
POINT = 0.007
FOOT = 0.004
THICKNESS = 0.0012
LEAN = 0.35


def crown() -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Return the vertices (n, 3) and the triangles (m, 3), anticlockwise from outside."""
    angle = 2.0 * np.pi * np.arange(AROUND) / AROUND
    # The wall rises to its points, where it draws in to a thread.
    peak = np.clip(np.cos(POINTS * angle), 0.0, 1.0) ** 3
    top = WALL * (1.0 + 0.06 * np.sin(3.0 * angle)) + POINT * peak
    # Up along the outer side and down along the inner one; both end in a fillet below the surface of the milk.
    up = np.linspace(-0.05, 1.0, UP)
    share = np.concatenate([up, up[::-1][1:]])
    outside = np.concatenate([np.ones(UP), -np.ones(UP - 1)])
    outside[UP - 1] = 0.0
    height = share[:, None] * top
    foot = FOOT * np.exp(-6.0 * np.clip(share, 0.0, 1.0))
    thick = 0.5 * THICKNESS * np.sqrt(np.clip(1.0 - share**4, 0.0, 1.0))
    radius = RADIUS + LEAN * height + (outside * (foot + thick))[:, None]
    vertices = np.stack([radius * np.cos(angle), height, radius * np.sin(angle)], axis=-1).reshape(-1, 3)

    rows = len(share)
    row, column = np.meshgrid(np.arange(rows - 1), np.arange(AROUND), indexing="ij")
    a = (row * AROUND + column).ravel()
    b = (row * AROUND + (column + 1) % AROUND).ravel()
    triangles = np.concatenate([np.stack([a, a + AROUND, b], axis=1), np.stack([b, a + AROUND, b + AROUND], axis=1)])
    return vertices.astype(np.float32), triangles.astype(np.int32)


def ply() -> bytes:
    """Return the mesh as a binary PLY file."""
    vertices, triangles = crown()
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
    default = Path(__file__).resolve().parent.parent / "lecture" / "splash.ply"
    parser.add_argument("out", nargs="?", type=Path, default=default, help="default: scenes/lecture/splash.ply")
    arguments = parser.parse_args()
    arguments.out.write_bytes(ply())


if __name__ == "__main__":
    main()
