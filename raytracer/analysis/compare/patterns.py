"""Patterns in the difference of two images: brightness, shift and blur too small to see in single pixels.

And the least of them that would have been found.

The difference d of two images is projected on what it would be if one were a little brighter (their mean m itself),
shifted (its derivatives) or blurred (its Laplacian, in three bands), in the whole and in tiles.  Under the hypothesis
that both are of one scene, the difference of a pixel is as likely to have one sign as the other, and pixels are
independent of each other.  So a sum of c_i has the variance of sum c_i^2, of whatever noise: this holds for
stratified and Sobol' samples too, for which the variance within a pixel is too large.  Where the images are of as many
samples of the same sampler this holds exactly (a randomisation test by signs), and the tail of the normal distribution
times 3.18 bounds that of the sum divided by its standard deviation, however few terms decide it.

Weights and filters of a pixel must not depend on its d: weights come from the variances of its neighbours, filters from
the means around it.  In like images they may have its own mean, which does not depend on the sign of d.

The same signs make products of neighbouring differences independent and symmetric, along a row or a column: their sum
is the squared difference of the picture, less all that noise adds to it (`neighbour_z`).

References: Fisher 1935, "The Design of Experiments", section 21 (randomisation); Efron 1969, "Student's t-Test under
Symmetry Conditions", Journal of the American Statistical Association 64(328); Bentkus and Dzindzalieta 2015, "A tight
Gaussian bound for weighted sums of Rademacher random variables", Bernoulli 21(2), theorem 1.1 (the bound); Turin 1960,
"An Introduction to Matched Filters", IRE Transactions on Information Theory 6(3).
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.analysis.compare.image_pair import ROUNDING, ImagePair, map_row_bands, tile_sums
from raytracer.analysis.compare.matched_filters import HALO, fine_filters, nearby, wide_filters

Array = NDArray[np.float64]

PATTERNS = (
    "brightness_red",
    "brightness_green",
    "brightness_blue",
    "shift_x",
    "shift_y",
    "blur_1px",
    "blur_2px",
    "blur_4px",
)
"""Patterns that a difference is projected on, in the order of `Projections.sums`."""

SCALES = (1, 2, 4, 8)
"""Edges of the squares whose sums are multiplied with those of their neighbours (px)."""

POWER = 0.9
"""Power of the tests at their limits: the part of such differences that is found."""

# 1 / (4 P(N > sqrt 2)), of a normal N: the least factor for all sums (Bentkus and Dzindzalieta 2015).
_SYMMETRIC = 1.0 / (2.0 * math.erfc(1.0))

_BRIGHTNESS = slice(0, 3)
_SHIFTS = slice(3, 5)
_BLUR = PATTERNS.index("blur_1px")

# Rows of a band: its halo of 26 is a fifth of them, and it stays in the processor's caches.
ROWS = 128


class Projections(NamedTuple):
    """Sums over the picture, or over tiles, of the difference projected on `PATTERNS`: each (..., 8).

    sums : of the projection.
    variances : of these, by noise.
    responses : what a sum is for one unit of its pattern: all the light once more; 1 px; for blur of 1 px, what is
        made by convolving with a Gaussian of the variance 1 px^2; 0 for the wider bands.
    squares : sums of the squared responses of pixels.
    """

    sums: Array
    variances: Array
    responses: Array
    squares: Array

    def z(self) -> Array:
        """Divide the sums by their standard deviations; 0 where there is no noise and no difference beyond rounding."""
        deviation = np.sqrt(self.variances)
        # What float64 cannot hold fails as single pixels.
        known = (deviation > 0.0) & np.isfinite(self.sums) & np.isfinite(deviation)
        return np.divide(self.sums, deviation, out=np.zeros_like(self.sums), where=known)

    def amounts(self) -> Array:
        """Estimate the amount of each pattern, in its unit; nan where there is none to be seen."""
        unknown = np.full_like(self.sums, math.nan)
        return np.divide(self.sums, self.responses, out=unknown, where=self.responses > 0.0)

    def detectable_amounts(self, z: float) -> Array:
        """Find the amount of each pattern that has an expected score of `z`; inf where none has.

        A difference adds to the variance that is estimated from it: k^2 (V + x^2 Q) = x^2 R^2.
        """
        with np.errstate(invalid="ignore", over="ignore"):
            left = self.responses**2 - z**2 * self.squares
            seen = (self.responses > 0.0) & (left > 0.0) & np.isfinite(left)
            needed = np.sqrt(np.divide(z**2 * self.variances, left, out=np.zeros_like(left), where=seen))
        return np.where(seen, needed, math.inf)


class Structure(NamedTuple):
    """Structure of a difference, which noise does not have.

    whole : `Projections` of the whole picture, (8,).
    tiles : of its tiles, (rows, columns, 8).
    neighbour_z : (4, 2), sums of products of neighbours, down and across, at the distances `SCALES`.
    squares_z : the sum of the squared differences less their variances, in its standard deviations.
    squares_ratio : squared differences over their variances, weighted; nan without noise.
    """

    whole: Projections
    tiles: Projections
    neighbour_z: Array
    squares_z: float
    squares_ratio: float


class _Sums(NamedTuple):
    """Sums over a band of rows.

    fields : (rows, columns, 8) by tiles, in the order of `Projections`.
    differences, variances : weighted, summed over squares of 2 px.
    products : (2, 2), sums of products of neighbours at 1 px and their variances, down and across.
    squares : (4,), of d^2 - v, its square, d^2 and v, weighted.
    """

    fields: tuple[Array, Array, Array, Array]
    differences: Array
    variances: Array
    products: Array
    squares: Array


class _Band(NamedTuple):
    """Rows of a pair with a halo, in units of the typical noise of each channel: (rows, columns, 3).

    difference, variance : of a - b; the variance pooled, so that it is no smaller than either image says.
    summed : the variances of a and b added, as they are: right in the mean over pixels.
    mean : of both, weighted by their samples.
    noise_part : variance of the mean over that of the difference.
    nearby : mean variance of the eight pixels around.
    """

    difference: Array
    variance: Array
    summed: Array
    mean: Array
    noise_part: float
    nearby: Array


@np.errstate(invalid="ignore", over="ignore")
def find_structure(pair: ImagePair, ratio: float, *, alike: bool, tile: int) -> Structure:
    """Look for patterns in the difference of two images.

    Parameters
    ----------
    ratio : variance of a over that of b, of the same scene; 0 if not known.
    alike : True if both have as many samples of the same sampler, so that differences are symmetric.  If they have
        not, variances are taken no smaller than those of the pixels.
    tile : edge of the tiles (px), even.
    """
    height = len(pair.a)
    rows = max(ROWS // tile, 1) * tile
    deviations = map_row_bands(lambda top, bottom: _deviation_sums(pair, ratio, top, bottom), height, rows)
    typical = np.sum(deviations, axis=0) / (pair.a.shape[0] * pair.a.shape[1])
    bands = map_row_bands(
        lambda top, bottom: _sums(pair, ratio, typical, (top, bottom), alike=alike, tile=tile), height, rows
    )
    fields = [np.concatenate(parts) for parts in zip(*(band.fields for band in bands), strict=True)]
    squares = np.sum([band.squares for band in bands], axis=0)
    return Structure(
        Projections(*(values.sum(axis=(0, 1)) for values in fields)),
        Projections(*fields),
        _neighbour_z(bands, alike=alike),
        _score(float(squares[0]), float(squares[1])),
        float(squares[2] / squares[3]) if 0.0 < squares[3] < math.inf else math.nan,
    )


def _score(total: float, variance: float) -> float:
    return total / math.sqrt(variance) if variance > 0.0 and math.isfinite(total) and math.isfinite(variance) else 0.0


# ---- bands and their filters


def _mirrored(start: int, stop: int, size: int) -> NDArray[np.int64]:
    """List the indices of an axis, mirrored at its ends such that a pixel is not its own neighbour."""
    period = max(2 * (size - 1), 1)
    index = np.abs(np.arange(start, stop)) % period
    return np.where(index >= size, period - index, index)


def _with_halo(pair: ImagePair, top: int, bottom: int) -> ImagePair:
    height, width, _ = pair.a.shape
    rows, columns = _mirrored(top - HALO, bottom + HALO, height), _mirrored(-HALO, width + HALO, width)
    a, var_a, b, var_b = (np.ascontiguousarray(values[rows[:, None], columns]) for values in pair)
    finite = np.isfinite(a - b)
    if not finite.all():
        # They fail as single pixels; nothing around them is to be lost.
        a, b = np.where(finite, a, 0.0), np.where(finite, b, 0.0)
    return ImagePair(a, var_a, b, var_b)


def _inside(values: Array) -> Array:
    return values[HALO:-HALO, HALO:-HALO]


@np.errstate(invalid="ignore", over="ignore")
def _deviation_sums(pair: ImagePair, ratio: float, top: int, bottom: int) -> Array:
    """Sum the standard deviations of the differences in a band (3,), each told by its neighbours."""
    padded = _with_halo(pair, top, bottom)
    return np.asarray(np.sqrt(_inside(nearby(padded.variance_of_difference(ratio)))).sum(axis=(0, 1)))


def _band(pair: ImagePair, ratio: float, typical: Array, top: int, bottom: int) -> _Band:
    """Prepare the rows top..bottom-1; a channel without noise is left out, as single pixels tell all of it."""
    padded = _with_halo(pair, top, bottom)
    unit = np.divide(1.0, typical, out=np.zeros_like(typical), where=typical > 0.0)
    a, b = padded.a * unit, padded.b * unit
    var_a, var_b = padded.var_a * unit**2, padded.var_b * unit**2
    # Of b in the mean of both: all of it where nothing but a is noisy.
    share = ratio / (1.0 + ratio) if ratio > 0.0 else float(not pair.var_b.any())
    variance = padded.variance_of_difference(ratio) * unit**2
    return _Band(
        difference=padded.difference() * unit,
        variance=variance,
        summed=var_a + var_b,
        mean=a + share * (b - a),
        noise_part=share * (1.0 - share),
        nearby=nearby(variance),
    )


def _filters(band: _Band, *, alike: bool) -> Iterator[tuple[Array, Array]]:
    """Make the filter of each pattern but brightness.

    Yields
    ------
    matched filter ; its product with what one unit of the pattern makes of the mean, without what noise adds to that.
    """
    of_mean, of_noise = (fine_filters(values, alike=alike) for values in (band.mean, band.difference))
    for (pattern, made), (noise, noise_made) in zip(of_mean, of_noise, strict=True):
        # Unbiased whatever the noise is, as products of the one image with the other are: these are independent.
        yield pattern, pattern * made - band.noise_part * noise * noise_made
    for pattern in wide_filters(band.mean, alike=alike):
        yield pattern, np.zeros_like(pattern)


# ---- sums


@np.errstate(invalid="ignore", over="ignore")
def _sums(pair: ImagePair, ratio: float, typical: Array, place: tuple[int, int], *, alike: bool, tile: int) -> _Sums:
    """Sum the projections, products and squares of a band of rows (top, bottom)."""
    top, bottom = place
    band = _band(pair, ratio, typical, top, bottom)
    weight, difference, summed = (_inside(v) for v in (1.0 / (1.0 + band.nearby), band.difference, band.summed))
    excess = np.sum(weight * (difference**2 - summed), axis=2)
    squares = [excess, excess**2, weight * difference**2, weight * summed]

    # One row more, for what is below the last.
    rows = slice(HALO, -HALO if bottom == len(pair.a) else 1 - HALO)
    around, variance = (values[rows, HALO:-HALO] for values in (band.nearby, band.variance))
    # Of alike images the pixel's own variance is as good, and keeps a bright rare sample from deciding all.
    weights = 1.0 / (1.0 + (np.maximum(around, variance) if alike else around))
    whitened = band.difference[rows, HALO:-HALO] * np.sqrt(weights)
    expected = variance * weights
    count = bottom - top
    return _Sums(
        _projected(band, weight, alike=alike, tile=tile),
        tile_sums(whitened[:count], SCALES[1]),
        tile_sums(expected[:count], SCALES[1]),
        np.stack(
            [
                _products(whitened, expected, 0, alike=alike),
                _products(whitened[:count], expected[:count], 1, alike=alike),
            ]
        ),
        np.array([values.sum() for values in squares]),
    )


def _projected(band: _Band, weight: Array, *, alike: bool, tile: int) -> tuple[Array, Array, Array, Array]:
    """Project the difference on each pattern: sums over tiles as in `Projections`."""
    difference, deviation = _inside(band.difference), np.sqrt(_inside(band.variance))
    projected, known, response = (np.zeros((*weight.shape[:2], len(PATTERNS))) for _ in range(3))
    near = weight * _inside(nearby(band.mean))
    projected[..., :3], known[..., :3] = near * difference, np.abs(near) * deviation
    response[..., :3] = near * _inside(band.mean)
    for which, (pattern, product) in enumerate(_filters(band, alike=alike), start=3):
        matched = weight * _inside(pattern)
        projected[..., which] = np.sum(matched * difference, axis=2)
        known[..., which] = np.sum(np.abs(matched) * deviation, axis=2)
        response[..., which] = np.sum(weight * _inside(product), axis=2)
    variances = tile_sums(projected**2, tile)
    if not alike:
        variances = np.maximum(variances, tile_sums(known**2, tile))
    return tile_sums(projected, tile), variances, tile_sums(response, tile), tile_sums(response**2, tile)


def _products(differences: Array, variances: Array, axis: int, *, alike: bool) -> Array:
    """Sum the products of neighbours along an axis, and estimate the variance of that: (2,)."""
    first, second = (slice(None),) * axis + (slice(-1),), (slice(None),) * axis + (slice(1, None),)
    products = np.sum(differences[first] * differences[second], axis=2)
    variance = float(np.sum(products**2))
    if not alike:
        known = np.sqrt(variances[first] * variances[second])
        variance = max(variance, float(np.sum(np.sum(known, axis=2) ** 2)))
    return np.array([products.sum(), variance])


@np.errstate(invalid="ignore", over="ignore")
def _neighbour_z(bands: list[_Sums], *, alike: bool) -> Array:
    """Score the products of neighbours: (4, 2), by `SCALES`, down and across."""
    scores = [np.sum([band.products for band in bands], axis=0)]
    differences = np.concatenate([band.differences for band in bands])
    variances = np.concatenate([band.variances for band in bands])
    for _ in SCALES[1:]:
        scores.append(np.stack([_products(differences, variances, axis, alike=alike) for axis in (0, 1)]))
        differences, variances = tile_sums(differences, 2), tile_sums(variances, 2)
    return np.array([[_score(float(total), float(variance)) for total, variance in pair] for pair in scores])


# ---- Detection limits


class DetectionLimits(NamedTuple):
    """Least differences that are found 9 times of 10; inf for what is never found.

    brightness : of all light, as a fraction.
    tile_brightness : of the light in a tile, as a fraction: the median over tiles.
    tile : edge of these tiles (px).
    shift : of the whole picture (px), along the less sensitive axis.
    blur : of the whole picture, standard deviation of a Gaussian (px).
    """

    brightness: float
    tile_brightness: float
    tile: int
    shift: float
    blur: float

    def sentence(self) -> str:
        """Describe the smallest differences that would have been found; "" if nothing is known."""
        is_known = math.isfinite(self.brightness)
        whole = f"brightness over {100.0 * self.brightness:.2g} % in the whole" if is_known else ""
        parts = ", ".join(filter(None, (whole, self.details())))
        return f"would have found, {10.0 * POWER:.0f} times of 10: {parts}" if parts else ""

    def details(self) -> str:
        """Write the limits of all but the brightness of the whole."""
        in_tiles = f"{100.0 * self.tile_brightness:.2g} % in a tile of {self.tile} px (half of the tiles)"
        parts = {
            in_tiles: self.tile_brightness,
            f"a shift over {self.shift:.2g} px": self.shift,
            f"a blur over {self.blur:.2g} px": self.blur,
        }
        return ", ".join(part for part, limit in parts.items() if math.isfinite(limit))


def symmetric_tail(z: float) -> float:
    """Bound the probability that |sum s_i c_i| / sqrt(sum c_i^2) is at least `z`, of random signs s_i and any c_i.

    References: Bentkus and Dzindzalieta 2015, "A tight Gaussian bound for weighted sums of Rademacher random
        variables", Bernoulli 21(2), theorem 1.1.
    """
    return min(1.0, _SYMMETRIC * math.erfc(z / math.sqrt(2.0)))


def detection_limits(structure: Structure, alpha: float, tile: int) -> DetectionLimits:
    """Find the least differences that tests of the level `alpha` each find.

    tile : edge of the tiles of `structure` (px).
    """
    whole = _limits(structure.whole, alpha)
    in_tiles = _limits(structure.tiles, alpha)[..., _BRIGHTNESS].min(axis=-1)
    # A tile without any light can be no brighter.
    lit = np.any(structure.tiles.responses[..., _BRIGHTNESS] > 0.0, axis=-1)
    return DetectionLimits(
        brightness=float(whole[_BRIGHTNESS].min()),
        tile_brightness=float(np.median(in_tiles[lit])) if lit.any() else math.inf,
        tile=tile,
        shift=float(whole[_SHIFTS].max()),
        blur=math.sqrt(float(whole[_BLUR])),
    )


def _limits(projections: Projections, alpha: float) -> Array:
    """Find the amounts that are found with the probability `POWER`, by one of the tests of a level together."""
    from scipy.special import ndtri

    each = -math.expm1(math.log1p(-alpha) / projections.sums.size)
    z = float(-ndtri(0.5 * each / _SYMMETRIC) + ndtri(POWER))
    return np.maximum(projections.detectable_amounts(z), ROUNDING)
