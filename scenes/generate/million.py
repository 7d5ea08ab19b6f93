"""Write the mesh of ``scenes/million.yaml``: a displaced sphere of 1,003,520 triangles.

    python scenes/generate/million.py [OUT.ply]

The sphere is an icosahedron, each of whose faces is cut into 224 x 224 triangles: no poles, no slivers, and one shared
vertex wherever faces meet, so the mesh is watertight. Nothing in it is random.
"""

from __future__ import annotations

import argparse
import itertools
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

FREQUENCY = 224  # 20 * 224^2 = 1,003,520 triangles
RADIUS = 0.66  # metres, before displacement

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def icosahedron() -> tuple[Floats, Ints]:
    """Return the 12 unit vertices and the 20 faces, counter-clockwise from outside."""
    golden = (1 + 5**0.5) / 2
    plane = [(a, b * golden) for a in (-1, 1) for b in (-1, 1)]
    corners = np.array([(0, a, b) for a, b in plane] + [(a, b, 0) for a, b in plane] + [(b, 0, a) for a, b in plane])

    # A face is any three corners that are an edge's length, 2, from each other.
    faces = []
    for i, j, k in itertools.combinations(range(12), 3):
        a, b, c = corners[i], corners[j], corners[k]
        if max(np.linalg.norm(a - b), np.linalg.norm(b - c), np.linalg.norm(c - a)) < 2.001:
            outward = np.dot(np.cross(b - a, c - a), a) > 0
            faces.append((i, j, k) if outward else (i, k, j))
    return corners / np.linalg.norm(corners[0]), np.array(faces)


def geodesic_sphere(frequency: int) -> tuple[Floats, Ints]:
    """Return unit vertices and faces of the icosahedron with every edge cut into `frequency` parts."""
    corners, faces = icosahedron()

    # Number the points of one face row by row: row i holds i + 1 points.
    i, j = np.array([(i, j) for i in range(frequency + 1) for j in range(i + 1)]).T
    weights = np.stack([frequency - i, i - j, j], axis=1) / frequency
    points = np.einsum("pc,fcx->fpx", weights, corners[faces])

    # The small triangles of one face, those that point as the face does and those between them.
    row = i * (i + 1) // 2
    upright = np.stack([row + j, row + j + i + 1, row + j + i + 2], axis=1)[i < frequency]
    between = np.stack([row + j, row + j + i + 2, row + j + 1], axis=1)[(i < frequency) & (j < i)]
    pattern = np.concatenate([upright, between])
    triangles = np.arange(len(faces))[:, None, None] * len(weights) + pattern

    # Weld what neighbouring faces share: equal points differ by rounding only, others by 1/frequency.
    lattice = np.rint(points.reshape(-1, 3) * 2**16).astype(np.int64) + 2**20
    key = (lattice[:, 0] << 42) | (lattice[:, 1] << 21) | lattice[:, 2]
    _, first, welded = np.unique(key, return_index=True, return_inverse=True)
    vertices = points.reshape(-1, 3)[first]
    if len(vertices) != 10 * frequency**2 + 2:
        raise AssertionError("the seams of the sphere were not welded")
    return vertices / np.linalg.norm(vertices, axis=1, keepdims=True), welded[triangles].reshape(-1, 3)


def displacement(p: Floats) -> Floats:
    """Return the relative height at unit vectors `p`: warped ridges over slow swells."""
    x, y, z = p.T
    u = x + 0.22 * np.sin(3 * y + 1) + 0.10 * np.sin(7 * z)
    v = y + 0.22 * np.sin(3 * z + 2) + 0.10 * np.sin(7 * x)
    w = z + 0.22 * np.sin(3 * x + 4) + 0.10 * np.sin(7 * y)
    swell = 0.06 * np.sin(2 * u + 1) * np.sin(3 * v) * np.sin(2 * w + 2)
    height = swell

    # Each octave turns the axes a little, so that the ridges of one do not follow those of the other.
    for octave in range(5):
        scale = 4.0 * 1.9**octave
        wave = np.sin(scale * u + octave) + np.sin(scale * v + 2 * octave) + np.sin(scale * w + 3 * octave)
        height = height + 0.10 * 0.52**octave * (1 - np.abs(wave) / 1.5)
        u, v = 0.8 * u + 0.6 * v, -0.6 * u + 0.8 * v
        v, w = 0.8 * v + 0.6 * w, -0.6 * v + 0.8 * w
    return height


def write_mesh(path: str | Path) -> None:
    """Write the mesh to `path` as binary PLY: float32 vertices, int32 faces."""
    unit, faces = geodesic_sphere(FREQUENCY)
    vertices = (RADIUS * unit * (1 + displacement(unit))[:, None]).astype("<f4")
    records = np.empty(len(faces), dtype=[("count", "u1"), ("indices", "<i4", 3)])
    records["count"] = 3
    records["indices"] = faces

    header = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(vertices)}\nproperty float x\nproperty float y\nproperty float z\n"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as file:
        file.write(header.encode("ascii"))
        file.write(vertices.tobytes())
        file.write(records.tobytes())


def main() -> None:
    """Write the mesh to the path given, or where the scene looks for it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    default = Path(__file__).resolve().parent.parent / "generated" / "million.ply"
    parser.add_argument("out", nargs="?", type=Path, default=default, help="default: scenes/generated/million.ply")
    write_mesh(parser.parse_args().out)


if __name__ == "__main__":
    main()
