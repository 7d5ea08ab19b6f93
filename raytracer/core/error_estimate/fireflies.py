"""Fireflies: single pixels that one sample has made far brighter than what is around them.

Of n samples x of a pixel, (sum x)^2 / sum x^2 = n / (1 + v), where v is their variance over their squared mean, is the
number of equal samples that would be as noisy: n if all are alike, 1 if all light came by one of them.  Since
sum x^2 <= max x * sum x, the largest sample brought at least one part in that number.  Where that is the part `SHARE`,
the pixel would be less than a fifth as bright without it.

Edges of lamps look so too, and whole areas where light is rare.  A firefly stands alone: what is around it is as dark
as it would be itself, and it exceeds the mean of these pixels by `DEVIATIONS` standard deviations of theirs.  Where a
part p of all pixels has met a rare sample, the mean is p V and the deviation sqrt(p (1 - p)) V, so that a pixel of
value V exceeds the mean by sqrt((1 - p) / p) deviations: 5 at one pixel in 26, about one in its own neighbourhood of
5 x 5.  More of them are noise, of which the error tells.  And it is seen: it exceeds them by the mean of the picture.

References: Kish 1965, "Survey Sampling", sec. 8.2 (effective sample size); Zirr, Hanika, Dachsbacher 2018,
    "Re-Weighting Firefly Samples for Improved Finite-Sample Monte Carlo Estimates", Computer Graphics Forum 37(6),
    which looks at how alone a bright sample is, too.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.noise.metric import scale_of

Array = NDArray[np.float64]

FEWEST = 32
"""Samples of a pixel that is looked at: of fewer, one may well be all that met what is small."""

SHARE = 0.8
"""Part of a firefly's light that its largest sample brought, at least."""

DEVIATIONS = 5.0
"""By which it exceeds the mean of what is around it."""

# Pixels to each side that count as around.
_REACH = 2

# Part of what is around a firefly that a single sample may well add.
_HARMLESS = 0.25

# Part of a pixel's samples that must be effective for it to be steady, and of the steady pixels that may be brighter
# than the limit: lamps are.
_STEADY = 0.25
_BRIGHTER = 1e-3

# Pixels whose surroundings are looked at in one go, for the caches.
_AT_ONCE = 4096


class Fireflies(NamedTuple):
    """What was found.

    where (height, width) bool; light, the part of the picture's light by which they exceed what is around them;
    brightest (row, column); limit, for samples, in the picture's unit: nearly all of those of steady pixels are below
    it, and a sample at the limit would add `_HARMLESS` to what is around the usual firefly; None if most fireflies'
    samples are below it, too.
    """

    where: NDArray[np.bool_]
    light: float
    brightest: tuple[int, int]
    limit: float | None

    @property
    def pixels(self) -> int:
        """How many they are."""
        return int(np.count_nonzero(self.where))


def find_fireflies(mean: Array, m2: Array, count: NDArray[np.int64]) -> Fireflies | None:
    """The fireflies of a picture, or None where there are none.

    Parameters
    ----------
    mean, m2 : (height, width, 3), mean of the samples and sum of their squared differences from it.
    count : (height, width), samples.
    """
    n = count[..., None].astype(np.float64)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        # At most 1 / SHARE effective samples; and bright enough to exceed anything by the picture's mean.
        floor = scale_of(mean)
        by_one = (m2 >= mean * mean * (n * (n * SHARE - 1.0))) & (mean > floor) & (n >= FEWEST) & np.isfinite(m2)
        suspects = np.argwhere(by_one.any(axis=2))
        if len(suspects) == 0:
            return None
        # sum x^2 / sum x, as bright as which the largest sample is at least; and the effective samples.
        typical = (m2 / n + mean * mean) / mean
        effective = n * mean / typical
    excess, harmless = np.zeros((len(suspects), 3)), np.zeros(len(suspects))
    for first in range(0, len(suspects), _AT_ONCE):
        some = suspects[first : first + _AT_ONCE]
        around, deviation = _around(mean, m2, count, some)
        value = mean[some[:, 0], some[:, 1]]
        alone = by_one[some[:, 0], some[:, 1]] & (value - around > DEVIATIONS * deviation)
        alone &= ((1.0 - SHARE) * value > around) & (value - around > floor)
        excess[first : first + _AT_ONCE] = np.where(np.any(alone, axis=1, keepdims=True), value - around, 0.0)
        harmless[first : first + _AT_ONCE] = _HARMLESS * count[some[:, 0], some[:, 1]] * around.max(axis=1)
    found = excess.any(axis=1)
    if not found.any():
        return None
    rows, columns = suspects[found].T
    where = np.zeros(count.shape, dtype=np.bool_)
    where[rows, columns] = True
    brightest = int(np.argmax(mean[rows, columns].sum(axis=1)))
    steady = (mean > 0.0) & (effective >= _STEADY * n) & (n >= FEWEST)
    return Fireflies(
        where,
        float(excess.sum() / mean.sum()),
        (int(rows[brightest]), int(columns[brightest])),
        _limit(typical[steady], harmless[found], np.nan_to_num(typical[rows, columns]).max(axis=1)),
    )


def _limit(steady: Array, harmless: Array, fireflies: Array) -> float | None:
    """What samples may be limited to, by how bright they are in steady pixels, and in fireflies; None if to no use."""
    usual = float(np.quantile(steady, 1.0 - _BRIGHTER)) if len(steady) else 0.0
    limit = max(usual, float(np.median(harmless)))
    return limit if 0.0 < limit < float(np.median(fireflies)) else None


def _around(mean: Array, m2: Array, count: NDArray[np.int64], places: NDArray[Any]) -> tuple[Array, Array]:
    """Of the pixels around `places` (n, 2): their mean, and the standard deviation of one of them, (n, 3) each."""
    height, width = count.shape
    steps = np.arange(-_REACH, _REACH + 1)
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
    # Within pixels, as their samples tell it, or between them: whichever is more.
    within = (weight * m2[rows, columns] / (n * (n - 1.0))).sum(axis=1)
    between = (weight * (values - average[:, None]) ** 2).sum(axis=1)
    return average, np.sqrt(np.maximum(within, between))
