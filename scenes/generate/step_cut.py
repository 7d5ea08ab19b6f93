"""Write ``scenes/showcase/step_cut.ply``: a stone in the cut of emeralds, with its table up and its girdle at y = 0.

In metres, 8 mm wide (x) and 11 mm long (z), with a crown and a pavilion of three steps each, and a thin girdle; a
second run writes the same bytes:

    python scenes/generate/step_cut.py [OUT.ply]
"""

from __future__ import annotations

import argparse
import importlib.util
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

FOLDER = Path(__file__).parent

HALF_WIDTH = 4e-3

# In units of half the width: how far the eight sides are from the axis, long ones, short ones and cut corners.
SIDES = {0: 1.0, 45: 1.42, 90: 1.38, 135: 1.42, 180: 1.0, 225: 1.42, 270: 1.38, 315: 1.42}
GIRDLE = 0.06
CROWN = ((46.0, 0.0), (38.0, 0.15), (28.0, 0.3))
"""Slopes of the steps (deg), and how far inside of the girdle each begins."""

PAVILION = ((52.0, 0.0), (45.0, 0.3), (38.0, 0.6))
TABLE = 0.45


def planes() -> NDArray[np.float64]:
    """Return rows (normal, offset) of the half-spaces, normal . x + offset <= 0, in units of half the width."""

    def steps(parts: tuple[tuple[float, float], ...], start: float) -> list[list[float]]:
        """Facets that fall from the axis, step by step, from the girdle at a height `start`."""
        rows, height, begun, before = [], start, 0.0, 0.0
        for slope, inset in parts:
            height += np.tan(np.radians(before)) * (inset - begun)
            begun, before = inset, slope
            sine, cosine = np.sin(np.radians(slope)), np.cos(np.radians(slope))
            for side, reach in SIDES.items():
                x, z = np.cos(np.radians(side)), np.sin(np.radians(side))
                rows.append([sine * x, cosine, sine * z, -(sine * (reach - inset) + cosine * height)])
        return rows

    height = 0.0
    for (slope, inset), following in zip(CROWN, [*(part[1] for part in CROWN[1:]), TABLE], strict=True):
        height += np.tan(np.radians(slope)) * (following - inset)
    rows = [[0.0, 1.0, 0.0, -height], *steps(CROWN, 0.0)]
    rows += [[np.cos(np.radians(side)), 0.0, np.sin(np.radians(side)), -reach] for side, reach in SIDES.items()]
    # Facets of the pavilion look down.
    return np.array(rows + [[x, -y, z, d] for x, y, z, d in steps(PAVILION, GIRDLE)])


def ply() -> bytes:
    """Return the mesh as a binary PLY file, made as the brilliant of `diamond.py` is."""
    spec = importlib.util.spec_from_file_location("diamond", FOLDER / "diamond.py")
    assert spec is not None
    assert spec.loader is not None
    diamond = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(diamond)
    return bytes(diamond.ply(planes(), HALF_WIDTH))


def main() -> None:
    """Write the mesh to the path given, or beside the scene that shows it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    default = FOLDER.parent / "showcase" / "step_cut.ply"
    parser.add_argument("out", nargs="?", type=Path, default=default, help="default: scenes/showcase/step_cut.ply")
    parser.parse_args().out.write_bytes(ply())


if __name__ == "__main__":
    main()
