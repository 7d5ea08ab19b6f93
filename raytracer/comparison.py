"""Whether two noisy images are of the same scene, and how far apart they are.

Two renders of one scene differ by their noise, which each knows: the variance of its pixels.  `z_test` asks whether
they differ by more than that; the metrics below say by how much, noise included.
"""

import io
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raytracer.errors import InputError
from raytracer.film.output import write_bytes
from raytracer.noise.metric import weights

Array = NDArray[np.float64]

# What rounding may differ by, relative to the values: hits found in float32 (2^-24), added up over a path.
_ROUNDING = 1e-6

# Standard deviations beyond which pixels are counted; normal noise puts 4.55 % there.
_COUNTED_BEYOND = 2.0

_CHANNELS = ("red", "green", "blue")
_WIDEST_REFERENCE = 128


@dataclass(frozen=True)
class Verdict:
    """What `z_test` found.  Every z is of the first image less the second, in standard deviations of the difference.

    Every p is the probability that noise alone makes the largest of the values it belongs to as large as it is.

    Attributes
    ----------
    passed : whether every p is at least a quarter of the significance level.
    reason : one sentence: the first test that failed, or how near the images are.
    mean_z : (3,), means of the channels.
    mean_p : for `mean_z`.
    tile_z : (rows, columns, 3), means of square tiles.
    tile_p : for `tile_z`.
    pixel_z : (height, width, 3); the variance of a pixel is taken no smaller than the mean of those of its tile.
    pixel_p : for `pixel_z`.
    exceeding : (3,), fraction of the pixels with a |z| above 2, which is 0.0455 for normal noise.
    exceeding_p : for `exceeding`.
    """

    passed: bool
    reason: str
    mean_z: Array
    mean_p: float
    tile_z: Array
    tile_p: float
    pixel_z: Array
    pixel_p: float
    exceeding: Array
    exceeding_p: float


def _any_of(p: float, tests: int) -> float:
    """Probability that the least p of independent tests is at most `p` (Šidák 1967)."""
    return -math.expm1(tests * math.log1p(-p)) if p < 1.0 else 1.0


def _p_of_largest(z: Array) -> float:
    """Probability that one of as many normal values as `z` has is as far from 0 as its farthest."""
    return _any_of(math.erfc(float(np.abs(z).max()) / math.sqrt(2.0)), z.size)


def _p_of_exceeding(exceeding: Array, pixels: int) -> float:
    """Probability that one channel or more has as many pixels beyond `_COUNTED_BEYOND` as the one with the most."""
    from scipy.special import bdtrc

    most = round(float(exceeding.max()) * pixels)
    beyond = math.erfc(_COUNTED_BEYOND / math.sqrt(2.0))
    p = float(bdtrc(most - 1, pixels, beyond)) if most else 1.0
    return _any_of(p, exceeding.size)


def _tile_sums(values: Array, tile: int) -> Array:
    """Sums of `values` (height, width, ...) over squares of `tile` pixels; those at the edges may be smaller."""
    rows = np.add.reduceat(values, np.arange(0, values.shape[0], tile), axis=0)
    return np.add.reduceat(rows, np.arange(0, values.shape[1], tile), axis=1)


class _Pair(NamedTuple):
    """Two images, or means over equal parts of them, with the variances of both."""

    a: Array
    var_a: Array
    b: Array
    var_b: Array

    def tiles(self, tile: int, cells: Array) -> "_Pair":
        a, var_a, b, var_b = (_tile_sums(values, tile) for values in self)
        return _Pair(a / cells, var_a / cells**2, b / cells, var_b / cells**2)

    def variance_of_difference(self) -> Array:
        """Variance of a - b, under the hypothesis that both are of one scene.

        It is var_a + var_b, but a pixel in which rare bright samples have not turned up yet takes itself to be
        free of noise.  If b has r times as many samples, its variance tells what that of a should be, and the other
        way round: the pooled estimate of Student's two-sample test is var_a / r + r var_b.  The larger one is
        taken, with the r that the totals of the variances are in.
        """
        summed = self.var_a + self.var_b
        total_a, total_b = float(self.var_a.sum()), float(self.var_b.sum())
        if total_a == 0.0 or total_b == 0.0:
            return summed
        ratio = total_a / total_b
        return np.maximum(summed, self.var_a / ratio + self.var_b * ratio)

    def z(self, variance: Array) -> Array:
        """The difference in standard deviations: 0 if it is no more than rounding, inf if it is not a number."""
        difference = self.a - self.b
        scale = np.maximum(np.abs(self.a), np.abs(self.b))
        beyond = np.maximum(np.abs(difference) - _ROUNDING * scale, 0.0)
        z = np.divide(beyond, np.sqrt(variance), out=np.where(beyond > 0.0, np.inf, 0.0), where=variance > 0.0)
        return np.copysign(np.where(np.isfinite(difference), z, np.inf), difference)


