"""Write ``scenes/lecture/coded_mask.png``, the mask of a camera without a lens.

It is a modified uniformly redundant array: half of its squares are open, and its autocorrelation, repeated, is one peak
on an even ground, so that what it mixed on a sensor can be told apart again.  Gottesman and Fenimore 1989, "New family
of binary arrays for coded aperture imaging", Applied Optics 28(20), section II.

    python scenes/generate/coded_mask.py [FILE]
"""

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

SIDE = 31
"""Squares on an edge: a prime."""


def coded_mask(side: int = SIDE) -> NDArray[np.bool_]:
    """Return which squares of a mask are open (side, side), for a prime side."""
    squares = {k * k % side for k in range(1, side)}
    sign = np.array([1 if k in squares else -1 for k in range(side)])
    is_open = sign[:, None] * sign[None, :] == 1
    is_open[:, 0], is_open[0, :] = True, False
    return is_open


def main() -> None:
    """Write the mask, to the scenes of the lecture or to the file given."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    default = Path(__file__).resolve().parent.parent / "lecture" / "coded_mask.png"
    parser.add_argument("file", nargs="?", type=Path, default=default, help="default: scenes/lecture/coded_mask.png")
    Image.fromarray(coded_mask()).save(parser.parse_args().file)


if __name__ == "__main__":
    main()
