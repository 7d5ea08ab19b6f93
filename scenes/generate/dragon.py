"""Write ``scenes/generated/dragon.ply``: a dragon that lies coiled and raises its neck, of 560,000 triangles.

Its coil is about 1 wide and lies on y = 0; it looks along +z.  Scales on its back, plates on its belly, a crest of
spikes from the brow to the tail, horns and four legs.  A second run writes the same bytes:

    python scenes/generate/dragon.py [OUT.ply]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PchipInterpolator

ALONG, AROUND = 1800, 144
ROWS_OF_SCALES, SCALES_AROUND = 150, 20
SPIKES = 46
POINT = 1e-4

Array = NDArray[np.float64]

# The middle of the body from the tip of the tail to the nose, and the half width there.
SPINE = np.array(
    [
        (-0.62, 0.02, 0.18), (-0.52, 0.03, -0.12), (-0.25, 0.06, -0.40), (0.13, 0.09, -0.42), (0.42, 0.11, -0.18),
        (0.46, 0.12, 0.14), (0.24, 0.13, 0.38), (-0.08, 0.14, 0.38), (-0.27, 0.16, 0.17), (-0.24, 0.20, -0.06),
        (-0.05, 0.29, -0.17), (0.13, 0.43, -0.10), (0.14, 0.58, 0.02), (0.06, 0.70, 0.06), (0.00, 0.78, 0.12),
        (-0.01, 0.79, 0.22), (-0.01, 0.765, 0.31), (-0.01, 0.745, 0.37),
    ]
)  # fmt: skip
WIDTH = [
    (0.0, 0.004), (0.06, 0.02), (0.2, 0.05), (0.4, 0.09), (0.55, 0.125), (0.68, 0.12), (0.78, 0.085), (0.86, 0.06),
    (0.905, 0.055), (0.93, 0.078), (0.95, 0.082), (0.967, 0.058), (0.985, 0.05), (0.995, 0.036), (1.0, 0.002),
]  # fmt: skip


def spine(count: int) -> tuple[Array, Array, Array, Array]:
    """Return points at equal steps of the body, and its directions along, up and across, (count, 3) each."""
    curve = CubicSpline(np.arange(len(SPINE)), SPINE)
    fine = np.linspace(0.0, len(SPINE) - 1.0, 40 * count)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve(fine), axis=0), axis=1))])
    place = np.interp(np.linspace(0.0, length[-1], count), length, fine)
    along = curve(place, 1)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    # The back is up, as far as the body lets it be; where the neck stands it faces backwards.
    wanted = np.array([0.0, 1.0, 0.0]) - 0.9 * along * (along[:, 1:2] > 0.0) * np.array([0.0, 0.0, 1.0])
    up = wanted - along * np.sum(wanted * along, axis=1, keepdims=True)
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    return curve(place), along, up, np.cross(up, along)


def relief(share: Array, angle: Array, width: Array) -> Array:
    """Return by how much the skin stands out (in half widths): share of the length, and angle from the back (rad)."""
    # Scales lie in rows like shingles, every other one half a step off; each rises towards the tail, to an edge.
    row = ROWS_OF_SCALES * share
    column = SCALES_AROUND * angle / (2.0 * np.pi) + 0.5 * (np.floor(row) % 2.0)
    across = 2.0 * np.abs(column % 1.0 - 0.5)
    depth = 1.0 - row % 1.0
    scale = np.clip(1.0 - across**2 - (1.0 - depth) ** 3, 0.0, 1.0) ** 0.7
    back = np.clip(1.6 - 2.2 * np.abs(angle) / np.pi, 0.0, 1.0)
    # Plates of the belly reach across it.
    plate = np.abs(np.sin(0.5 * np.pi * row)) ** 0.5
    belly = np.clip(2.4 * np.abs(angle) / np.pi - 1.5, 0.0, 1.0)
    # A crest of spikes, bent backwards.
    spike = (SPIKES * share) % 1.0
    height = 0.75 * np.clip(1.0 - spike, 0.0, 1.0) ** 1.5 * np.clip(12.0 * spike, 0.0, 1.0)
    crest = height * np.exp(-((angle / 0.13) ** 2)) * np.clip((0.955 - share) / 0.02, 0.0, 1.0)
    head = np.clip((share - 0.925) / 0.01, 0.0, 1.0)
    skin = (0.09 * scale * back + 0.05 * plate * belly) * (1.0 - 0.6 * head)
    # Brows over the eyes, nostrils and a mouth.
    brow = 0.3 * np.exp(-(((share - 0.952) / 0.006) ** 2) - ((np.abs(angle) - 0.75) / 0.3) ** 2)
    nostril = 0.35 * np.exp(-(((share - 0.991) / 0.003) ** 2) - ((np.abs(angle) - 0.6) / 0.25) ** 2)
    mouth = -0.22 * np.exp(-(((np.abs(angle) - 2.0) / 0.06) ** 2)) * np.clip((share - 0.958) / 0.006, 0.0, 1.0)
    return np.where(width > 0.0, skin + crest + brow + nostril + mouth, 0.0)


def skin() -> tuple[Array, NDArray[np.int64]]:
    """Return the vertices (n, 3) and triangles (m, 3) of the body."""
    points, _, up, across = spine(ALONG)
    share = np.linspace(0.0, 1.0, ALONG)
    width = PchipInterpolator(*np.array(WIDTH).T)(share)
    angle = 2.0 * np.pi * np.arange(AROUND) / AROUND - np.pi
    # As many points on the back, where the crest is thin, as on the rest.
    angle -= 0.75 * np.sin(angle)
    s, a = np.meshgrid(share, angle, indexing="ij")
    radius = width[:, None] * (1.0 + relief(s, a, width[:, None]))
    flat = 1.0 - 0.22 * np.clip((share - 0.955) / 0.02, 0.0, 1.0)
    out = np.cos(a)[..., None] * up[:, None] * flat[:, None, None] + np.sin(a)[..., None] * across[:, None]
    found = points[:, None] + radius[..., None] * out
    found[..., 1] = np.maximum(found[..., 1], 0.0)
    return found.reshape(-1, 3), grid(ALONG, AROUND)


def grid(rows: int, columns: int) -> NDArray[np.int64]:
    """Return the triangles of rows of points that close around, anticlockwise from outside."""
    row, column = (index.ravel() for index in np.meshgrid(np.arange(rows - 1), np.arange(columns), indexing="ij"))
    a, b = row * columns + column, row * columns + (column + 1) % columns
    return np.concatenate([np.stack([a, a + columns, b], 1), np.stack([b, a + columns, b + columns], 1)])


def tube(way: Array, widths: Array, ridges: int, rows: int = 240, columns: int = 40) -> tuple[Array, NDArray[np.int64]]:
    """Return a ringed tube along a way (k, 3), of half widths (k,): a horn, a leg, a claw."""
    place = np.linspace(0.0, 1.0, rows)
    curve = CubicSpline(np.linspace(0.0, 1.0, len(way)), way)
    width = PchipInterpolator(np.linspace(0.0, 1.0, len(widths)), widths)(place)
    width *= 1.0 + 0.1 * np.abs(np.sin(np.pi * ridges * place))
    # Both ends are closed, but for a point.
    width[[0, -1]] = POINT
    along = curve(place, 1)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    side = np.cross(along, np.array([0.31, 0.2, 0.93]))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    other = np.cross(along, side)
    angle = 2.0 * np.pi * np.arange(columns) / columns
    out = np.cos(angle)[:, None] * side[:, None] + np.sin(angle)[:, None] * other[:, None]
    return (curve(place)[:, None] + width[:, None, None] * out).reshape(-1, 3), grid(rows, columns)


def limbs() -> list[tuple[Array, NDArray[np.int64]]]:
    """Return the horns, and legs with three claws each."""
    parts = []
    for side in (-1.0, 1.0):
        horn = np.array([(0.03, 0.84, 0.17), (0.07, 0.91, 0.11), (0.10, 0.95, 0.0), (0.09, 0.93, -0.1)])
        horn[:, 0] = -0.01 + side * horn[:, 0]
        parts.append(tube(horn, np.array([0.028, 0.024, 0.015, 0.001]), 14))
    hips = ((-0.10, 0.40, -0.1, 0.1), (0.38, 0.28, 0.12, 0.1), (0.47, -0.12, 0.16, -0.06), (-0.31, 0.12, -0.16, 0.06))
    for x, z, right, front in hips:
        knee, foot = (x + 0.9 * right, 0.17, z + 0.9 * front), np.array([x + 1.1 * right, 0.025, z + 1.1 * front])
        way = np.array([(x, 0.12, z), knee, foot])
        parts.append(tube(way, np.array([0.085, 0.05, 0.03]), 9))
        heading = np.array([right, 0.0, front]) / np.hypot(right, front)
        for turn in (-0.6, 0.0, 0.6):
            c, s = np.cos(turn), np.sin(turn)
            ahead = np.array([c * heading[0] - s * heading[2], 0.0, s * heading[0] + c * heading[2]])
            claw = np.array([foot, foot + 0.05 * ahead + (0.0, 0.02, 0.0), foot + 0.1 * ahead - (0.0, 0.02, 0.0)])
            parts.append(tube(claw, np.array([0.02, 0.014, 0.001]), 3, 60, 24))
    return parts


def ply() -> bytes:
    """Return the mesh as a binary PLY file."""
    vertices, triangles = [], []
    first = 0
    for points, faces in (skin(), *limbs()):
        vertices.append(points)
        triangles.append(faces + first)
        first += len(points)
    corners = np.concatenate(triangles)
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {first}\nproperty float x\nproperty float y\nproperty float z\n"
        f"element face {len(corners)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    packed = np.empty(len(corners), np.dtype([("count", "u1"), ("corners", "<i4", 3)]))
    packed["count"], packed["corners"] = 3, corners
    return header.encode("ascii") + np.concatenate(vertices).astype("<f4").tobytes() + packed.tobytes()


def main() -> None:
    """Write the mesh to the path given, or to where the scene looks for it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    default = Path(__file__).resolve().parent.parent / "generated" / "dragon.ply"
    parser.add_argument("out", nargs="?", type=Path, default=default, help="default: scenes/generated/dragon.ply")
    arguments = parser.parse_args()
    arguments.out.parent.mkdir(exist_ok=True)
    arguments.out.write_bytes(ply())


if __name__ == "__main__":
    main()
