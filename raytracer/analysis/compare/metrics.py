"""How far apart two images are, noise included.

`a` is the image in question and `b` the reference, both (height, width, 3), here and in all of this package.  The
first five are plain arithmetic, meant for linear light, but they tell something of display values as well; PSNR and
SSIM are meant for what a display shows, in 0..1; FLIP has a kind for each.
"""

import math
import os
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raytracer.comparison.bands import over_bands
from raytracer.comparison.sizes import check_sizes
from raytracer.errors import InputError
from raytracer.noise.metric import weights

Array = NDArray[np.float64]
Domain = Literal["linear", "display"]

# What keeps black pixels of the reference from deciding, in pbrt's formula.
_MRSE_FLOOR = 0.01

# Wang and others 2004, section III-C: a Gaussian window of 11 x 11 pixels, with K1 = 0.01 and K2 = 0.03.
_SSIM_RADIUS = 5
_SSIM = {"data_range": 1.0, "gaussian_weights": True, "sigma": 1.5, "use_sample_covariance": False, "full": True}

# Luminance of Rec. 709, the tone mapper's value that exposures begin and end with, and the darkest median that the
# package knows: Andersson and others 2021, section 3; Narkowicz 2016.
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
    module = {"ssim": "skimage", "flip": "flip_evaluator"}[what]
    if find_spec(module) is None:
        package = {"ssim": "scikit-image", "flip": "flip-evaluator"}[what]
        raise InputError(f"{what} needs {package}, which is not installed: pip install 'raytracer[compare]'")


# ---- plain arithmetic ----


class Sums(NamedTuple):
    """Sums over all values of |a - b|, of its square, and of that relative to the reference, in two ways."""

    absolute: float
    squared: float
    relative: float
    pbrt: float


def sums(a: ArrayLike, b: ArrayLike) -> Sums:
    """Everything that the plain metrics are made of, in one go.

    Raises
    ------
    InputError : the shapes differ.
    """
    first, second = _pair(a, b)

    def of_band(top: int, bottom: int) -> tuple[float, ...]:
        reference = second[top:bottom]
        # What is too large for float64 is inf, or not a number.
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            difference = first[top:bottom] - reference
            squared = difference**2
            pbrt = squared / (reference + _MRSE_FLOOR) ** 2
            return (
                float(np.abs(difference).sum()),
                float(squared.sum()),
                float((weights(reference, 1.0) * squared).sum()),
                # A reference of -0.01 has no relative error.
                float(pbrt.sum(where=(reference != -_MRSE_FLOOR))),
            )

    return Sums(*(_total(parts) for parts in zip(*over_bands(of_band, len(first)), strict=True)))


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
    """Mean absolute error of `a` against `b`, images (height, width, 3), over pixels and channels.

    Raises
    ------
    InputError : the shapes differ.
    """
    return sums(a, b).absolute / np.size(a)


def mse(a: ArrayLike, b: ArrayLike) -> float:
    """Mean squared error of `a` against `b`, images (height, width, 3), over pixels and channels.

    Raises
    ------
    InputError : the shapes differ.
    """
    return sums(a, b).squared / np.size(a)


def rmse(a: ArrayLike, b: ArrayLike) -> float:
    """Root of `mse`, in the unit of the images.

    Raises
    ------
    InputError : the shapes differ.
    """
    return math.sqrt(mse(a, b))


def relmse(a: ArrayLike, b: ArrayLike) -> float:
    """Relative mean squared error of `a` against the reference `b`: the mean of (a - b)^2 / (b^2 + 0.01).

    The 0.01 keeps black pixels from deciding.

    Raises
    ------
    InputError : the shapes differ.

    References: Rousselle, Knaus and Zwicker 2011, "Adaptive Sampling and Reconstruction using Greedy Error
        Minimization", ACM Transactions on Graphics 30(6), section 6.
    """
    return sums(a, b).relative / np.size(a)


def mrse(a: ArrayLike, b: ArrayLike) -> float:
    """Mean relative squared error of `a` against the reference `b`: the mean of (a - b)^2 / (b + 0.01)^2.

    A value of exactly -0.01 in the reference counts as no error.

    Raises
    ------
    InputError : the shapes differ.

    References: pbrt-v4, src/pbrt/util/image.cpp, `Image::MRSE`, which `imgtool diff --metric MRSE` prints; it leaves
        out what is infinite as well.
    """
    return sums(a, b).pbrt / np.size(a)


