"""Write ``scenes/lightfield/letters/*.ply``: the letters of PLENOPTIC as blocks, a file each.

A letter is 1 high, its middle at the origin, its face at z = 0 and its back at z = -0.15; flat strokes and round ones,
0.2 wide.  A second run writes the same bytes:

    python scenes/generate/letters.py [FOLDER]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

STROKE = 0.2
THICKNESS = 0.15
STEPS = 32

Strip = NDArray[np.float64]
"""A stroke as the corners (n, 2, 2) of a row of quadrangles: at each step its left and its right side."""


def line(x0: float, y0: float, x1: float, y1: float, width: float = STROKE) -> Strip:
    """A straight stroke between the middles of its ends."""
    start, end = np.array([x0, y0]), np.array([x1, y1])
    along = (end - start) / np.linalg.norm(end - start)
    left = 0.5 * width * np.array([-along[1], along[0]])
    return np.array([[start + left, start - left], [end + left, end - left]])


def arc(x: float, y: float, wide: float, high: float, begin: float, end: float) -> Strip:
    """A round stroke within an ellipse of that middle and outer half axes, from one angle (deg) to another."""
    angle = np.radians(np.linspace(begin, end, STEPS + 1))
    unit = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    outer = np.array([x, y]) + unit * [wide, high]
    inner = np.array([x, y]) + unit * [wide - STROKE, high - STROKE]
    return np.stack([inner, outer], axis=1)


BOWL = [line(-0.3, 0.4, 0.05, 0.4), arc(0.05, 0.2, 0.3, 0.3, -90.0, 90.0), line(-0.3, 0.0, 0.05, 0.0)]

LETTERS = {
    "p": [line(-0.25, -0.5, -0.25, 0.5), *BOWL],
    "l": [line(-0.25, -0.5, -0.25, 0.5), line(-0.3, -0.4, 0.35, -0.4)],
    "e": [line(-0.25, -0.5, -0.25, 0.5), *(line(-0.3, y, end, y) for y, end in ((0.4, 0.35), (0, 0.28), (-0.4, 0.35)))],
    "n": [line(-0.28, -0.5, -0.28, 0.5), line(-0.26, 0.4, 0.26, -0.4), line(0.28, -0.5, 0.28, 0.5)],
    "o": [arc(0.0, 0.0, 0.42, 0.5, 0.0, 360.0)],
    "t": [line(0.0, -0.5, 0.0, 0.45), line(-0.38, 0.4, 0.38, 0.4)],
    "i": [line(0.0, -0.5, 0.0, 0.5), line(-0.2, 0.42, 0.2, 0.42, 0.16), line(-0.2, -0.42, 0.2, -0.42, 0.16)],
    "c": [arc(0.05, 0.0, 0.42, 0.5, 48.0, 312.0)],
}


def block(strips: list[Strip]) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Return the vertices (n, 3) and triangles (m, 3) of strokes, anticlockwise from outside."""
    corners: list[NDArray[np.float64]] = []
    for strip in strips:
        left, right = strip[:, 0], strip[:, 1]
        # A round stroke goes round to the left, a straight one has its left side first: turn all alike.
        turn = np.cross(np.append(right[0] - left[0], 0.0), np.append(left[1] - left[0], 0.0))[2]
        if turn < 0.0:
            left, right = right, left
        front, back = (
            [np.concatenate([side, np.full((len(side), 1), z)], axis=1) for side in (left, right)]
            for z in (0.0, -THICKNESS)
        )
        faces = [(front[0], front[1]), (back[1], back[0]), (front[1], back[1]), (back[0], front[0])]
        for a, b in faces:
            corners.append(np.stack([a[:-1], b[:-1], b[1:], a[1:]], axis=1))
        for step, order in ((0, (1, 0, 2, 3)), (-1, (0, 1, 3, 2))):
            ends = np.array([front[0][step], front[1][step], back[0][step], back[1][step]])
            corners.append(ends[list(order)][None])
    quads = np.concatenate(corners)
    vertices = quads.reshape(-1, 3)
    first = 4 * np.arange(len(quads))
    triangles = np.concatenate([np.stack([first, first + 1, first + 2], 1), np.stack([first, first + 2, first + 3], 1)])
    return vertices.astype(np.float32), triangles.astype(np.int32)


def ply(strips: list[Strip]) -> bytes:
    """Return a letter as a binary PLY file."""
    vertices, triangles = block(strips)
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(vertices)}\nproperty float x\nproperty float y\nproperty float z\n"
        f"element face {len(triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    faces = np.empty(len(triangles), np.dtype([("count", "u1"), ("corners", "<i4", 3)]))
    faces["count"], faces["corners"] = 3, triangles
    return header.encode("ascii") + vertices.astype("<f4").tobytes() + faces.tobytes()


def main() -> None:
    """Write the letters into the folder given, or beside the scene that shows them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    default = Path(__file__).resolve().parent.parent / "lightfield" / "letters"
    parser.add_argument("out", nargs="?", type=Path, default=default, help="default: scenes/lightfield/letters")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    for name, strips in LETTERS.items():
        (arguments.out / f"{name}.ply").write_bytes(ply(strips))


if __name__ == "__main__":
    main()
