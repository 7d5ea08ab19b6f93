"""Error metrics of images, noise included.

`a` is the image and `b` the reference, both (height, width, 3), here and in all of this package; all metrics raise an
`InputError` where their shapes differ.  The first five are plain arithmetic, meant for linear light, but they tell
something of display values as well; PSNR and SSIM are meant for what a display shows, in 0..1; FLIP has a kind for
each.
"""

import math
import os
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raytracer.analysis.compare.image_pair import check_sizes, map_row_bands
from raytracer.core.error_estimate.metric import error_weights
from raytracer.util.errors import InputError

Array = NDArray[np.float64]
Domain = Literal["linear", "display"]

# Term that keeps black pixels of the reference from dominating, in pbrt's formula.
_MRSE_FLOOR = 0.01

# Wang and others 2004, section III-C: a Gaussian window of 11 x 11 pixels, with K1 = 0.01 and K2 = 0.03.
_SSIM_RADIUS = 5
_SSIM = {"data_range": 1.0, "gaussian_weights": True, "sigma": 1.5, "use_sample_covariance": False, "full": True}

# Luminance of Rec. 709, the value of the tone mapper at which exposures begin and end, and the darkest median of the
# package: Andersson and others 2021, section 3; Narkowicz 2016.
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
_FLIP_WHITE = 2.1188723
_FLIP_DARKEST = float(np.finfo(np.float32).eps)
_LARGEST = float(np.finfo(np.float32).max)


def require_extra(what: str) -> None:
    """Make sure that the extra `compare` is installed.

    Raises
    ------
    InputError : it is not.
    """
    module, package = {"ssim": ("skimage", "scikit-image"), "flip": ("flip_evaluator", "flip-evaluator")}[what]
    if find_spec(module) is None:
        raise InputError(f"{what} needs {package}, which is not installed: pip install 'raytracer[compare]'")


# ---- Plain arithmetic


class Sums(NamedTuple):
    """Sums over all values of |a - b|, of its square, and of that relative to the reference, in two ways."""

    absolute: float
    squared: float
    relative: float
    pbrt: float


def sums(a: ArrayLike, b: ArrayLike) -> Sums:
    """Compute the sums of all plain metrics in one pass."""
    first, second = _pair(a, b)

    def of_band(top: int, bottom: int) -> tuple[float, ...]:
        reference = second[top:bottom]
        # Values too large for float64 are inf or nan.
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            difference = first[top:bottom] - reference
            squared = difference**2
            pbrt = squared / (reference + _MRSE_FLOOR) ** 2
            return (
                float(np.abs(difference).sum()),
                float(squared.sum()),
                float((error_weights(reference, 1.0) * squared).sum()),
                # A reference of -0.01 has no relative error.
                float(pbrt.sum(where=(reference != -_MRSE_FLOOR))),
            )

    return Sums(*(_total(parts) for parts in zip(*map_row_bands(of_band, len(first)), strict=True)))


def _total(parts: Sequence[float]) -> float:
    try:
        return math.fsum(parts)
    except OverflowError:
        return math.inf


def _pair(a: ArrayLike, b: ArrayLike) -> tuple[Array, Array]:
    first, second = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    check_sizes(first, second)
    return first, second


def mae(a: ArrayLike, b: ArrayLike) -> float:
    """Compute the mean absolute error of `a` against `b`, images (height, width, 3), over pixels and channels."""
    return sums(a, b).absolute / np.size(a)


def mse(a: ArrayLike, b: ArrayLike) -> float:
    """Compute the mean squared error of `a` against `b`, images (height, width, 3), over pixels and channels."""
    return sums(a, b).squared / np.size(a)


def rmse(a: ArrayLike, b: ArrayLike) -> float:
    """Compute the root of `mse`, in the unit of the images."""
    return math.sqrt(mse(a, b))


def relmse(a: ArrayLike, b: ArrayLike) -> float:
    """Compute the relative mean squared error of `a` against the reference `b`: the mean of (a - b)^2 / (b^2 + 0.01).

    The 0.01 keeps black pixels from dominating.

    References: Rousselle, Knaus and Zwicker 2011, "Adaptive Sampling and Reconstruction using Greedy Error
        Minimization", ACM Transactions on Graphics 30(6), section 6.
    """
    return sums(a, b).relative / np.size(a)


def mrse(a: ArrayLike, b: ArrayLike) -> float:
    """Compute the mean relative squared error of `a` against the reference `b`: the mean of (a - b)^2 / (b + 0.01)^2.

    A value of exactly -0.01 in the reference counts as no error.

    References: pbrt-v4, src/pbrt/util/image.cpp, `Image::MRSE`, which `imgtool diff --metric MRSE` prints; it leaves
        out what is infinite as well.
    """
    return sums(a, b).pbrt / np.size(a)


def psnr(a: ArrayLike, b: ArrayLike, peak: float = 1.0) -> float:
    """Compute the peak signal-to-noise ratio in dB, 10 log10(peak^2 / MSE); inf for equal images."""
    return _decibels(mse(a, b), peak)


def _decibels(error: float, peak: float = 1.0) -> float:
    """Compute the PSNR of a mean squared error."""
    return math.inf if error == 0.0 else 10.0 * math.log10(peak**2 / error)


# ---- Perceptual metrics


