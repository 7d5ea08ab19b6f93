"""Find fireflies: single pixels that one sample has made far brighter than their neighbours.

Of n samples x of a pixel, (sum x)^2 / sum x^2 = n / (1 + v), where v is their variance over their squared mean, is the
number of equal samples that would be as noisy: n if all are alike, 1 if all light came by one of them.  Since
sum x^2 <= max x * sum x, the largest sample contributed at least one part in that number.  Where that is the part
`MIN_LIGHT_SHARE`, the pixel would be less than a fifth as bright without it.

Edges of lamps have such samples too, and whole areas where light is rare.  A firefly is isolated: its neighbours are as
dark as it would be without the sample, and it exceeds their mean by `MIN_DEVIATIONS` of their standard deviations.
Where a part p of all pixels has met a rare sample, the mean is p V and the deviation sqrt(p (1 - p)) V, so that a
pixel of value V exceeds the mean by sqrt((1 - p) / p) deviations: 5 at one pixel in 26, about one in its own
neighbourhood of 5 x 5.  More of them are noise, which the error measures.  And it is visible: it exceeds them by the
mean of the picture.

References: Kish 1965, "Survey Sampling", sec. 8.2 (effective sample size); Zirr, Hanika, Dachsbacher 2018,
    "Re-Weighting Firefly Samples for Improved Finite-Sample Monte Carlo Estimates", Computer Graphics Forum 37(6),
    which also tests if a bright sample is isolated.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.error_estimate.metric import mean_scale

Array = NDArray[np.float64]

MIN_SAMPLES = 32
"""Samples of a pixel that is tested: among fewer, one may well be the only one that hit a small object."""

MIN_LIGHT_SHARE = 0.8
"""Fraction of a firefly's light that its largest sample contributed, at least."""

MIN_DEVIATIONS = 5.0
"""Standard deviations by which a firefly exceeds the mean of its neighbours."""

# Pixels to each side that count as neighbours.
_RADIUS = 2

# Fraction of its neighbours' mean that a single sample may add without harm.
_HARMLESS = 0.25

# Fraction of a pixel's samples that must be effective for it to be steady, and of the steady pixels that may be
# brighter than the limit: lamps are.
_STEADY = 0.25
_BRIGHTER = 1e-3

# Pixels whose neighbours are read in one batch, for the caches.
_BATCH_PIXELS = 4096


class Fireflies(NamedTuple):
    """The fireflies of a picture.

    Attributes
    ----------
    where : bool (height, width), True for fireflies.
    light : the fraction of the picture's light by which they exceed their neighbours.
    brightest : (row, column) of the brightest.
    limit : for samples, in the picture's unit: nearly all samples of steady pixels are below it, and a sample at the
        limit would add `_HARMLESS` to the neighbours' mean at the usual firefly.  None if most fireflies' samples are
        below it, too.
    """

    where: NDArray[np.bool_]
    light: float
    brightest: tuple[int, int]
    limit: float | None

    @property
    def pixels(self) -> int:
        """The number of fireflies."""
        return int(np.count_nonzero(self.where))


def find_fireflies(mean: Array, m2: Array, count: NDArray[np.int64]) -> Fireflies | None:
    """Find the fireflies of a picture; None if there are none.

    Parameters
    ----------
    mean, m2 : (height, width, 3), mean of the samples and sum of their squared differences from it.
    count : (height, width), samples.
    """
    if not (count >= MIN_SAMPLES).any():
        return None
    n = count[..., None].astype(np.float64)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        # At most 1 / SHARE effective samples; and bright enough to exceed any neighbours by the picture's mean.
        floor = mean_scale(mean)
        by_one = (
            (m2 >= mean * mean * (n * (n * MIN_LIGHT_SHARE - 1.0)))
            & (mean > floor)
            & (n >= MIN_SAMPLES)
            & np.isfinite(m2)
        )
        suspects = np.argwhere(by_one.any(axis=2))
        if len(suspects) == 0:
            return None
        # sum x^2 / sum x, as bright as which the largest sample is at least; and the effective samples.
        typical = (m2 / n + mean * mean) / mean
        effective = n * mean / typical
    excess, harmless = np.zeros((len(suspects), 3)), np.zeros(len(suspects))
    for first in range(0, len(suspects), _BATCH_PIXELS):
        some = suspects[first : first + _BATCH_PIXELS]
        around, deviation = _neighbour_stats(mean, m2, count, some)
        value = mean[some[:, 0], some[:, 1]]
        alone = by_one[some[:, 0], some[:, 1]] & (value - around > MIN_DEVIATIONS * deviation)
        alone &= ((1.0 - MIN_LIGHT_SHARE) * value > around) & (value - around > floor)
        excess[first : first + _BATCH_PIXELS] = np.where(np.any(alone, axis=1, keepdims=True), value - around, 0.0)
        harmless[first : first + _BATCH_PIXELS] = _HARMLESS * count[some[:, 0], some[:, 1]] * around.max(axis=1)
    is_firefly = excess.any(axis=1)
    if not is_firefly.any():
        return None
    rows, columns = suspects[is_firefly].T
    where = np.zeros(count.shape, dtype=np.bool_)
    where[rows, columns] = True
    brightest = int(np.argmax(mean[rows, columns].sum(axis=1)))
    steady = (mean > 0.0) & (effective >= _STEADY * n) & (n >= MIN_SAMPLES)
    return Fireflies(
        where,
        float(excess.sum() / mean.sum()),
        (int(rows[brightest]), int(columns[brightest])),
        _suggest_clamp(typical[steady], harmless[is_firefly], np.nan_to_num(typical[rows, columns]).max(axis=1)),
    )


def _suggest_clamp(steady: Array, harmless: Array, fireflies: Array) -> float | None:
    """Suggest a clamp from the brightness of samples in steady pixels and in fireflies; None if none would help."""
    usual = float(np.quantile(steady, 1.0 - _BRIGHTER)) if len(steady) else 0.0
    limit = max(usual, float(np.median(harmless)))
    return limit if 0.0 < limit < float(np.median(fireflies)) else None


def _neighbour_stats(mean: Array, m2: Array, count: NDArray[np.int64], places: NDArray[Any]) -> tuple[Array, Array]:
    """Compute mean and standard deviation, (n, 3) each, of the pixels around `places` (n, 2)."""
    height, width = count.shape
    steps = np.arange(-_RADIUS, _RADIUS + 1)
    down, across = (step.ravel() for step in np.meshgrid(steps, steps, indexing="ij"))
    others = (down != 0) | (across != 0)
    rows, columns = places[:, :1] + down[others], places[:, 1:] + across[others]
    there = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
    rows, columns = np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)
    there &= count[rows, columns] > 1
    n = np.maximum(count[rows, columns], 2)[..., None].astype(np.float64)
    weight = there[..., None] / np.maximum(there.sum(axis=1), 1)[:, None, None]
    values = mean[rows, columns]
    average = (weight * values).sum(axis=1)
    # The larger of the variances within pixels, by their samples, and between them.
    within = (weight * m2[rows, columns] / (n * (n - 1.0))).sum(axis=1)
    between = (weight * (values - average[:, None]) ** 2).sum(axis=1)
    return average, np.sqrt(np.maximum(within, between))
