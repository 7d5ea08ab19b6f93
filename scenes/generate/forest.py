"""Write what `scenes/instances.yaml` is made of: one tree, hills, and 10,000 places on them for trees.

    python scenes/generate/forest.py [FOLDER]

The tree is a mesh of 100,000 triangles of leaves, two a leaf, on wood of some 38,000 more. The places are in three
files, one for each colour of leaves. All chance comes from a generator of a fixed seed.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

LEAVES = 50_000
TREES = 10_000
FIELD = 260.0  # metres, the edge of the wooded square
TERRAIN = 640.0  # metres, the edge of the hills
GRID = 160  # squares of the hills along an edge
SPACING = 1.7  # metres between trees, at least
GLADE = np.array([0.0, 118.0, 9.0])  # x, z and radius of a place without trees, where the camera is
COLOURS = ("green", "gold", "russet")

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Shoots(NamedTuple):
    """Shoots of one level: starts and unit directions (n, 3), lengths and radii at the start (n,)."""

    start: Floats
    direction: Floats
    length: Floats
    radius: Floats


def unit(vectors: Floats) -> Floats:
    """Return the vectors (n, 3) at length 1."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def directions(random: np.random.Generator, count: int) -> Floats:
    """Return unit vectors (count, 3), uniform over the sphere."""
    z, turn = 2.0 * random.random(count) - 1.0, 2.0 * np.pi * random.random(count)
    ring = np.sqrt(1.0 - z * z)
    return np.stack([ring * np.cos(turn), z, ring * np.sin(turn)], axis=1)


def paths(random: np.random.Generator, shoots: Shoots, segments: int, wander: float, rise: float) -> Floats:
    """Return the points (n, segments + 1, 3) along shoots that wander by chance and turn upwards."""
    points = np.empty((len(shoots.start), segments + 1, 3))
    points[:, 0], heading = shoots.start, shoots.direction
    for step in range(segments):
        points[:, step + 1] = points[:, step] + heading * (shoots.length / segments)[:, None]
        heading = unit(heading + wander * directions(random, len(heading)) + [0.0, rise, 0.0])
    return points


def branch_off(random: np.random.Generator, stems: Floats, radius: Floats, count: int, reach: Floats) -> Shoots:
    """Return `count` shoots from each stem (n, points, 3): spread along it and around it, reach (n,) long at most."""
    n, points = stems.shape[:2]
    at = (0.28 + 0.72 * (np.arange(count) + random.random((n, count))) / count) * (points - 1)
    first = np.minimum(at.astype(np.int64), points - 2)
    along = np.arange(n)[:, None]
    a, b = stems[along, first], stems[along, first + 1]
    start = a + (at - first)[..., None] * (b - a)
    axis = unit(b - a)

    # A golden angle from one to the next leaves no side bare.
    turn = 2.399963 * np.arange(count) + 2.0 * np.pi * random.random((n, 1))
    side = unit(np.cross(axis, np.broadcast_to([0.31, 0.17, 0.94], axis.shape)))
    out = np.cos(turn)[..., None] * side + np.sin(turn)[..., None] * np.cross(axis, side)
    spread = np.radians(48.0 + 24.0 * random.random((n, count)))[..., None]
    place = at / (points - 1)
    length = reach[:, None] * (1.1 - 0.75 * place) * (0.8 + 0.4 * random.random((n, count)))
    thickness = np.minimum(0.5 * radius[:, None] * (1.1 - place), 0.03 * length)
    return Shoots(
        start.reshape(-1, 3),
        unit(np.cos(spread) * axis + np.sin(spread) * out).reshape(-1, 3),
        length.ravel(),
        thickness.ravel(),
    )