def _checked(a: ArrayLike, var_a: ArrayLike | None, b: ArrayLike, var_b: ArrayLike | None) -> _Pair:
    first, second = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    _check_sizes(first, second)
    variances = []
    for image, given in ((first, var_a), (second, var_b)):
        variance = np.zeros_like(image) if given is None else np.asarray(given, dtype=np.float64)
        if variance.shape != image.shape:
            raise InputError(f"a variance of the shape {variance.shape} for an image of the shape {image.shape}")
        if not np.all(np.isfinite(variance) & (variance >= 0.0)):
            raise InputError("a variance is not known everywhere: it takes two samples in every pixel")
        variances.append(variance)
    return _Pair(first, variances[0], second, variances[1])


def _check_sizes(a: Array, b: Array) -> None:
    if a.ndim != 3 or a.shape[2] != 3 or a.size == 0:
        raise InputError(f"an image has the shape (height, width, 3), got {a.shape}")
    if a.shape != b.shape:
        raise InputError(
            f"the images differ in size: {a.shape[1]} x {a.shape[0]} and {b.shape[1]} x {b.shape[0]} pixels"
        )


def _percent(a: float, b: float) -> str:
    return f"{a:.6g} against {b:.6g}" + (f" ({(a - b) / b:+.2%})" if b else "")


def _largest(z: Array) -> tuple[int, ...]:
    return tuple(int(i) for i in np.unravel_index(np.argmax(np.abs(z)), z.shape))


def z_test(
    a: ArrayLike,
    var_a: ArrayLike | None,
    b: ArrayLike,
    var_b: ArrayLike | None,
    tile: int = 8,
    alpha: float = 1e-3,
) -> Verdict:
    """Test the hypothesis that two images differ by their noise only.

    Four tests share the significance level evenly, each with a correction for how often it is made: the mean of a
    channel, the means of tiles, single pixels, and the number of pixels beyond two standard deviations.
    Means are the sharp ones, since the noise of a pixel is far from normal and its variance itself is noisy; the
    others find what leaves means alone.  Values that agree to 1e-6 of their size agree, so that pixels without
    noise must be equal to that.  That takes some 16 samples a pixel: of 4, all may agree by chance on the edge of a
    thing.

    Parameters
    ----------
    a, b : images (height, width, 3), float64.
    var_a, var_b : variances of the pixels' means, of the same shape; None for an image without noise.
        An image without noise should be one indeed: where the other has not met a rare sample yet, nothing
        tells that it should have.
    tile : width and height of a tile in pixels.
    alpha : how often two honest images may fail.

    Raises
    ------
    InputError : the shapes differ, or a variance is negative or not finite.
    """
    pair = _checked(a, var_a, b, var_b)
    height, width, _ = pair.a.shape
    cells = _tile_sums(np.ones((height, width, 1)), tile)

    # Compare means of everything, then of tiles.
    with np.errstate(invalid="ignore"):
        whole = _Pair(
            pair.a.mean(axis=(0, 1)),
            pair.var_a.sum(axis=(0, 1)) / (height * width) ** 2,
            pair.b.mean(axis=(0, 1)),
            pair.var_b.sum(axis=(0, 1)) / (height * width) ** 2,
        )
        mean_z = whole.z(whole.variance_of_difference())
        tiles = pair.tiles(tile, cells)
        tile_z = tiles.z(tiles.variance_of_difference())

        # A pixel's own variance, from few samples, may be far too small, which that of its neighbours tells.
        variance = pair.variance_of_difference()
        of_tile = np.repeat(np.repeat(_tile_sums(variance, tile) / cells, tile, axis=0), tile, axis=1)
        noisy = variance > 0.0
        pixel_z = pair.z(np.where(noisy, np.maximum(variance, of_tile[:height, :width]), 0.0))
    exceeding = np.mean(np.abs(pixel_z) > _COUNTED_BEYOND, axis=(0, 1))

    # Name the first test that failed.
    mean_p, tile_p, pixel_p = _p_of_largest(mean_z), _p_of_largest(tile_z), _p_of_largest(pixel_z)
    exceeding_p = _p_of_exceeding(exceeding, height * width)
    passed = min(mean_p, tile_p, pixel_p, exceeding_p) >= alpha / 4.0
    if not (np.isfinite(pair.a).all() and np.isfinite(pair.b).all()):
        reason = "an image holds values that are not finite"
    elif mean_p < alpha / 4.0:
        (c,) = _largest(mean_z)
        reason = f"the mean of {_CHANNELS[c]} differs: {_percent(whole.a[c], whole.b[c])}, z = {mean_z[c]:.1f}"
    elif tile_p < alpha / 4.0:
        y, x, c = at = _largest(tile_z)
        reason = (
            f"the mean of {_CHANNELS[c]} differs in the tile at x = {x * tile}, y = {y * tile}: "
            f"{_percent(tiles.a[at], tiles.b[at])}, z = {tile_z[at]:.1f}"
        )
    elif pixel_p < alpha / 4.0:
        y, x, c = at = _largest(pixel_z)
        reason = (
            f"{_CHANNELS[c]} differs in the pixel at x = {x}, y = {y}: "
            f"{_percent(pair.a[at], pair.b[at])}, z = {pixel_z[at]:.1f}"
        )
    elif exceeding_p < alpha / 4.0:
        c = int(np.argmax(exceeding))
        expected = math.erfc(_COUNTED_BEYOND / math.sqrt(2.0))
        reason = (
            f"{exceeding[c]:.1%} of the pixels differ by over 2 standard deviations, where noise has {expected:.1%}"
        )
    else:
        reason = f"no difference beyond the noise: z of the means {', '.join(f'{z:.1f}' for z in mean_z)}"
    return Verdict(passed, reason, mean_z, mean_p, tile_z, tile_p, pixel_z, pixel_p, exceeding, exceeding_p)


