"""Interface of media: the spec's methods for packing, and the generic functions for kernels.

A kind's file holds its YAML spec, its packed table (one row a medium), the record that one row makes for a ray, and its
cases of the functions below.  Distances are in metres along unit directions, and may be infinite.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import generic, kernel, overridable, switch
from raytracer.core.sampling import sample_2d
from raytracer.core.sampling.warp import sin_cos_turn
from raytracer.core.vec import Vec3, add, basis, dot, neg, sub, to_world
from raytracer.plugins.materials.base.interface import MEDIUM, PHASE
from raytracer.schema.fields import Quantity, Triple, Vector
from raytracer.schema.spec import Spec

Coefficient: TypeAlias = Annotated[Vector, Triple(Quantity(low=0.0), "a coefficient (1/m)", single=True)]
Asymmetry: TypeAlias = Annotated[float, Quantity(low=-1.0, high=1.0)]

NO_MEDIUM = -1
"""The reference of no medium: vacuum."""

KEEP_MEDIUM = -2
"""Value of a surface that leaves a ray in the medium that it came through."""


class MediumSpec(Spec):
    """Base of the media."""

    type: str

    def is_clear(self, assets: Mapping[str, Any]) -> bool:
        """Tell if it neither absorbs nor scatters anywhere; `assets`: contents of its files, by key."""
        raise NotImplementedError

    def check(self, assets: Mapping[str, Any]) -> None:
        """Refuse values that do not suit the contents of its files.

        Raises
        ------
        ValidationError : by `spec.field_error`, for the key that is wrong.
        """

    def scatters(self) -> bool:
        """Tell if it scatters light."""
        raise NotImplementedError

    @staticmethod
    def pack(specs: Any, assets: Sequence[Mapping[str, Any]]) -> Any:
        """Pack the media of this kind, one row a spec."""
        raise NotImplementedError


class Media(NamedTuple):
    """Packed media of a scene; a medium is named by one number, row * kinds + kind, or NO_MEDIUM.

    tables : one a kind.
    inside, outside (references,) int32 : by reference of a surface's material, the medium that a ray is in after it
        crossed to the side that the normal leaves, or that it points to; KEEP_MEDIUM for the one that it came through.
    camera : the medium in which the camera stands.
    """

    tables: tuple[Any, ...]
    inside: NDArray[np.int32]
    outside: NDArray[np.int32]
    camera: int


class DistanceSample(NamedTuple):
    """Sampled distance of light through a medium.

    distance (m) : to the point where it scatters; infinite if it does not.
    weight : by channel, transmittance over the probability that it does not scatter; or transmittance times scattering
        coefficient over the density of the distance.
    numbers : random numbers of the segment that have been used.
    """

    distance: float
    weight: Vec3
    numbers: int


@generic
def row(table, index):
    """Look up the parameters of medium `index` as a record."""


@generic
def sample_distance(medium, origin, direction, distance, throughput, draws, numbers):
    """Sample the distance at which light scatters along a ray, up to `distance`: a DistanceSample.

    `throughput`, by channel, says which channels matter; `numbers`, how many random numbers the segment has used.
    """


@generic
def transmittance(medium, origin, direction, distance, draws, numbers):
    """Compute (transmittance up to `distance`, by channel, or an estimate of it; numbers used)."""


@overridable
def sample_phase(medium, direction, u1, u2):
    """Sample (direction, pdf) of scattered light; the weight is 1, and the pdf of a single direction infinite.

    By default it is scattered by Henyey and Greenstein's phase function of the medium's `g`.
    """
    return sample_henyey_greenstein(direction, medium.g, u1, u2)


@overridable
def evaluate_phase(medium, direction, outgoing):
    """Evaluate the phase function (1/sr), which is also the pdf of `sample_phase`; 0 if that is infinite."""
    return pdf_henyey_greenstein(direction, outgoing, medium.g)


@overridable
def translate_media(table: Any, by: Vec3) -> Any:
    """Move a table of media with the world by a vector (m); by default itself, alike everywhere."""
    return table


# ---- Random numbers

_UNBOUNDED = 1 << 31
_PER_SEGMENT = 1 << 15
NUMBERS_PER_DISTANCE = _PER_SEGMENT >> 1
"""Beyond the slots of all segments, each has 2^15 numbers of its own: half for its distance, half for its shadow ray.

A segment that takes more goes round; no two uses on one path have the same number before that.
"""


@kernel
def _dimension(draws, number):
    segment = draws.dimension >> 3
    return _UNBOUNDED + ((segment * _PER_SEGMENT + number) & (_UNBOUNDED - 1))


@kernel
def distance_numbers(draws, number):
    """Return the `number`th pair of random numbers for a segment's distance: the first is well stratified."""
    if number == 0:
        return sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + MEDIUM)
    return sample_2d(draws.sampler, draws.key, draws.index, _dimension(draws, number & (NUMBERS_PER_DISTANCE - 1)))


@kernel
def shadow_numbers(draws, number):
    """Return the `number`th pair of random numbers for a segment's shadow ray."""
    dimension = _dimension(draws, NUMBERS_PER_DISTANCE + (number & (NUMBERS_PER_DISTANCE - 1)))
    return sample_2d(draws.sampler, draws.key, draws.index, dimension)