def ssim(a: ArrayLike, b: ArrayLike) -> float:
    """Compute the mean structural similarity of images with display values in 0..1; 1 for equal images.

    The mean over channels and over the pixels whose window of 11 x 11 lies in the image, with the Gaussian window and
    the constants of the paper.

    Raises
    ------
    InputError : the shapes differ, an image is smaller than the window, or scikit-image is not installed.

    References: Wang, Bovik, Sheikh and Simoncelli 2004, "Image Quality Assessment: From Error Visibility to Structural
        Similarity", IEEE Transactions on Image Processing 13(4), section III.
    """
    require_extra("ssim")
    from skimage.metrics import structural_similarity

    similarity: Callable[..., tuple[float, Array]] = structural_similarity
    first, second = _pair(a, b)
    height, width, channels = first.shape
    margin = 2 * _SSIM_RADIUS
    if min(height, width) <= margin:
        raise InputError(f"SSIM takes images of 11 x 11 pixels or more, got {width} x {height}")

    def of_band(top: int, bottom: int) -> float:
        inner = slice(_SSIM_RADIUS, -_SSIM_RADIUS)
        total = 0.0
        for channel in range(channels):
            planes = (np.ascontiguousarray(image[top : bottom + margin, :, channel]) for image in (first, second))
            _, values = similarity(*planes, **_SSIM)
            total += float(values[inner, inner].sum())
        return total

    count: int = (height - margin) * (width - margin) * channels
    return math.fsum(map_row_bands(of_band, height - margin)) / count


def flip(a: ArrayLike, b: ArrayLike, domain: Domain) -> float:
    """Compute the mean of `flip_map`.

    Raises
    ------
    InputError : see `flip_map`.
    """
    return mean_of_map(flip_map(a, b, domain))


def mean_of_map(values: NDArray[np.float32]) -> float:
    """Compute the mean of a `flip_map`; the package's own, in float32, is off in the third digit for 4K."""
    return float(values.mean(dtype=np.float64))


def flip_map(a: ArrayLike, b: ArrayLike, domain: Domain) -> NDArray[np.float32]:
    """Compute FLIP, the visibility of differences when two images alternate: float32 (height, width) in 0..1.

    Parameters
    ----------
    domain : `display` for display values in 0..1 (LDR-FLIP), `linear` for linear light (HDR-FLIP: the worst of all
        exposures, from one that shows the brightest pixel to one that shows the median; values below 0 count as 0).
        The eye is at the default place of the package: 0.7 m from a 4K display that is 0.7 m wide.

    Raises
    ------
    InputError : the shapes differ, the reference is black in linear light, or flip-evaluator is not installed.

    References: Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström and Fairchild 2020, "FLIP: A Difference Evaluator
        for Alternating Images", PACMCGIT 3(2); Andersson, Nilsson, Shirley and Akenine-Möller 2021, "Visualizing
        Errors in Rendered High Dynamic Range Images", Eurographics Short Papers.
    """
    evaluate = flip_package().evaluate
    first, second = _pair(a, b)
    if domain == "linear":
        # The package ends the process where it finds no exposure.
        exposures(second)
    most = _LARGEST if domain == "linear" else 1.0
    test, reference = (np.ascontiguousarray(np.clip(image, 0.0, most), dtype=np.float32) for image in (first, second))
    kind = "HDR" if domain == "linear" else "LDR"
    result: tuple[NDArray[np.float32], Any, Any] = evaluate(
        reference, test, kind, inputsRGB=True, applyMagma=False, computeMeanError=False
    )
    return result[0][..., 0]


def flip_package() -> Any:
    """Import the package flip-evaluator.

    Raises
    ------
    InputError : it is not installed.
    """
    require_extra("flip")
    # Its threads wait actively for each other, unless they are set to sleep before it is loaded: on a busy machine a
    # picture of 50 x 40 pixels takes 0.3 s in place of 0.01.
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")
    import flip_evaluator

    return flip_evaluator


def exposures(reference: Array) -> int:
    """Count the exposures of HDR-FLIP, each of which takes as long as a display image.

    Raises
    ------
    InputError : the reference is black, and has none.
    """
    luminance = np.maximum(reference, 0.0) @ _LUMINANCE
    brightest, median = float(luminance.max()), max(float(np.median(luminance)), _FLIP_DARKEST)
    # With a margin for float32, in which the package computes the same.
    if brightest < 2.0 * _FLIP_DARKEST:
        raise InputError("FLIP has no exposure for a reference that is black")
    return max(2, math.ceil(math.log2(brightest / median)))


# ---- Table of metrics


class Metric(NamedTuple):
    """A metric.

    label : name that users read.
    is_better_larger : True if larger is better.
    of : computes it from sums and the number of values; None if it takes the images.
    always_display : True if it is of display values, whatever the images hold.
    """

    label: str
    is_better_larger: bool
    of: Callable[[Sums, int], float] | None
    always_display: bool = False


METRICS = {
    "mae": Metric("MAE", False, lambda sums, count: sums.absolute / count),
    "mse": Metric("MSE", False, lambda sums, count: sums.squared / count),
    "rmse": Metric("RMSE", False, lambda sums, count: math.sqrt(sums.squared / count)),
    "relmse": Metric("relMSE", False, lambda sums, count: sums.relative / count),
    "mrse": Metric("MRSE", False, lambda sums, count: sums.pbrt / count),
    "psnr": Metric("PSNR", True, lambda sums, count: _decibels(sums.squared / count), True),
    "ssim": Metric("SSIM", True, None, True),
    "flip": Metric("FLIP", False, None),
}
"""All metrics by the names that users give, in the order in which they are printed."""
