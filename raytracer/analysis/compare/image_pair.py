"""Two images with the variances of their pixels, their difference, and parallel work on both by bands of rows."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raytracer.util.errors import InputError

Array = NDArray[np.float64]
T = TypeVar("T")

# Rows of 4K images whose intermediate results stay in the processor's caches.
ROWS = 64

ROUNDING = 1e-6
"""Largest relative difference that counts as rounding: hits found in float32 (2^-24), added up over a path."""


class ImagePair(NamedTuple):
    """Two images, or means over equal parts of them, with the variances of both.

    a, b : (..., 3), mean radiances.
    var_a, var_b : (..., 3), variances of these means.
    """

    a: Array
    var_a: Array
    b: Array
    var_b: Array

    def rows(self, top: int, bottom: int) -> "ImagePair":
        """Take the rows top..bottom-1 of all arrays."""
        return ImagePair(*(values[top:bottom] for values in self))

    def means(self, cells: Array | int) -> "ImagePair":
        """Turn sums over parts into means over them; `cells` is the number of values of each."""
        return ImagePair(self.a / cells, self.var_a / cells**2, self.b / cells, self.var_b / cells**2)

    def ratio(self) -> float:
        """Estimate how many times that of b the variance of a is, in the median part; 0 if one is without noise.

        Not that of the totals, which one bright rare sample is enough to decide.
        """
        known = (self.var_a > 0.0) & (self.var_b > 0.0)
        return float(np.median(self.var_a[known] / self.var_b[known])) if known.any() else 0.0

    def variance_of_difference(self, ratio: float) -> Array:
        """Estimate the variance of a - b, under the hypothesis that both are of one scene.

        It is var_a + var_b, but a pixel in which rare bright samples have not turned up yet has too small a variance.
        If b has r times as many samples, its variance tells what that of a should be, and vice versa: the pooled
        estimate of Student's two-sample test is var_a / r + r var_b.  The larger one is taken, with r = `ratio`.
        """
        summed = self.var_a + self.var_b
        if ratio == 0.0:
            return summed
        return np.maximum(summed, self.var_a / ratio + self.var_b * ratio)

    def difference(self) -> Array:
        """Subtract b from a, with 0 where they agree to `ROUNDING`."""
        difference = self.a - self.b
        scale = np.maximum(np.abs(self.a), np.abs(self.b))
        return np.copysign(np.maximum(np.abs(difference) - ROUNDING * scale, 0.0), difference)

    def z(self, variance: Array) -> Array:
        """Express the difference in standard deviations: 0 if it is but rounding, inf if it is not a number."""
        difference = self.difference()
        beyond = np.abs(difference)
        z = np.divide(beyond, np.sqrt(variance), out=np.where(beyond > 0.0, np.inf, 0.0), where=variance > 0.0)
        return np.copysign(np.where(np.isfinite(self.a - self.b), z, np.inf), difference)


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


def make_image_pair(a: ArrayLike, var_a: ArrayLike | None, b: ArrayLike, var_b: ArrayLike | None) -> ImagePair:
    """Check and convert two images (height, width, 3) and their variances, None for one without noise.

    Raises
    ------
    InputError : the shapes differ, or a variance is negative or not finite.
    """
    first, second = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    check_sizes(first, second)
    variances = []
    for image, given in ((first, var_a), (second, var_b)):
        variance = np.zeros_like(image) if given is None else np.asarray(given, dtype=np.float64)
        if variance.shape != image.shape:
            raise InputError(f"a variance of the shape {variance.shape} for an image of the shape {image.shape}")
        if not np.all(np.isfinite(variance) & (variance >= 0.0)):
            raise InputError("a variance is not known everywhere: it takes two samples in every pixel")
        variances.append(variance)
    return ImagePair(first, variances[0], second, variances[1])


def tile_sums(values: Array, tile: int) -> Array:
    """Sum `values` (height, width, ...) over squares of `tile` pixels; those at the edges may be smaller."""
    # Here, since threads do not take over what their caller ignores.
    with np.errstate(invalid="ignore", over="ignore"):
        rows = np.add.reduceat(values, np.arange(0, values.shape[0], tile), axis=0)
        return np.add.reduceat(rows, np.arange(0, values.shape[1], tile), axis=1)


def map_row_bands(work: Callable[[int, int], T], height: int, rows: int = ROWS) -> list[T]:
    """Call `work(top, bottom)` for all bands of `rows` rows; the bands are the same for any number of threads."""
    tops = range(0, height, rows)
    if len(tops) == 1:
        return [work(0, height)]
    with ThreadPoolExecutor(min(len(tops), os.cpu_count() or 1)) as threads:
        return list(threads.map(lambda top: work(top, min(top + rows, height)), tops))