def tubes(points: Floats, radius: Floats, sides: int) -> tuple[Floats, Ints]:
    """Return vertices and faces of tubes along points (n, m, 3), thinning out towards their ends."""
    n, m = points.shape[:2]
    axis = unit(np.gradient(points, axis=1))
    s = unit(np.cross(axis, np.broadcast_to([0.31, 0.17, 0.94], axis.shape)))
    t = np.cross(axis, s)
    turn = 2.0 * np.pi * np.arange(sides) / sides
    ring = np.cos(turn)[:, None] * s[:, :, None] + np.sin(turn)[:, None] * t[:, :, None]
    thickness = radius[:, None] * (1.0 - 0.85 * np.arange(m) / (m - 1))
    vertices = points[:, :, None] + thickness[:, :, None, None] * ring

    tube, step, side = np.meshgrid(np.arange(n), np.arange(m - 1), np.arange(sides), indexing="ij")
    corner = (tube * m + step) * sides
    a, b = corner + side, corner + (side + 1) % sides
    faces = np.stack([np.stack([a, b, b + sides], -1), np.stack([a, b + sides, a + sides], -1)], axis=-2)
    return vertices.reshape(-1, 3), faces.reshape(-1, 3)


def leaves_on(random: np.random.Generator, twigs: Floats) -> tuple[Floats, Ints]:
    """Return LEAVES leaves along twigs (n, m, 3), each of two triangles folded along its rib."""
    n, m = twigs.shape[:2]
    twig = np.arange(LEAVES) % n
    at = random.random(LEAVES) * (m - 1)
    first = np.minimum(at.astype(np.int64), m - 2)
    a, b = twigs[twig, first], twigs[twig, first + 1]
    base = a + (at - first)[:, None] * (b - a) + 0.03 * directions(random, LEAVES)
    rib = unit(unit(b - a) + 1.2 * directions(random, LEAVES) + [0.0, -0.35, 0.0])
    size = 0.11 * (0.7 + 0.6 * random.random(LEAVES))[:, None]
    face = unit(directions(random, LEAVES) + np.array([0.0, 1.3, 0.0]))
    across = unit(np.cross(rib, face))
    up = np.cross(across, rib)
    middle = base + 0.45 * size * rib + 0.08 * size * up
    vertices = np.stack(
        [base, base + size * rib, middle + 0.3 * size * across, middle - 0.3 * size * across], axis=1
    ).reshape(-1, 3)
    corner = 4 * np.arange(LEAVES)[:, None]
    return vertices, np.concatenate([corner + np.array([0, 2, 1]), corner + np.array([0, 1, 3])], axis=1).reshape(-1, 3)


def tree(random: np.random.Generator) -> tuple[tuple[Floats, Ints], tuple[Floats, Ints]]:
    """Return the meshes (vertices, faces) of the wood and of the leaves of a tree seven metres high."""
    trunk = Shoots(np.zeros((1, 3)), np.array([[0.0, 1.0, 0.0]]), np.array([5.6]), np.array([0.19]))
    stem = paths(random, trunk, 12, 0.05, 0.1)
    boughs = branch_off(random, stem, trunk.radius, 26, np.array([2.7]))
    bough_paths = paths(random, boughs, 7, 0.12, 0.08)
    branches = branch_off(random, bough_paths, boughs.radius, 9, 0.52 * boughs.length)
    branch_paths = paths(random, branches, 4, 0.16, 0.05)
    twigs = branch_off(random, branch_paths, branches.radius, 6, 0.6 * branches.length)
    twig_paths = paths(random, twigs, 3, 0.2, 0.0)
    parts = [
        tubes(stem, trunk.radius, 16),
        tubes(bough_paths, boughs.radius, 8),
        tubes(branch_paths, branches.radius, 5),
        tubes(twig_paths, twigs.radius, 3),
    ]
    firsts = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
    wood = (
        np.concatenate([vertices for vertices, _ in parts]),
        np.concatenate([faces + first for (_, faces), first in zip(parts, firsts, strict=False)]),
    )
    return wood, leaves_on(random, twig_paths)


def height(x: Floats, z: Floats) -> Floats:
    """Return the height of the hills (m)."""
    slow = 7.0 * np.sin(0.021 * x + 0.4) * np.cos(0.017 * z) + 4.0 * np.sin(0.034 * (x + 0.7 * z) + 1.0)
    away = np.hypot(x, z - GLADE[1])
    return slow * (1.0 - np.exp(-((away / 45.0) ** 2))) + 22.0 * np.clip((60.0 - z) / 300.0, 0.0, None) ** 1.5


