"""The film: running statistics of the samples of each pixel while an image is rendered."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raytracer.film.image import Image


@dataclass(frozen=True)
class Film:
    """Running statistics of every pixel, allocated once and filled in place.

    Attributes
    ----------
    mean : float64 (height, width, 3), mean of the samples.
    m2 : float64 (height, width, 3), sum of the squared differences of the samples from their mean.
    count : int64 (height, width), samples in the mean.
    nan_count : int64 (height, width), samples left out because they were not finite.
    removed : float64 (height, width, 4), the radiance that a clamp has removed, summed by channel, and from how many
        samples; None where no sample is clamped.

    References: Welford 1962, "Note on a Method for Calculating Corrected Sums of Squares and Products",
        Technometrics 4(3); it is stable where E[x^2] - E[x]^2 cancels.
    """

    mean: NDArray[np.float64]
    m2: NDArray[np.float64]
    count: NDArray[np.int64]
    nan_count: NDArray[np.int64]
    removed: NDArray[np.float64] | None = None

    @classmethod
    def empty(cls, width: int, height: int, *, is_clamped: bool = False) -> "Film":
        """Allocate a film of `width` by `height` pixels without a sample."""
        return cls(
            mean=np.zeros((height, width, 3)),
            m2=np.zeros((height, width, 3)),
            count=np.zeros((height, width), dtype=np.int64),
            nan_count=np.zeros((height, width), dtype=np.int64),
            removed=np.zeros((height, width, 4)) if is_clamped else None,
        )

    def variance_of_mean(self) -> NDArray[np.float64]:
        """Compute the unbiased variance of the mean, m2 / (n (n - 1)), float64 (height, width, 3); inf for n < 2.

        It holds for independent samples; stratified and low-discrepancy ones have less.
        """
        n = self.count[..., None].astype(np.float64)
        variance = np.full(self.mean.shape, np.inf)
        np.divide(self.m2, n * (n - 1.0), out=variance, where=n > 1.0)
        return variance


def develop(film: Film, settings: Mapping[str, str | float | int], *, is_final: bool = False) -> Image:
    """Make the image on `film`; a pixel without a sample is black.

    `samples` is that of the pixel with the most; the variance is None if no pixel has two.

    is_final : whether nothing will be added to the film, so that the image may share its memory.
    """
    samples = int(film.count.max())
    variance = film.variance_of_mean() if samples > 1 else None
    return Image(film.mean if is_final else film.mean.copy(), variance, samples, dict(settings))
