"""Where the samples of a pixel gather: its running mean and variance, and how bright a sample may be."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.hues import finished, ray_wavelength
from raytracer.jit import generic, kernel
from raytracer.pathlog import note_value
from raytracer.paths import load3, store3
from raytracer.vec import max_component, scale


class FilmView(NamedTuple):
    """Where samples gather, for the pixels from (left, top) on.

    mean and m2 (height, width, 3) float64, the running mean and sum of squared differences from it; count
    (height, width) int64, samples taken; bad (height, width) int64, samples dropped because they were not finite;
    aovs, what else is recorded, or None; removed (height, width, 4) float64, what a clamp has taken of the samples,
    summed by channel, and of how many, or None where there is none.
    """

    mean: NDArray[np.float64]
    m2: NDArray[np.float64]
    count: NDArray[np.int64]  # type: ignore[assignment]  # takes the place of tuple.count
    bad: NDArray[np.int64]
    left: int
    top: int
    aovs: Any
    removed: Any = None


class Clamp(NamedTuple):
    """No sample is brighter than `limit`, in any channel."""

    limit: float


@generic
def merge(aovs, spectrum, work, x, y, count):
    """Add a packet's records to the image, before those samples that are not finite are dropped."""
    raise NotImplementedError


@merge.register(type(None))
def _(aovs, spectrum, work, x, y, count):
    return


@generic
def clamped(clamp, film, work, sample, x, y, value):
    """What a sample of this finite value may add to its pixel; what it may not is noted on the film."""
    raise NotImplementedError


@clamped.register(type(None))
def _(clamp, film, work, sample, x, y, value):
    return value


@clamped.register(Clamp)
def _(clamp, film, work, sample, x, y, value):
    # Radiance is measured, before it is weighted: what a camera's rays count for says nothing of how rare they are, nor
    # does the hue that its lens gives them.
    brightest = max_component(load3(work.radiance, sample, 0))
    if brightest <= clamp.limit:
        return value
    left = scale(clamp.limit / brightest, value)
    for channel in range(3):
        film.removed[y, x, channel] += value[channel] - left[channel]
    film.removed[y, x, 3] += 1.0
    return left


@kernel
def accumulate(spectrum, clamp, film, work, x, y, count):
    """Add a packet of samples to a pixel's running mean and sum of squares.

    The weight of a sample that is dropped becomes NaN, by which it can be told from the others afterwards.

    References: Chan, Golub, LeVeque 1979, "Updating Formulae and a Pairwise Algorithm for Computing Sample Variances".
    """
    merge(film.aovs, spectrum, work, x, y, count)

    # Drop what is not finite, and count it.
    good = 0
    for sample in range(count):
        wavelength = ray_wavelength(spectrum, work, sample)
        radiance = finished(spectrum, work, sample, load3(work.radiance, sample, 0))
        value = scale(work.radiance[sample, 3], radiance)
        if math.isfinite(value[0] + value[1] + value[2]):
            left = clamped(clamp, film, work, sample, x, y, value)
            note_value(work.log, work, sample, value, left, wavelength)
            store3(work.radiance, good, 0, left)
            good += 1
        else:
            note_value(work.log, work, sample, value, value, wavelength)
            work.radiance[sample, 3] = math.nan
    film.bad[y, x] += count - good
    if good == 0:
        return
    total = film.count[y, x] + good
    film.count[y, x] = total
    for channel in range(3):
        mean = 0.0
        for sample in range(good):
            mean += work.radiance[sample, channel]
        mean /= good
        m2 = 0.0
        for sample in range(good):
            m2 += (work.radiance[sample, channel] - mean) ** 2
        difference = mean - film.mean[y, x, channel]
        film.mean[y, x, channel] += difference * (good / total)
        film.m2[y, x, channel] += m2 + difference * difference * (good * (total - good) / total)