def psnr(a: ArrayLike, b: ArrayLike, peak: float = 1.0) -> float:
    """Peak signal-to-noise ratio in dB, 10 log10(peak^2 / MSE); inf for equal images.

    Raises
    ------
    InputError : the shapes differ.
    """
    return decibels(mse(a, b), peak)


def decibels(error: float, peak: float = 1.0) -> float:
    """The PSNR that belongs to a mean squared error."""
    return math.inf if error == 0.0 else 10.0 * math.log10(peak**2 / error)


# ---- what is seen ----


def ssim(a: ArrayLike, b: ArrayLike) -> float:
    """Mean structural similarity of images with display values in 0..1; 1 for equal images.

    Of each channel, with the Gaussian window and the constants of the paper, over the pixels whose window of 11 x 11
    lies in the image; the mean of the channels.

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
        found = 0.0
        for channel in range(channels):
            planes = (np.ascontiguousarray(image[top : bottom + margin, :, channel]) for image in (first, second))
            _, values = similarity(*planes, **_SSIM)
            found += float(values[inner, inner].sum())
        return found

    count: int = (height - margin) * (width - margin) * channels
    return math.fsum(over_bands(of_band, height - margin)) / count


def flip(a: ArrayLike, b: ArrayLike, domain: Domain) -> float:
    """Mean of `flip_map`.

    Raises
    ------
    InputError : see `flip_map`.
    """
    return mean_of_map(flip_map(a, b, domain))


def mean_of_map(found: NDArray[np.float32]) -> float:
    """The mean of a map that `flip_map` made; the package's own, in float32, is off in the third digit for 4K."""
    return float(found.mean(dtype=np.float64))


def flip_map(a: ArrayLike, b: ArrayLike, domain: Domain) -> NDArray[np.float32]:
    """How different each pixel looks when the two images are shown in turns: float32 (height, width) in 0..1.

    Parameters
    ----------
    domain : `display` for display values in 0..1 (LDR-FLIP), `linear` for linear light (HDR-FLIP: the worst of all
        exposures, from one that shows the brightest pixel to one that shows the median; values below 0 count as 0).
        The eye is where the package assumes it: 0.7 m from a 4K display that is 0.7 m wide.

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
    found: tuple[NDArray[np.float32], Any, Any] = evaluate(
        reference, test, kind, inputsRGB=True, applyMagma=False, computeMeanError=False
    )
    return found[0][..., 0]


def flip_package() -> Any:
    """The package flip-evaluator.

    Raises
    ------
    InputError : it is not installed.
    """
    require_extra("flip")
    # Its threads wait for each other by turning in circles, unless they are told to sleep before it is loaded: on a
    # machine that is busy a picture of 50 x 40 pixels takes 0.3 s in place of 0.01.
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")
    import flip_evaluator

    return flip_evaluator


def exposures(reference: Array) -> int:
    """How many exposures HDR-FLIP looks at, each of which takes as long as a display image.

    Raises
    ------
    InputError : the reference is black, and has none.
    """
    luminance = np.maximum(reference, 0.0) @ _LUMINANCE
    brightest, median = float(luminance.max()), max(float(np.median(luminance)), _FLIP_DARKEST)
    # With room for float32, which the package finds the same in.
    if brightest < 2.0 * _FLIP_DARKEST:
        raise InputError("FLIP has no exposure for a reference that is black")
    return max(2, math.ceil(math.log2(brightest / median)))


# ---- all by name ----


class Metric(NamedTuple):
    """A metric by the name that users know: its label, whether larger is better, and what is measured."""

    label: str
    is_better_larger: bool
    of: Callable[[Sums, int], float] | None
    always_display: bool = False


METRICS = {
    "mae": Metric("MAE", False, lambda found, count: found.absolute / count),
    "mse": Metric("MSE", False, lambda found, count: found.squared / count),
    "rmse": Metric("RMSE", False, lambda found, count: math.sqrt(found.squared / count)),
    "relmse": Metric("relMSE", False, lambda found, count: found.relative / count),
    "mrse": Metric("MRSE", False, lambda found, count: found.pbrt / count),
    "psnr": Metric("PSNR", True, lambda found, count: decibels(found.squared / count), True),
    "ssim": Metric("SSIM", True, None, True),
    "flip": Metric("FLIP", False, None),
}
"""All metrics, in the order in which they are printed."""
