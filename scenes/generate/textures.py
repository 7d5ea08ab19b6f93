"""Write the pictures of ``scenes/textures.yaml``: a globe, and the colours and normals of a brick wall.

    python scenes/generate/textures.py [FOLDER]

They are in the repository, since they are small: together less than 50 kB.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import PIL.Image
from numpy.typing import NDArray

Array = NDArray[np.float64]

HEIGHT = 192  # pixels from pole to pole

# Deep and shallow sea, shore, grass, wood, rock, snow: a picture of few colours makes a small file.
PALETTE = ((18, 46, 92), (32, 84, 140), (214, 196, 140), (104, 142, 62), (52, 98, 48), (128, 110, 92), (236, 238, 240))
LEVELS = (-0.25, 0.0, 0.05, 0.4, 0.8, 1.2)
GRID = (250, 214, 90)

BRICK = 128  # pixels of a picture that holds two courses of bricks, and repeats
MORTAR = 5
BEVEL = 4


def globe() -> PIL.Image.Image:
    """Return continents in longitude and latitude, with a line every 30 degrees."""
    latitude = np.radians(90.0 - (np.arange(HEIGHT) + 0.5) * 180.0 / HEIGHT)[:, None]
    longitude = np.radians((np.arange(2 * HEIGHT) + 0.5) * 180.0 / HEIGHT - 180.0)[None, :]
    place = np.stack(
        [np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude) + 0.0 * longitude]
    )

    # Waves in random directions over the sphere: no seam, and no poles.
    random = np.random.default_rng(7)
    height = np.zeros(place.shape[1:])
    for octave in range(5):
        for _ in range(10):
            wave = random.normal(size=3)
            wave *= 2.2 * 1.9**octave / np.linalg.norm(wave)
            height += 0.6**octave * 0.33 * np.sin(np.tensordot(wave, place, 1) + random.uniform(0.0, 2.0 * np.pi))
    height = np.where(np.abs(np.sin(latitude)) > 0.95, 2.0, height - 0.05)
    index = np.searchsorted(LEVELS, height).astype(np.uint8)
    lines = HEIGHT // 6
    index[lines - 1 :: lines] = index[:, lines - 1 :: lines] = len(PALETTE)
    picture = PIL.Image.fromarray(index)
    picture.putpalette([channel for color in (*PALETTE, GRID) for channel in color])
    return picture


def bricks() -> tuple[PIL.Image.Image, PIL.Image.Image]:
    """Return the colours and the normals of two courses of bricks."""
    x, y = np.meshgrid(np.arange(BRICK), np.arange(BRICK))
    course = y // (BRICK // 2)
    along = (x + course * BRICK // 4) % (BRICK // 2)
    across = y % (BRICK // 2)
    edge = np.minimum.reduce([along, BRICK // 2 - 1 - along, across, BRICK // 2 - 1 - across])
    height = np.clip((edge - MORTAR / 2) / BEVEL, 0.0, 1.0)
    height = height * height * (3.0 - 2.0 * height) * BEVEL

    # Slopes by central differences over the repeated picture; rows run down and v runs up.
    slope_u = (np.roll(height, -1, 1) - np.roll(height, 1, 1)) / 2.0
    slope_v = (np.roll(height, 1, 0) - np.roll(height, -1, 0)) / 2.0
    normal = np.stack([-slope_u, -slope_v, np.ones_like(height)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)

    which = 2 * course + (x + course * BRICK // 4) // (BRICK // 2) % 2
    clay = np.array([(150, 70, 48), (170, 88, 60), (136, 62, 46), (160, 80, 66)])[which]
    mortar = np.array((176, 168, 158))
    color = np.where((edge < MORTAR / 2)[..., None], mortar, clay)
    return PIL.Image.fromarray(color.astype(np.uint8)), PIL.Image.fromarray(
        np.rint(127.5 * (normal + 1.0)).astype(np.uint8)
    )


def main() -> None:
    """Write the three pictures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?", default=Path(__file__).parents[1] / "textures")
    folder: Path = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    colors, normals = bricks()
    for name, picture in (("globe", globe()), ("bricks", colors), ("bricks_normal", normals)):
        picture.save(folder / f"{name}.png", optimize=True)


if __name__ == "__main__":
    main()
