"""Draw random numbers from samplers without state, and warp them to distributions with known densities."""

from collections.abc import Callable, Mapping

from raytracer.core.sampling.independent import Independent
from raytracer.core.sampling.interface import pixel_key, sample_1d, sample_2d
from raytracer.core.sampling.sobol import Sobol
from raytracer.core.sampling.stratified import Stratified

SAMPLERS: Mapping[str, Callable[[int, int], Independent | Sobol | Stratified]] = {
    "independent": lambda seed, spp: Independent(seed),
    "sobol": lambda seed, spp: Sobol(seed),
    "stratified": Stratified.of,
}
"""Samplers by name, made from a seed and the samples per pixel."""

__all__ = ["SAMPLERS", "Independent", "Sobol", "Stratified", "pixel_key", "sample_1d", "sample_2d"]
