"""Russian roulette: paths that carry little light end at random, and the others are weighted up.

References: Veach 1997, thesis, sec. 10.4 (Russian roulette).
"""

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.sampling import sample_1d
from raytracer.core.vec import is_black, max_component
from raytracer.plugins.materials.base.interface import ROULETTE

LEAST_THROUGHPUT = 0.25
"""Throughput that a path goes on from a surface with at least.

A path that carries little costs as much as others, and one that survives carries the light of those that ended: with 1
in its place, deep paths came back as bright as those from the camera. Squared error times rays over that of 1, at 0.5,
0.25 and 0.1: glass 0.74, 0.68, 0.68; kinds of bench/peers 0.90, 0.85, 0.86; cornell 0.94, 0.94, 1.01.
"""

LEAST_THROUGHPUT_IN_MEDIA = 1.0
"""Throughput that a path goes on with from a medium at least.

There light is spread evenly, and sampled at each vertex: what later vertices add has little noise. Squared error times
rays of fog of bench/peers over that of 1, at 0.5 and 0.25: 1.25, 1.61.
"""


@kernel
def russian_roulette(scene, throughput, least, done, draws):
    """Decide by chance if a path goes on after `done` segments: returns its survival probability, 0 if it ends.

    From `scene.roulette` segments on it is the largest component of the throughput over `least`, at most 1.
    """
    if is_black(throughput):
        return 0.0
    if done < scene.roulette:
        return 1.0
    survival = min(1.0, max_component(throughput) / least)
    if sample_1d(draws.sampler, draws.key, draws.index, draws.dimension + ROULETTE) >= survival:
        return 0.0
    return survival
