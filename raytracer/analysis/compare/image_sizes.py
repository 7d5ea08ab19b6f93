"""Check of the sizes of two images."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.util.errors import InputError


def check_sizes(a: NDArray[np.floating[Any]], b: NDArray[np.floating[Any]]) -> None:
    """Check that two arrays are images (height, width, 3) of one size.

    Raises
    ------
    InputError : they are not.
    """
    if a.ndim != 3 or a.shape[2] != 3 or a.size == 0:
        raise InputError(f"an image has the shape (height, width, 3), got {a.shape}")
    if a.shape != b.shape:
        raise InputError(
            f"the images differ in size: {a.shape[1]} x {a.shape[0]} and {b.shape[1]} x {b.shape[0]} pixels"
        )
