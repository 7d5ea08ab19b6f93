"""Write what stands on the table of ``scenes/showcase/still_life.yaml`` into ``scenes/generated``: turned shapes.

Each is an outline turned about the y axis, in metres, with u round it and v along it; and the jug's painted glaze.  A
second run writes the same bytes:

    python scenes/generate/still_life.py [FOLDER]
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import PIL.Image
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

FOLDER = Path(__file__).parents[1] / "generated"
SIDES = 96
STEP = 0.002
"""Distance between points of an outline (m)."""

TINY = 1e-6
"""Distance from the axis within which a point is on it (m)."""

Floats = NDArray[np.float64]
Points = Sequence[tuple[float, float]]

# Outlines in centimetres, (distance from the axis, height), from the bottom round to where they end; each is a list of
# curves, between which there are edges.
OUTLINES: dict[str, list[Points]] = {
    "goblet": [
        [(0, 0), (3.4, 0)],
        [(3.4, 0), (3.45, 0.1), (3.3, 0.2), (1.4, 0.5), (0.55, 1.2), (0.4, 3), (0.4, 6), (0.7, 7.6), (2.2, 8.9),
         (3.6, 10.8), (4.05, 13), (3.8, 15.5), (3.3, 18.2), (3.22, 18.3), (3.14, 18.2), (3.64, 15.5), (3.89, 13),
         (3.42, 10.9), (2, 9.2), (0.8, 8.5), (0, 8.4)],
    ],
    "wine": [
        [(0, 8.32), (0.85, 8.42), (2.08, 9.08), (3.5, 10.85), (3.94, 12.4)],
        [(3.94, 12.4), (3.86, 12.36), (3.7, 12.3), (3.4, 12.28), (0, 12.28)],
    ],
    "jug": [
        [(0, 0), (4.4, 0)],
        [(4.4, 0), (4.7, 0.2), (6.4, 3.5), (7.6, 8), (7.4, 11.5), (5.6, 15.5), (3.9, 18.5), (3.4, 21), (4.2, 24),
         (4.9, 25), (4.85, 25.2), (4.6, 25), (3.9, 24), (3.0, 21), (3.5, 18.5), (5.2, 15.5), (7, 11.5), (7, 8), (0, 1)],
    ],
    "bowl": [
        [(0, 0), (4, 0)],
        [(4, 0), (4.2, 0.1), (4.2, 0.7), (5.5, 1.4), (8.6, 3.6), (11, 6.8), (11.1, 7.1), (10.8, 7.1), (8.3, 4.1),
         (5.2, 1.9), (0, 1.4)],
    ],
    "pear": [
        [(0, 0.5), (0.5, 0.3), (1.6, 0), (3.3, 1.2), (3.95, 3.2), (3.6, 5.4), (2.5, 7.4), (1.8, 8.8), (1.3, 9.8),
         (0.6, 10.2), (0, 10)],
    ],
    "apple": [
        [(0, 1), (0.5, 0.6), (1.7, 0), (3.1, 1), (3.9, 3), (3.8, 5), (2.8, 6.5), (1.4, 6.9), (0.5, 6.4), (0, 5.6)],
    ],
    "lemon": [
        [(0, -4.7), (0.45, -4.5), (0.9, -3.9), (2.2, -2.7), (3.0, -1), (3.1, 0.4), (2.6, 2.2), (1.4, 3.6), (0.6, 4.1),
         (0, 4.2)],
    ],
    "candlestick": [
        [(0, 0), (5, 0)],
        [(5, 0), (5.1, 0.4), (4.7, 0.8)],
        [(4.7, 0.8), (3.2, 1.5), (1.6, 2.4), (1.1, 3.4)],
        [(1.1, 3.4), (1.8, 3.9), (1.8, 4.3), (1, 4.9)],
        [(1, 4.9), (0.8, 6), (0.9, 9), (1.3, 11), (0.9, 11.8)],
        [(0.9, 11.8), (1.7, 12.2), (1.7, 12.6), (1.2, 13)],
        [(1.2, 13), (1.3, 14), (1.5, 14.8), (3, 15.2), (3.2, 15.5), (3, 15.7), (1.3, 15.4), (0, 15.4)],
    ],
    "candle": [
        [(0, 15.3), (1.1, 15.3)],
        [(1.1, 15.3), (1.1, 20), (1.08, 25), (0.95, 25.4), (0.7, 25.2), (0, 25)],
    ],
}  # fmt: skip


def curve(points: Points) -> Floats:
    """Return points (n, 2) in metres along a smooth curve through those given in centimetres."""
    corners = 0.01 * np.array(points, dtype=float)
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
    count = max(2, round(way[-1] / STEP) + 1)
    return np.asarray(PchipInterpolator(way, corners)(np.linspace(0.0, way[-1], count)))


def turned(outline: list[Points]) -> str:
    """Return a shape as the text of an OBJ file."""
    lines, rows = [], 0
    reach = sum(np.linalg.norm(np.diff(curve(part), axis=0), axis=1).sum() for part in outline)
    along = 0.0
    for part in outline:
        points = curve(part)
        steps = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
        for (radius, height), v in zip(points, (along + steps) / reach, strict=True):
            for u in np.arange(SIDES + 1) / SIDES:
                angle = 2.0 * np.pi * u
                lines.append(f"v {radius * np.cos(angle):.6f} {height:.6f} {-radius * np.sin(angle):.6f}\n")
                lines.append(f"vt {u:.5f} {v:.5f}\n")
        along += steps[-1]
        for row in range(rows, rows + len(points) - 1):
            for side in range(SIDES):
                a = row * (SIDES + 1) + side + 1
                b, c, d = a + 1, a + SIDES + 2, a + SIDES + 1
                # On the axis, one triangle of each pair has no area.
                if points[row - rows, 0] > TINY:
                    lines.append(f"f {a}/{a} {b}/{b} {c}/{c}\n")
                if points[row + 1 - rows, 0] > TINY:
                    lines.append(f"f {a}/{a} {c}/{c} {d}/{d}\n")
        rows += len(points)
    return "".join(lines)


def glaze(height: int = 512, width: int = 1024) -> PIL.Image.Image:
    """Return blue painting on white, as it goes round the jug: bands, waves and petals."""
    v, u = np.mgrid[height - 0.5 : -0.5 : -1.0, 0.5:width] / np.array([height, width])[:, None, None]
    blue = np.zeros((height, width))

    def band(low: float, high: float, ink: Floats | float = 1.0) -> None:
        """Paint between two heights."""
        np.maximum(blue, np.where((v > low) & (v < high), ink, 0.0), out=blue)

    for low, high in ((0.095, 0.105), (0.11, 0.125), (0.205, 0.212), (0.33, 0.337), (0.455, 0.465), (0.5, 0.53)):
        band(low, high)
    petals = np.abs(np.sin(8.0 * np.pi * u)) ** 0.7
    band(0.125, 0.205, (v - 0.125 < 0.07 * petals) & (v - 0.125 > 0.055 * petals))
    band(0.125, 0.205, 0.6 * (v - 0.125 < 0.04 * petals))
    # Flowers of six petals, and tendrils between them.
    x, y = (8.0 * u) % 1.0 - 0.5, (v - 0.27) * 7.0
    distance, angle = np.hypot(x, y), np.arctan2(y, x)
    rim = 0.34 * (0.55 + 0.45 * np.abs(np.cos(3.0 * angle)))
    band(0.212, 0.33, np.where(distance < rim, np.where(distance > rim - 0.06, 1.0, 0.55 * (distance > 0.08)), 0.0))
    band(0.212, 0.33, np.abs(y - 0.26 * np.sin(2.0 * np.pi * (8.0 * u + 0.25))) < 0.025)
    waves = 0.396 + 0.03 * np.sin(24.0 * np.pi * u)
    band(0.337, 0.455, np.abs(v - waves) < 0.006)
    band(0.337, 0.455, 0.7 * (np.abs(v - waves - 0.022) < 0.003))
    band(0.337, 0.455, 0.7 * (np.abs(v - waves + 0.022) < 0.003))
    white, ink = np.array([0.9, 0.89, 0.85]), np.array([0.1, 0.2, 0.5])
    colour = white + blue[..., None] * (ink - white)
    return PIL.Image.fromarray(np.round(255.0 * colour).astype(np.uint8))


def main() -> None:
    """Write the shapes and the glaze to the folder given, or to that of files which are not in the repository."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path, default=FOLDER, help="default: scenes/generated")
    folder = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    glaze().save(folder / "glaze.png", optimize=True)
    for name, outline in OUTLINES.items():
        (folder / f"{name}.obj").write_text(turned(outline), encoding="ascii", newline="\n")
        print(f"{folder / name}.obj: {(folder / name).with_suffix('.obj').stat().st_size:,} bytes")


if __name__ == "__main__":
    main()
