"""Accumulate the samples of pixels: running mean and variance, and the clamp of bright samples."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import kernel, optional
from raytracer.core.vec import max_component, scale
from raytracer.kernel.aovs.base.layers import add_aovs
from raytracer.kernel.lens_dispersion import apply_lens_color, ray_wavelength
from raytracer.kernel.path_log import Finished, record
from raytracer.kernel.path_rows import load3, store3


class FilmView(NamedTuple):
    """The part of a film that kernels write to, for the pixels from (left, top) on.

    Attributes
    ----------
    mean : float64 (height, width, 3), the running mean.
    m2 : float64 (height, width, 3), the running sum of squared differences from the mean.
    count : int64 (height, width), samples taken.
    bad : int64 (height, width), samples dropped because they were not finite.
    left, top : the first pixel.
    aovs : the AOVs that are recorded, or None.
    removed : float64 (height, width, 4), radiance that a clamp removed from samples, summed by channel, and the number
        of these; None without a clamp.
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
    """An upper `limit` on the radiance of a sample, in each channel."""

    limit: float


@optional
def clamp_sample(clamp, film, work, sample, x, y, value):
    """Clamp the finite value of a sample; the radiance that is removed is counted on the film."""
    return value


@clamp_sample.register(Clamp)
def clamp_sample_clamp(clamp, film, work, sample, x, y, value):
    # Radiance is measured before it is weighted: the weight of camera rays says nothing of how rare they are, nor does
    # the colour that the lens gives them.
    brightest = max_component(load3(work.radiance, sample, 0))
    if brightest <= clamp.limit:
        return value
    clamped = scale(clamp.limit / brightest, value)
    for channel in range(3):
        film.removed[y, x, channel] += value[channel] - clamped[channel]
    film.removed[y, x, 3] += 1.0
    return clamped


@kernel
def accumulate(spectrum, clamp, film, work, x, y, first, count):
    """Add a packet of samples, from sample `first` of the batch on, to a pixel's running mean and sum of squares.

    The weight of a sample that is dropped becomes NaN, which marks it afterwards.

    References: Chan, Golub, LeVeque 1979, "Updating Formulae and a Pairwise Algorithm for Computing Sample Variances".
    """
    add_aovs(film.aovs, spectrum, work, x, y, first, count)

    # Drop what is not finite, and count it.
    good = 0
    for sample in range(first, first + count):
        wavelength = ray_wavelength(spectrum, work, sample)
        radiance = apply_lens_color(spectrum, work, sample, load3(work.radiance, sample, 0))
        value = scale(work.weight[sample], radiance)
        if math.isfinite(value[0] + value[1] + value[2]):
            clamped = clamp_sample(clamp, film, work, sample, x, y, value)
            record(work.log, work, sample, Finished(value, clamped, wavelength))
            store3(work.radiance, first + good, 0, clamped)
            good += 1
        else:
            record(work.log, work, sample, Finished(value, value, wavelength))
            work.weight[sample] = math.nan
    film.bad[y, x] += count - good
    if good == 0:
        return
    total = film.count[y, x] + good
    film.count[y, x] = total
    for channel in range(3):
        mean = 0.0
        for sample in range(first, first + good):
            mean += work.radiance[sample, channel]
        mean /= good
        m2 = 0.0
        for sample in range(first, first + good):
            deviation = work.radiance[sample, channel] - mean
            m2 += deviation * deviation
        difference = mean - film.mean[y, x, channel]
        film.mean[y, x, channel] += difference * (good / total)
        film.m2[y, x, channel] += m2 + difference * difference * (good * (total - good) / total)
