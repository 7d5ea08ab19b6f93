"""Detection limits of a comparison of two noisy images: the least differences that it would have found."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from raytracer.analysis.compare.image_pair import ROUNDING
from raytracer.analysis.compare.patterns import PATTERNS, Projections, Structure

POWER = 0.9
"""Power of the tests at their limits: the part of such differences that is found."""

# 1 / (4 P(N > sqrt 2)), of a normal N: the least factor for all sums (Bentkus and Dzindzalieta 2015).
_SYMMETRIC = 1.0 / (2.0 * math.erfc(1.0))

_BRIGHTNESS = slice(0, 3)
_SHIFTS = slice(3, 5)
_BLUR = PATTERNS.index("blur_1px")


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
        whole = [f"brightness over {_percent(self.brightness)} in the whole"] if math.isfinite(self.brightness) else []
        parts = ", ".join([*whole, *self._details()])
        return f"would have found, {10.0 * POWER:.0f} times of 10: {parts}" if parts else ""

    def details(self) -> str:
        """Write the limits of all but the brightness of the whole."""
        return ", ".join(self._details())

    def _details(self) -> Iterator[str]:
        if math.isfinite(self.tile_brightness):
            yield f"{_percent(self.tile_brightness)} in a tile of {self.tile} px (half of the tiles)"
        if math.isfinite(self.shift):
            yield f"a shift over {self.shift:.2g} px"
        if math.isfinite(self.blur):
            yield f"a blur over {self.blur:.2g} px"


def _percent(fraction: float) -> str:
    return f"{100.0 * fraction:.2g} %"


def symmetric_tail(z: float) -> float:
    """Bound the probability that |sum s_i c_i| / sqrt(sum c_i^2) is at least `z`, of random signs s_i and any c_i.

    References: Bentkus and Dzindzalieta 2015, "A tight Gaussian bound for weighted sums of Rademacher random
        variables", Bernoulli 21(2), theorem 1.1.
    """
    return min(1.0, _SYMMETRIC * math.erfc(z / math.sqrt(2.0)))


def detectable_z(alpha: float, tests: int) -> float:
    """Compute the expected score that is found with the probability `POWER`, by one of `tests` of the level `alpha`."""
    from scipy.special import ndtri

    each = -math.expm1(math.log1p(-alpha) / tests)
    return float(-ndtri(0.5 * each / _SYMMETRIC) + ndtri(POWER))


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


def _limits(projections: Projections, alpha: float) -> "np.ndarray[tuple[int, ...], np.dtype[np.float64]]":
    return np.maximum(projections.detectable_amounts(detectable_z(alpha, projections.sums.size)), ROUNDING)