# ---- By reference


def _sample_distance_row(table, index, origin, direction, distance, throughput, draws, numbers):
    return sample_distance(row(table, index), origin, direction, distance, throughput, draws, numbers)


def _transmittance_row(table, index, origin, direction, distance, draws, numbers):
    return transmittance(row(table, index), origin, direction, distance, draws, numbers)


def _scatter_row(table, index, direction, u1, u2):
    return sample_phase(row(table, index), direction, u1, u2)


def _evaluate_row(table, index, direction, outgoing):
    return evaluate_phase(row(table, index), direction, outgoing)


_sample_distance_any = switch(kernel(_sample_distance_row))
_transmittance_any = switch(kernel(_transmittance_row))
_scatter_any = switch(kernel(_scatter_row))
_evaluate_any = switch(kernel(_evaluate_row))


@kernel
def sample_distance_at(media, reference, origin, direction, distance, throughput, draws, numbers):
    """Call `sample_distance` in a medium that is not NO_MEDIUM."""
    kinds = len(media.tables)
    kind, index = reference % kinds, reference // kinds
    return _sample_distance_any(media.tables, kind, index, origin, direction, distance, throughput, draws, numbers)


@kernel
def transmittance_at(media, reference, origin, direction, distance, draws, numbers):
    """Call `transmittance` of a medium that is not NO_MEDIUM."""
    kinds = len(media.tables)
    kind, index = reference % kinds, reference // kinds
    return _transmittance_any(media.tables, kind, index, origin, direction, distance, draws, numbers)


@kernel
def sample_phase_at(media, reference, direction, draws):
    """Call `sample_phase` of a medium that is not NO_MEDIUM."""
    kinds = len(media.tables)
    u1, u2 = sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + PHASE)
    return _scatter_any(media.tables, reference % kinds, reference // kinds, direction, u1, u2)


@kernel
def evaluate_phase_at(media, reference, direction, outgoing):
    """Call `evaluate_phase` of a medium that is not NO_MEDIUM."""
    kinds = len(media.tables)
    return _evaluate_any(media.tables, reference % kinds, reference // kinds, direction, outgoing)


@kernel
def medium_behind(media, material, medium, enters):
    """Return the medium behind a surface of this material, for a ray that comes through `medium`."""
    behind = np.int64(media.inside[material] if enters else media.outside[material])
    return medium if behind == KEEP_MEDIUM else behind


# ---- Phase function
# The distribution of scattered light over directions.  Cosines are between the directions of travel before and after,
# so g > 0 scatters forwards, and g is the mean cosine.
#
# References: Henyey, Greenstein 1941, "Diffuse Radiation in the Galaxy", Astrophysical Journal 93, eq. 2.


@kernel
def pdf_henyey_greenstein(direction: Vec3, outgoing: Vec3, g: float) -> float:
    """Evaluate the phase function (1/sr), which integrates to 1 and is the density of its samples; 0 for g = +-1.

    All light goes one way then, without a density.  The denominator 1 + g^2 - 2 g cos is taken from the difference of
    the directions, which cancels nothing where the lobe is narrow.
    """
    if abs(g) == 1.0:
        return 0.0
    # 1 - |g| cos, measured from the direction that most light goes to.
    across = sub(direction, outgoing) if g > 0.0 else add(direction, outgoing)
    narrow = 1.0 - abs(g)
    squared = narrow * narrow + abs(g) * dot(across, across)
    return (1.0 - g * g) / (4.0 * math.pi * squared * math.sqrt(squared))


@kernel
def sample_henyey_greenstein(direction: Vec3, g: float, u1: float, u2: float) -> tuple[Vec3, float]:
    """Sample (direction, pdf) of light that travelled along `direction`; the pdf is infinite for g = +-1.

    1 + cos and 1 - cos come as products, so that neither a narrow lobe nor g near 0 cancels: with the usual
    cos = (1 + g^2 - q^2) / 2g and q = (1 - g^2) / r, r = 1 - g + 2 g u, they are

        1 + cos = 2 u (1 + g)^2 (1 - g + g u) / r^2,    1 - cos = 2 (1 - u) (1 - g)^2 (1 + g u) / r^2.

    References: Pharr et al. 2023, "Physically Based Rendering", 4th ed., sec. 11.3.1, for the usual form.
    """
    if g == 1.0:
        return direction, math.inf
    if g == -1.0:
        return neg(direction), math.inf
    r = 1.0 - g + 2.0 * g * u1
    above = 2.0 * u1 * (1.0 - g + g * u1) * ((1.0 + g) / r) ** 2
    below = 2.0 * (1.0 - u1) * (1.0 + g * u1) * ((1.0 - g) / r) ** 2
    radius, (sine, cosine) = math.sqrt(above * below), sin_cos_turn(u2)
    s, t = basis(direction)
    outgoing = to_world((radius * cosine, radius * sine, 0.5 * (above - below)), s, t, direction)
    spread = (1.0 - g) * (1.0 + g)
    return outgoing, r * r * r / (4.0 * math.pi * spread * spread)
