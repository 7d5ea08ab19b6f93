"""Write ``scenes/generated/umbrella_cloth.ply`` and ``umbrella_frame.ply``: an open umbrella, its tip up along +y.

In metres, 96 cm wide, with the rim at y = 0 and the handle's end at y = -0.6; a second run writes the same bytes:

    python scenes/generate/umbrella.py [FOLDER]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

FOLDER = Path(__file__).parents[1] / "generated"

RIBS = 8
RADIUS, HEIGHT = 0.48, 0.26
ACROSS, ALONG = 12, 20
"""Quads of the cloth between two ribs, and from the tip to the rim."""

SCALLOP, SAG = 0.09, 0.035
"""How far the rim recedes half-way between ribs, as a fraction of its radius, and how far the cloth sags there (m)."""

Floats = NDArray[np.float64]


def rib(along: Floats) -> tuple[Floats, Floats]:
    """Return distances from the axis and heights of a rib, from the tip (0) to the rim (1)."""
    angle = 0.5 * np.pi * along
    return RADIUS * np.sin(angle) ** 0.97, HEIGHT * np.cos(angle) ** 0.9


def cloth() -> trimesh.Trimesh:
    """Return the cloth, taut between its ribs."""
    along = np.linspace(0.0, 1.0, ALONG + 1)[:, None]
    turn = np.arange(RIBS * ACROSS)[None, :] / ACROSS
    middle = np.sin(np.pi * (turn % 1.0)) ** 0.8
    distance, height = rib(along)
    distance = distance * (1.0 - SCALLOP * middle * along**2)
    # Up to the last third cloth between ribs lies lower than they do; at the rim it is pulled up.
    height = height - SAG * middle * np.sin(np.pi * along) * along + 0.04 * middle * along**6
    angle = 2.0 * np.pi * turn / RIBS
    points = np.stack([distance * np.cos(angle), height + 0.0 * angle, distance * np.sin(angle)], axis=-1)
    columns = RIBS * ACROSS
    index = np.arange((ALONG + 1) * columns).reshape(ALONG + 1, columns)
    a, b = index[:-1], index[1:]
    c, d = np.roll(b, -1, axis=1), np.roll(a, -1, axis=1)
    # At the tip all columns meet, and of each quad one triangle is left.
    faces = [np.stack([a, d, c], axis=-1)[1:].reshape(-1, 3), np.stack([a, c, b], axis=-1).reshape(-1, 3)]
    return trimesh.Trimesh(points.reshape(-1, 3), np.concatenate(faces), process=False)


def rod(points: Floats, radius: float) -> list[trimesh.Trimesh]:
    """Return cylinders that join these points (n, 3), with balls at the joints."""
    parts = [
        trimesh.creation.cylinder(radius, segment=pair, sections=12) for pair in np.stack([points[:-1], points[1:]], 1)
    ]
    for point in points:
        ball = trimesh.creation.icosphere(subdivisions=1, radius=radius)
        parts.append(ball.apply_translation(point))
    return parts


def frame() -> trimesh.Trimesh:
    """Return the tip, the stick with its crook, and the ribs."""
    bend = np.linspace(0.0, np.pi, 10)
    crook = np.stack([0.05 - 0.05 * np.cos(bend), -0.55 - 0.05 * np.sin(bend), 0.0 * bend], axis=-1)
    parts = rod(np.array([[0.0, HEIGHT + 0.06, 0.0], [0.0, -0.4, 0.0]]), 0.005)
    parts += rod(np.vstack([[0.0, -0.38, 0.0], crook]), 0.011)
    along = np.linspace(0.05, 1.02, 9)
    distance, height = rib(np.minimum(along, 1.0))
    distance = distance + RADIUS * np.maximum(along - 1.0, 0.0)
    for angle in 2.0 * np.pi * np.arange(RIBS) / RIBS:
        parts += rod(np.stack([distance * np.cos(angle), height - 0.012, distance * np.sin(angle)], axis=-1), 0.0025)
        stretcher = np.array([[0.0, -0.02, 0.0], [0.62 * RADIUS * np.cos(angle), 0.15, 0.62 * RADIUS * np.sin(angle)]])
        parts += rod(stretcher, 0.002)
    return trimesh.util.concatenate(parts)


def main() -> None:
    """Write the meshes to the folder given, or to that of files which are not in the repository."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path, default=FOLDER, help="default: scenes/generated")
    folder = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    for name, mesh in (("umbrella_frame", frame()), ("umbrella_cloth", cloth())):
        (folder / f"{name}.ply").write_bytes(trimesh.exchange.ply.export_ply(mesh, vertex_normal=False))
        print(f"{folder / name}.ply: {len(mesh.faces):,} triangles")


if __name__ == "__main__":
    main()