def hills() -> tuple[Floats, Ints]:
    """Return vertices and faces of the hills."""
    axis = np.linspace(-0.5 * TERRAIN, 0.5 * TERRAIN, GRID + 1)
    x, z = np.meshgrid(axis, axis, indexing="ij")
    vertices = np.stack([x, height(x, z), z], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(GRID), np.arange(GRID), indexing="ij")
    a = i * (GRID + 1) + j
    b, c, d = a + 1, a + GRID + 2, a + GRID + 1
    return vertices, np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], axis=-2).reshape(-1, 3)


def places(random: np.random.Generator) -> Floats:
    """Return x and z (TREES, 2) of trees: none nearer to another than SPACING, none in the glade."""
    cells: dict[tuple[int, int], list[Floats]] = {}
    found: list[Floats] = []
    while len(found) < TREES:
        for point in FIELD * (random.random((TREES, 2)) - [0.5, 0.5]):
            if np.hypot(*(point - GLADE[:2])) < GLADE[2] or len(found) == TREES:
                continue
            i, j = (int(cell) for cell in np.floor(point / SPACING))
            near = (other for x in (-1, 0, 1) for y in (-1, 0, 1) for other in cells.get((i + x, j + y), ()))
            if all(np.hypot(*(point - other)) >= SPACING for other in near):
                cells.setdefault((i, j), []).append(point)
                found.append(point)
    return np.array(found)


def placements(random: np.random.Generator) -> tuple[Floats, Ints]:
    """Return the transforms (TREES, 4, 4) of the trees, and the number of each one's colour."""
    x, z = places(random).T
    turn, lean, toward = 2.0 * np.pi * random.random((3, TREES))
    lean *= 0.06 / (2.0 * np.pi)
    size = 0.55 + 0.75 * random.random(TREES)
    slim = size * (0.85 + 0.3 * random.random(TREES))
    spin, tilt = np.tile(np.eye(4), (TREES, 1, 1)), np.tile(np.eye(4), (TREES, 1, 1))
    spin[:, 0, 0], spin[:, 0, 2], spin[:, 2, 0], spin[:, 2, 2] = np.cos(turn), np.sin(turn), -np.sin(turn), np.cos(turn)
    tilt[:, 0, 1], tilt[:, 2, 1] = lean * np.cos(toward), lean * np.sin(toward)
    poses = tilt @ spin * np.stack([slim, size, slim, np.ones(TREES)], axis=1)[:, None, :]
    poses[:, :3, 3] = np.stack([x, height(x, z) - 0.05, z], axis=1)

    # Colours gather in patches.
    patch = np.sin(0.05 * x + 1.0) + np.sin(0.06 * z + 0.03 * x) + 1.5 * random.random(TREES)
    return poses, np.digitize(patch, [1.2, 1.9])


def write_mesh(path: Path, vertices: Floats, faces: Ints) -> None:
    """Write a mesh as binary PLY: float32 vertices, int32 faces."""
    records = np.empty(len(faces), dtype=[("count", "u1"), ("indices", "<i4", 3)])
    records["count"] = 3
    records["indices"] = faces
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(vertices)}\nproperty float x\nproperty float y\nproperty float z\n"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    with path.open("wb") as file:
        file.write(header.encode("ascii"))
        file.write(vertices.astype("<f4").tobytes())
        file.write(records.tobytes())


def write_forest(folder: str | Path) -> None:
    """Write the meshes and the placements to `folder`."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    random = np.random.Generator(np.random.PCG64(20))
    wood, leaves = tree(random)
    write_mesh(folder / "tree_wood.ply", *wood)
    write_mesh(folder / "tree_leaves.ply", *leaves)
    write_mesh(folder / "hills.ply", *hills())
    poses, colour = placements(random)
    for number, name in enumerate(COLOURS):
        np.save(folder / f"forest_{name}.npy", poses[colour == number])


def main() -> None:
    """Write to the folder given, or to where the scene looks."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    default = Path(__file__).resolve().parent.parent / "generated"
    parser.add_argument("folder", nargs="?", type=Path, default=default, help="default: scenes/generated")
    write_forest(parser.parse_args().folder)


if __name__ == "__main__":
    main()
