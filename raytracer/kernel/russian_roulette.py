"""Russian roulette: paths that carry little light end at random, and the others are weighted up.

References: Veach 1997, thesis, sec. 10.4 (Russian roulette).
"""

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.sampling import sample_1d
from raytracer.core.vec import is_black, max_component
from raytracer.plugins.materials.base.interface import ROULETTE


@kernel
def russian_roulette(scene, throughput, done, draws):
    """Decide by chance if a path goes on after `done` segments: returns its survival probability, 0 if it ends.

    The probability is the largest component of the throughput, at most 1, from `scene.roulette` segments on.
    """
    if is_black(throughput):
        return 0.0
    if done < scene.roulette:
        return 1.0
    survival = min(1.0, max_component(throughput))
    if sample_1d(draws.sampler, draws.key, draws.index, draws.dimension + ROULETTE) >= survival:
        return 0.0
    return survival
