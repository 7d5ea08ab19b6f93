"""Lens files that tests write."""

from pathlib import Path

ROUND_SIDE, INDEX = 50.0, 1.5

THIN = """\
  - {{type: spherical, radius: {radius!r}, thickness: 1.0e-6, material: 1.5, aperture: {aperture!r}}}
  - {{type: spherical, radius: {opposite!r}, aperture: {aperture!r}}}
"""

PLANO_CONVEX = f"""\
  - {{type: flat, thickness: 5, material: {INDEX}, aperture: 25}}
  - {{type: spherical, radius: {-ROUND_SIDE}, aperture: 25}}
"""


def written(folder: Path, surfaces: str, name: str = "lens", more: str = "") -> Path:
    """A lens file of surfaces, a line each, and further keys."""
    path = folder / f"{name}.yaml"
    path.write_text(f"name: {name}\n{more}surfaces:\n{surfaces}", encoding="utf-8")
    return path


def thin(folder: Path, focal_length: float, aperture: float, name: str = "thin") -> Path:
    """A biconvex lens without a thickness, of index 1.5: 1/f = (n - 1) 2 / R, so R = f."""
    return written(folder, THIN.format(radius=focal_length, opposite=-focal_length, aperture=aperture), name)