# ---- metrics ----


def _difference(a: ArrayLike, b: ArrayLike) -> tuple[Array, Array]:
    first, second = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    _check_sizes(first, second)
    return first - second, second


def mse(a: ArrayLike, b: ArrayLike) -> float:
    """Mean squared error of `a` against `b`, images (height, width, 3), over pixels and channels.

    Raises
    ------
    InputError : the shapes differ.
    """
    difference, _ = _difference(a, b)
    return float(np.mean(difference**2))


def relmse(a: ArrayLike, b: ArrayLike) -> float:
    """Relative mean squared error of `a` against the reference `b`: the mean of (a - b)^2 / (b^2 + 0.01).

    The 0.01 keeps black pixels from deciding.  The MRSE of pbrt-v4's imgtool divides by (b + 0.01)^2 instead.

    Raises
    ------
    InputError : the shapes differ.

    References: Rousselle, Knaus and Zwicker 2011, "Adaptive Sampling and Reconstruction using Greedy Error
        Minimization", ACM Transactions on Graphics 30(6), section 6.
    """
    difference, reference = _difference(a, b)
    return float(np.mean(weights(reference, 1.0) * difference**2))


def psnr(a: ArrayLike, b: ArrayLike, peak: float = 1.0) -> float:
    """Peak signal-to-noise ratio in dB, 10 log10(peak^2 / MSE); inf for equal images.

    Raises
    ------
    InputError : the shapes differ.
    """
    error = mse(a, b)
    return math.inf if error == 0.0 else 10.0 * math.log10(peak**2 / error)


# ---- references ----


class Reference(NamedTuple):
    """A small image kept to compare with: mean and variance (height, width, 3), and what it was rendered with."""

    mean: Array
    variance: Array
    settings: dict[str, str | float | int]


def save_reference(
    path: str | Path, mean: ArrayLike, variance: ArrayLike, settings: Mapping[str, str | float | int]
) -> None:
    """Write a reference as compressed float32 .npz; the same values give the same bytes.

    Raises
    ------
    ValueError : the shapes differ, or the image is wider than 128 pixels, too large to keep with the sources.
    OutputError : the file cannot be written.
    """
    single = np.asarray(mean, dtype=np.float32)
    if single.ndim != 3 or single.shape[2] != 3 or single.shape != np.shape(variance):
        raise ValueError(f"mean and variance of one shape (height, width, 3), got {single.shape}, {np.shape(variance)}")
    if single.shape[1] > _WIDEST_REFERENCE:
        raise ValueError(f"a reference is at most {_WIDEST_REFERENCE} pixels wide, got {single.shape[1]}")
    buffer = io.BytesIO()
    text = np.array(json.dumps(dict(settings), sort_keys=True))
    np.savez_compressed(buffer, mean=single, variance=np.asarray(variance, dtype=np.float32), settings=text)
    write_bytes(path, buffer.getvalue())


def load_reference(path: str | Path) -> Reference:
    """Read what `save_reference` wrote; the arrays are float64 with the precision of float32.

    Raises
    ------
    InputError : the file is missing or broken.
    """
    try:
        with np.load(io.BytesIO(Path(path).read_bytes()), allow_pickle=False) as file:
            mean, variance = (np.asarray(file[name], dtype=np.float64) for name in ("mean", "variance"))
            return Reference(mean, variance, json.loads(str(file["settings"])))
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file") from error
    except MemoryError:
        raise
    except Exception as error:
        raise InputError(f"{path}: broken, or not a reference image") from error
