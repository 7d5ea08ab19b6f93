"""Test of two noisy images for being of the same scene.

Two renders of one scene differ by their noise, which each knows: the variance of its pixels.  `z_test` asks whether
they differ by more than that.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raytracer.analysis.compare.image_pair import ROWS, ImagePair, make_image_pair, map_row_bands, tile_sums
from raytracer.analysis.compare.patterns import (
    PATTERNS,
    SCALES,
    DetectionLimits,
    Structure,
    detection_limits,
    find_structure,
    symmetric_tail,
)

Array = NDArray[np.float64]

TEST_LABELS = {
    "mean": "means of the channels",
    "tile": "means of tiles",
    "pixel": "single pixels",
    "exceeding": "pixels beyond 2 standard deviations",
    "pattern": "brightness, shift and blur of the whole",
    "pattern_tile": "brightness, shift and blur of tiles",
    "neighbour": "products of neighbouring differences",
    "squares": "squared differences against the noise",
}
"""Subject of each test, by the name of its p."""

TESTS = len(TEST_LABELS)
"""Number of tests that share the significance level, each with the same part of it."""

# Standard deviations beyond which pixels are counted; normal noise puts 4.55 % there.
_COUNTED_BEYOND = 2.0

_CHANNELS = ("red", "green", "blue")

# Words for the first image if the score of a pattern is above 0, and if it is below.
_WORDS = {
    **{f"brightness_{channel}": (f"brighter in {channel}", f"darker in {channel}") for channel in _CHANNELS},
    "shift_x": ("shifted to the right", "shifted to the left"),
    "shift_y": ("shifted down", "shifted up"),
    **{f"blur_{size}px": (f"softer in details of {size} px", f"sharper in details of {size} px") for size in (1, 2, 4)},
}


@dataclass(frozen=True)
class Verdict:
    """Result of `z_test`.  Every z is of the first image less the second, in standard deviations of the difference.

    Every p is the probability that noise alone makes the largest of the values it belongs to as large as it is.

    Attributes
    ----------
    passed : True if every p is at least the significance level over `TESTS`.
    reason : one sentence: the first test that failed, or how near the images are.
    mean_z, mean_p : (3,), means of the channels.
    tile_z, tile_p : (rows, columns, 3), means of square tiles.
    pixel_z, pixel_p : (height, width, 3); that of a pixel is of a variance no smaller than the mean of its tile.
    exceeding, exceeding_p : (3,), fraction of the pixels with a |z| above 2, which is 0.0455 for normal noise.
    pattern_z, pattern_p : (8,), projections of the whole difference on `patterns.PATTERNS`: brightness of the channels,
        shift to the right and downwards, blur of three widths.
    pattern_tile_z, pattern_tile_p : (rows, columns, 8), those of tiles with twice the edge of those of `tile_z`.
    neighbour_z, neighbour_p : (4, 2), products of differences 1, 2, 4 and 8 pixels apart, down and across.
    squares_z, squares_p : sum of the squared differences less their variances, in its own standard deviations, of which
        only large values count.
    squares_ratio : squared differences over their variances; below 1, noise is less than the variances.
    findings : sentences, one for each test that failed.
    limits : least differences that would have been found.
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
    pattern_z: Array
    pattern_p: float
    pattern_tile_z: Array = field(repr=False)
    pattern_tile_p: float
    neighbour_z: Array
    neighbour_p: float
    squares_z: float
    squares_p: float
    squares_ratio: float
    findings: tuple[str, ...]
    limits: DetectionLimits

    def p_values(self) -> dict[str, float]:
        """Name the p of each test, as `TEST_LABELS` does."""
        return {name: float(getattr(self, f"{name}_p")) for name in TEST_LABELS}


def _any_of(p: float, tests: int) -> float:
    """Compute the probability that the least p of independent tests is at most `p` (Šidák 1967)."""
    return -math.expm1(tests * math.log1p(-p)) if p < 1.0 else 1.0


def _p_of_largest(z: Array) -> float:
    """Compute the probability that the farthest from 0 of as many normal values is as far as that of `z`."""
    return _any_of(math.erfc(float(np.abs(z).max()) / math.sqrt(2.0)), z.size)


def _p_of_largest_sum(z: Array) -> float:
    """Bound the p of the largest of sums of symmetric terms over the root of their squares' sum; 1 without any."""
    return _any_of(symmetric_tail(float(np.abs(z).max())), z.size) if z.size else 1.0


def _p_of_exceeding(exceeding: Array, pixels: int) -> float:
    """Compute the probability that a channel has as many pixels beyond `_COUNTED_BEYOND` as the one with the most."""
    from scipy.special import bdtrc

    most = round(float(exceeding.max()) * pixels)
    beyond = math.erfc(_COUNTED_BEYOND / math.sqrt(2.0))
    p = float(bdtrc(most - 1, pixels, beyond)) if most else 1.0
    return _any_of(p, exceeding.size)


