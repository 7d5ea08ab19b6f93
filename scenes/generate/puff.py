"""Write ``scenes/kinds/media/puff.npy``: the densities of a puff of smoke, in a grid of 32 x 24 x 20.

    python scenes/generate/puff.py [OUT.npy]

Blobs of random places and sizes, added up and cut off below; a second run writes the same bytes.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

SIZE = (32, 24, 20)
BLOBS = 60
SEED = 5


def densities() -> NDArray[np.float16]:
    """Return the densities by x, y and z, from 0 to 1."""
    random = np.random.default_rng(SEED)
    axes = [(np.arange(count) + 0.5) / count * 2.0 - 1.0 for count in SIZE]
    x, y, z = np.meshgrid(*axes, indexing="ij")
    total = np.zeros(SIZE)
    for _ in range(BLOBS):
        middle = random.normal(0.0, (0.35, 0.28, 0.28))
        size = random.uniform(0.1, 0.28)
        square = (x - middle[0]) ** 2 + (y - middle[1]) ** 2 + (z - middle[2]) ** 2
        total += np.exp(-0.5 * square / size**2)
    edge = np.clip(1.2 - np.sqrt(x**2 + y**2 + z**2), 0.0, 0.3) / 0.3
    # Sixteen bits are plenty, and whole 256ths are the same on every machine.
    return (np.round(np.clip((total - 1.0) / 6.0, 0.0, 1.0) * edge * 256.0) / 256.0).astype(np.float16)


def main() -> None:
    """Write the file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", nargs="?", type=Path, default=Path("scenes/kinds/media/puff.npy"))
    np.save(parser.parse_args().out, densities())


if __name__ == "__main__":
    main()
