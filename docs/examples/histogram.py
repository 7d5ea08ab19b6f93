"""`rt histogram`: a command as an exercise, complete in one file.

To try it, put this file into `raytracer/cli/`: `rt histogram outputs/cover.exr` prints a bar for each stop of
luminance, and `rt --help` lists the command.  Nothing else changes: commands are found by looking into that package, by
functions that are called as their files are.
"""

import math
from pathlib import Path
from typing import Annotated

import typer

from raytracer.util.errors import InputError

# Shown below the options by `rt histogram --help`; \b keeps the lines as they are.
EXAMPLE = """\b
Examples:
  rt histogram outputs/cover.exr
  rt histogram outputs/cover.png --width 40
"""


def histogram(
    image: Annotated[Path, typer.Argument(metavar="IMAGE", help="Image: .png .jpg .exr .hdr .npy.")],
    width: Annotated[int, typer.Option(help="Characters of the longest bar.", min=1, max=200)] = 60,
) -> None:
    """Print how many pixels of an image have which luminance, in stops below and above 1."""
    # Imported when the command runs, so that `rt --help` answers at once.
    import numpy as np

    from raytracer.film import load
    from raytracer.film.exposure import luminance

    # Linear values; a file that is missing or broken is an InputError, of which `rt` makes one line and exit status 2.
    values = luminance(load(image))
    lit = values[np.isfinite(values) & (values > 0.0)]
    if lit.size == 0:
        raise InputError(f"{image}: is black, and has no histogram")
    stops = np.floor(np.log2(lit)).astype(int)
    counts = np.bincount(stops - stops.min())
    for stop, count in enumerate(counts, stops.min()):
        bar = "#" * math.ceil(width * count / counts.max())
        print(f"{stop:+4d} EV  {100.0 * count / values.size:5.1f} %  {bar}".rstrip())
    # Black, or not finite.
    if lit.size < values.size:
        print(f"{'others':>7}  {100.0 - 100.0 * lit.size / values.size:5.1f} %")
