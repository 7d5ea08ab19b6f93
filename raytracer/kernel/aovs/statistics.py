"""How a pixel was sampled.

On the command line:

    rt render scene.yaml -o out.exr --aov coverage,samples,variance
"""

from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from raytracer.aovs.interface import AovSpec, Coverage, Identities
from raytracer.film.film import Film


class CoverageSpec(AovSpec):
    """Fraction of the pixel, as its filter weighs it, in which there is a surface: the alpha of a picture."""

    type: Literal["coverage"] = "coverage"
    channels: ClassVar[tuple[str, ...]] = ("A",)

    def pack(self, height: int, width: int, column: int, identities: Identities) -> Coverage:
        return Coverage(np.zeros((height, width, 2)))

    def develop(self, layer: Any, film: Film) -> NDArray[Any]:
        covered, weight = layer.sums[..., 0], layer.sums[..., 1]
        return np.asarray(np.divide(covered, weight, out=np.zeros_like(covered), where=weight != 0.0))


class Samples(AovSpec):
    """How many samples the pixel's values are means of."""

    type: Literal["samples"] = "samples"
    channels: ClassVar[tuple[str, ...]] = ("N",)

    def pack(self, height: int, width: int, column: int, identities: Identities) -> None:
        return None

    def develop(self, layer: Any, film: Film) -> NDArray[Any]:
        return film.count.astype(np.uint32)


class Variance(AovSpec):
    """Variance of each value of the radiance as an estimate of its expectation; infinite for a single sample."""

    type: Literal["variance"] = "variance"
    channels: ClassVar[tuple[str, ...]] = ("R", "G", "B")
    unit: ClassVar[str] = "(W/(m2 sr))2"

    def pack(self, height: int, width: int, column: int, identities: Identities) -> None:
        return None

    def develop(self, layer: Any, film: Film) -> NDArray[Any]:
        return film.variance_of_mean()
