"""Whether two noisy images are of the same scene.

Two renders of one scene differ by their noise, which each knows: the variance of its pixels.  `z_test` asks whether
they differ by more than that.
"""

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raytracer.comparison.bands import ROWS, over_bands
from raytracer.comparison.sizes import check_sizes
from raytracer.errors import InputError

Array = NDArray[np.float64]

# What rounding may differ by, relative to the values: hits found in float32 (2^-24), added up over a path.
_ROUNDING = 1e-6

# Standard deviations beyond which pixels are counted; normal noise puts 4.55 % there.
_COUNTED_BEYOND = 2.0

_CHANNELS = ("red", "green", "blue")


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
    tile_z: Array = field(repr=False)
    tile_p: float
    pixel_z: Array = field(repr=False)
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
    # Here, since threads do not take over what their caller ignores.
    with np.errstate(invalid="ignore", over="ignore"):
        rows = np.add.reduceat(values, np.arange(0, values.shape[0], tile), axis=0)
        return np.add.reduceat(rows, np.arange(0, values.shape[1], tile), axis=1)


class _Pair(NamedTuple):
    """Two images, or means over equal parts of them, with the variances of both."""

    a: Array
    var_a: Array
    b: Array
    var_b: Array

    def rows(self, top: int, bottom: int) -> "_Pair":
        return _Pair(*(values[top:bottom] for values in self))

    def means(self, cells: Array | int) -> "_Pair":
        """Means of parts, whose sums these are, of as many values as `cells` says."""
        return _Pair(self.a / cells, self.var_a / cells**2, self.b / cells, self.var_b / cells**2)

    def ratio(self) -> float:
        """How many times that of b the variance of a is, in the median part; 0 if one of them is without noise.

        Not that of the totals, which one bright rare sample is enough to decide.
        """
        known = (self.var_a > 0.0) & (self.var_b > 0.0)
        return float(np.median(self.var_a[known] / self.var_b[known])) if known.any() else 0.0

    def variance_of_difference(self, ratio: float) -> Array:
        """Variance of a - b, under the hypothesis that both are of one scene.

        It is var_a + var_b, but a pixel in which rare bright samples have not turned up yet takes itself to be
        free of noise.  If b has r times as many samples, its variance tells what that of a should be, and the other
        way round: the pooled estimate of Student's two-sample test is var_a / r + r var_b.  The larger one is
        taken, with r = `ratio`.
        """
        summed = self.var_a + self.var_b
        if ratio == 0.0:
            return summed
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
    check_sizes(first, second)
    variances = []
    for image, given in ((first, var_a), (second, var_b)):
        variance = np.zeros_like(image) if given is None else np.asarray(given, dtype=np.float64)
        if variance.shape != image.shape:
            raise InputError(f"a variance of the shape {variance.shape} for an image of the shape {image.shape}")
        if not np.all(np.isfinite(variance) & (variance >= 0.0)):
            raise InputError("a variance is not known everywhere: it takes two samples in every pixel")
        variances.append(variance)
    return _Pair(first, variances[0], second, variances[1])


def _percent(a: float, b: float) -> str:
    change = (float(a) - float(b)) / float(b) if b else math.nan
    return f"{a:.6g} against {b:.6g}" + (f" ({change:+.2%})" if math.isfinite(change) else "")


def _largest(z: Array) -> tuple[int, ...]:
    return tuple(int(i) for i in np.unravel_index(np.argmax(np.abs(z)), z.shape))


def z_test(
    a: ArrayLike,
    var_a: ArrayLike | None,
    b: ArrayLike,
    var_b: ArrayLike | None,
    tile: int = 8,
    alpha: float = 1e-3,
    ratio: float | None = None,
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
    ratio : how many times that of b the variance of a is, of the same scene: the samples of b over those of a, where
        they are known.  By default the median of what the tiles say.

    Raises
    ------
    InputError : the shapes differ, or a variance is negative or not finite.
    """
    pair = _checked(a, var_a, b, var_b)
    height, width, _ = pair.a.shape
    cells = _tile_sums(np.ones((height, width, 1)), tile)
    # Bands of whole tiles.
    rows = max(ROWS // tile, 1) * tile
    pixel_z = np.empty_like(pair.a)

    with np.errstate(invalid="ignore", over="ignore"):
        # Compare means of everything, then of tiles.
        sums = over_bands(lambda top, bottom: [_tile_sums(v, tile) for v in pair.rows(top, bottom)], height, rows)
        of_tiles = _Pair(*(np.concatenate(parts) for parts in zip(*sums, strict=True)))
        whole = _Pair(*(values.sum(axis=(0, 1)) for values in of_tiles)).means(height * width)
        tiles = of_tiles.means(cells)
        shares = of_tiles.ratio() if ratio is None else ratio
        mean_z = whole.z(whole.variance_of_difference(shares))
        tile_z = tiles.z(tiles.variance_of_difference(shares))

    def compare_pixels(top: int, bottom: int) -> NDArray[np.int64]:
        """Fill in a band of `pixel_z`, and count what is beyond the limit in each channel."""
        band = pair.rows(top, bottom)
        variance = band.variance_of_difference(shares)
        # A pixel's own variance, from few samples, may be far too small, which that of its neighbours tells.
        of_tile = _tile_sums(variance, tile) / cells[top // tile : -(-bottom // tile)]
        of_tile = np.repeat(np.repeat(of_tile, tile, axis=0), tile, axis=1)[: bottom - top, :width]
        with np.errstate(invalid="ignore", over="ignore"):
            z = band.z(np.where(variance > 0.0, np.maximum(variance, of_tile), 0.0))
        pixel_z[top:bottom] = z
        counts: NDArray[np.int64] = np.count_nonzero(np.abs(z) > _COUNTED_BEYOND, axis=(0, 1))
        return counts

    exceeding = np.sum(over_bands(compare_pixels, height, rows), axis=0) / (height * width)

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