class _Means(NamedTuple):
    """Means of the whole image and of tiles, with the scores of their differences; and the ratio of the variances."""

    whole: ImagePair
    tiles: ImagePair
    whole_z: Array
    tile_z: Array
    ratio: float


def _compare_means(pair: ImagePair, cells: Array, tile: int, rows: int, ratio: float | None) -> _Means:
    """Compare means of the channels and of tiles of so many `cells` (rows, columns, 1)."""
    height, width, _ = pair.a.shape
    with np.errstate(invalid="ignore", over="ignore"):
        sums = map_row_bands(lambda top, bottom: [tile_sums(v, tile) for v in pair.rows(top, bottom)], height, rows)
        of_tiles = ImagePair(*(np.concatenate(parts) for parts in zip(*sums, strict=True)))
        whole = ImagePair(*(values.sum(axis=(0, 1)) for values in of_tiles)).means(height * width)
        tiles = of_tiles.means(cells)
        shares = of_tiles.ratio() if ratio is None else ratio
        whole_z = whole.z(whole.variance_of_difference(shares))
        tile_z = tiles.z(tiles.variance_of_difference(shares))
    return _Means(whole, tiles, whole_z, tile_z, shares)


def _compare_pixels(pair: ImagePair, cells: Array, tile: int, rows: int, ratio: float) -> tuple[Array, Array]:
    """Score single pixels (height, width, 3), and find the fractions (3,) of those beyond the limit."""
    height, width, _ = pair.a.shape
    pixel_z = np.empty_like(pair.a)

    def fill(top: int, bottom: int) -> NDArray[np.int64]:
        """Fill in a band of `pixel_z`, and count what is beyond the limit in each channel."""
        band = pair.rows(top, bottom)
        variance = band.variance_of_difference(ratio)
        # A pixel's own variance, from few samples, may be far too small; that of its neighbours shows this.
        of_tile = tile_sums(variance, tile) / cells[top // tile : -(-bottom // tile)]
        of_tile = np.repeat(np.repeat(of_tile, tile, axis=0), tile, axis=1)[: bottom - top, :width]
        with np.errstate(invalid="ignore", over="ignore"):
            z = band.z(np.where(variance > 0.0, np.maximum(variance, of_tile), 0.0))
        pixel_z[top:bottom] = z
        counts: NDArray[np.int64] = np.count_nonzero(np.abs(z) > _COUNTED_BEYOND, axis=(0, 1))
        return counts

    return pixel_z, np.sum(map_row_bands(fill, height, rows), axis=0) / (height * width)


def z_test(
    a: ArrayLike,
    var_a: ArrayLike | None,
    b: ArrayLike,
    var_b: ArrayLike | None,
    tile: int = 8,
    alpha: float = 1e-3,
    ratio: float | None = None,
    *,
    alike: bool = False,
) -> Verdict:
    """Test the hypothesis that two images differ by their noise only.

    Eight tests share the significance level evenly, each with a correction for how often it is made: the mean of a
    channel, the means of tiles, single pixels, and the number of pixels beyond two standard deviations; projections of
    the difference on more light, a shift and a blur (`patterns`), in the whole and in tiles; products of neighbouring
    differences; and the sum of squared differences against what the variances say.
    Means and projections are the most sensitive, since the noise of a pixel is far from normal and its variance itself
    is noisy; the others find differences that do not change these.  Values that agree to 1e-6 of their size agree, so
    that pixels without noise must be equal to that.  This takes some 16 samples per pixel: of 4, all may agree by
    chance on an edge.

    Parameters
    ----------
    a, b : images (height, width, 3), float64.
    var_a, var_b : variances of the pixels' means, of the same shape; None for an image without noise.
        An image without noise must be exact: a rare sample that the other has missed so far looks like a difference.
    tile : width and height of a tile in pixels; tiles of projections are twice as wide.
    alpha : rate at which two renders of one scene may fail.
    ratio : variance of a over that of b, of the same scene: the samples of b over those of a, where they are known.
        By default the median ratio of the tiles.
    alike : True if both images have the same number of samples from the same sampler.  Projections and products then
        take their noise from the difference itself, which is sharper where the sampler makes less noise than the
        variance within its pixels tells (stratified, sobol).

    Raises
    ------
    InputError : the shapes differ, or a variance is negative or not finite.
    """
    pair = make_image_pair(a, var_a, b, var_b)
    height, width, _ = pair.a.shape
    cells = tile_sums(np.ones((height, width, 1)), tile)
    # Bands of whole tiles.
    rows = max(ROWS // tile, 1) * tile
    means = _compare_means(pair, cells, tile, rows, 1.0 if alike and ratio is None else ratio)
    pixel_z, exceeding = _compare_pixels(pair, cells, tile, rows, means.ratio)
    structure = find_structure(pair, means.ratio, alike=alike, tile=2 * tile)
    pattern_z, pattern_tile_z = structure.whole.z(), structure.tiles.z()
    verdict = Verdict(
        passed=False,
        reason="",
        mean_z=means.whole_z,
        mean_p=_p_of_largest(means.whole_z),
        tile_z=means.tile_z,
        tile_p=_p_of_largest(means.tile_z),
        pixel_z=pixel_z,
        pixel_p=_p_of_largest(pixel_z),
        exceeding=exceeding,
        exceeding_p=_p_of_exceeding(exceeding, height * width),
        pattern_z=pattern_z,
        pattern_p=_p_of_largest_sum(pattern_z),
        pattern_tile_z=pattern_tile_z,
        pattern_tile_p=_p_of_largest_sum(pattern_tile_z),
        neighbour_z=structure.neighbour_z,
        neighbour_p=_p_of_largest_sum(structure.neighbour_z),
        squares_z=structure.squares_z,
        squares_p=0.5 * math.erfc(structure.squares_z / math.sqrt(2.0)),
        squares_ratio=structure.squares_ratio,
        findings=(),
        limits=detection_limits(structure, alpha / TESTS, 2 * tile),
    )
    findings = tuple(_findings(verdict, pair, means, structure, tile, alpha))
    if findings:
        return replace(verdict, reason=findings[0], findings=findings)
    z = ", ".join(f"{z:.1f}" for z in means.whole_z)
    return replace(verdict, passed=True, reason=f"no difference beyond the noise: z of the means {z}")


# ---- sentences


def _percent(a: float, b: float) -> str:
    change = (float(a) - float(b)) / float(b) if b else math.nan
    return f"{a:.6g} against {b:.6g}" + (f" ({change:+.2%})" if math.isfinite(change) else "")


def _largest(z: Array) -> tuple[int, ...]:
    return tuple(int(i) for i in np.unravel_index(np.argmax(np.abs(z)), z.shape))


def _findings(
    verdict: Verdict, pair: ImagePair, means: _Means, structure: Structure, tile: int, alpha: float
) -> Iterator[str]:
    """Describe the finding of each test that failed, those first that name a place or an amount."""
    failed = {name for name, p in verdict.p_values().items() if not p >= alpha / TESTS}
    if not (np.isfinite(pair.a).all() and np.isfinite(pair.b).all()):
        yield "an image holds values that are not finite"
    if "mean" in failed:
        (c,) = _largest(means.whole_z)
        yield (
            f"the mean of {_CHANNELS[c]} differs: {_percent(means.whole.a[c], means.whole.b[c])}, "
            f"z = {means.whole_z[c]:.1f}"
        )
    if "tile" in failed:
        y, x, c = at = _largest(means.tile_z)
        yield (
            f"the mean of {_CHANNELS[c]} differs in the tile at x = {x * tile}, y = {y * tile}: "
            f"{_percent(means.tiles.a[at], means.tiles.b[at])}, z = {means.tile_z[at]:.1f}"
        )
    if "pixel" in failed:
        y, x, c = at = _largest(verdict.pixel_z)
        yield (
            f"{_CHANNELS[c]} differs in the pixel at x = {x}, y = {y}: "
            f"{_percent(pair.a[at], pair.b[at])}, z = {verdict.pixel_z[at]:.1f}"
        )
    if "pattern" in failed:
        (which,) = _largest(verdict.pattern_z)
        amount = float(structure.whole.amounts()[which])
        yield f"the whole {pattern_words(which, amount, verdict.pattern_z[which])}"
    if "pattern_tile" in failed:
        y, x, which = at = _largest(verdict.pattern_tile_z)
        amount = float(structure.tiles.amounts()[at])
        place = f"the tile of {2 * tile} px at x = {2 * x * tile}, y = {2 * y * tile}"
        yield f"{place} {pattern_words(which, amount, verdict.pattern_tile_z[at])}"
    if "neighbour" in failed:
        which, axis = at = _largest(verdict.neighbour_z)
        z = verdict.neighbour_z[at]
        yield (
            f"differences {'across' if axis else 'down'} {SCALES[which]} px are "
            f"{'alike' if z > 0.0 else 'opposite'}, and not independent as noise is, z = {z:.1f}"
        )
    if "squares" in failed:
        yield (
            f"squared differences are {verdict.squares_ratio:.3g} times what noise makes, z = {verdict.squares_z:.1f}"
        )
    if "exceeding" in failed:
        c = int(np.argmax(verdict.exceeding))
        expected = math.erfc(_COUNTED_BEYOND / math.sqrt(2.0))
        yield (
            f"{verdict.exceeding[c]:.1%} of the pixels differ by over 2 standard deviations, "
            f"where noise has {expected:.1%}"
        )


def pattern_words(which: int, amount: float, z: float) -> str:
    """Say what the largest of the projections is: `which` of `PATTERNS`, its estimated amount, and its score."""
    name = PATTERNS[which]
    what = f"is {_WORDS[name][0 if z > 0.0 else 1]}"
    if math.isfinite(amount) and name.startswith("brightness"):
        what += f" by {abs(amount):.2%}"
    elif math.isfinite(amount) and name.startswith("shift"):
        what += f" by {abs(amount):.2g} px"
    return f"{what}, z = {z:.1f}"
