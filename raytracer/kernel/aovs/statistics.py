"""Coverage, number of samples and variance of a pixel.

On the command line:

    rt render scene.yaml -o out.exr --aov coverage,samples,variance
"""

from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from raytracer.film.film import Film
from raytracer.kernel.aovs.base.interface import AovSpec, SceneIds
from raytracer.kernel.aovs.base.layers import CoverageLayer


class CoverageSpec(AovSpec):
    """Fraction of the pixel, as its filter weighs it, in which there is a surface: the alpha of a picture."""

    type: Literal["coverage"] = "coverage"
    channels: ClassVar[tuple[str, ...]] = ("A",)

    def pack(self, height: int, width: int, column: int, identities: SceneIds) -> CoverageLayer:
        return CoverageLayer(np.zeros((height, width, 2)))

    def develop(self, layer: Any, film: Film) -> NDArray[Any]:
        covered, weight = layer.sums[..., 0], layer.sums[..., 1]
        return np.asarray(np.divide(covered, weight, out=np.zeros_like(covered), where=weight != 0.0))


class Samples(AovSpec):
    """Number of samples of which the pixel's values are means."""

    type: Literal["samples"] = "samples"
    channels: ClassVar[tuple[str, ...]] = ("N",)

    def pack(self, height: int, width: int, column: int, identities: SceneIds) -> None:
        return None

    def develop(self, layer: Any, film: Film) -> NDArray[Any]:
        return film.count.astype(np.uint32)


class Variance(AovSpec):
    """Variance of each value of the radiance as an estimate of its expectation; infinite for a single sample."""

    type: Literal["variance"] = "variance"
    channels: ClassVar[tuple[str, ...]] = ("R", "G", "B")
    unit: ClassVar[str] = "(W/(m2 sr))2"

    def pack(self, height: int, width: int, column: int, identities: SceneIds) -> None:
        return None

    def develop(self, layer: Any, film: Film) -> NDArray[Any]:
        return film.variance_of_mean()
