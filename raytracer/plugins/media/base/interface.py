"""What every kind of medium gives to packing and to kernels.

A kind's file holds its YAML spec, its packed table (one row a medium), the record that one row makes for a ray, and its
cases of the functions below.  Distances are in metres along unit directions, and may be infinite.
"""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raytracer.jit import generic, kernel, switch
from raytracer.materials.interface import MEDIUM, PHASE
from raytracer.sampling import sample_2d
from raytracer.spec import Quantity, Spec, Triple, Vector
from raytracer.vec import Vec3

Coefficient: TypeAlias = Annotated[Vector, Triple(Quantity(low=0.0), "a coefficient (1/m)", single=True)]
Asymmetry: TypeAlias = Annotated[float, Quantity(low=-1.0, high=1.0)]

NONE = -1
"""The reference of no medium: vacuum."""

KEEP = -2
"""What a surface says that leaves a ray in the medium that it came through."""


class MediumSpec(Spec):
    """Base of the media: what packing asks of each."""

    type: str

    def is_clear(self, assets: Mapping[str, Any]) -> bool:
        """Whether it leaves light alone everywhere, so that it is no medium; `assets`, what its files held, by key."""
        raise NotImplementedError

    def check(self, assets: Mapping[str, Any]) -> None:
        """Refuse values that do not suit what its files hold.

        Raises
        ------
        ValidationError : by `spec.at`, for the key that is wrong.
        """

    def scatters(self) -> bool:
        """Whether any light that it takes goes on elsewhere."""
        raise NotImplementedError

    @staticmethod
    def pack(specs: Any, assets: Sequence[Mapping[str, Any]]) -> Any:
        """The table of media of this kind, one row a spec."""
        raise NotImplementedError


class Media(NamedTuple):
    """The media of a scene, and where they are.

    tables, one a kind; a medium is named by one number, row * kinds + kind, or NONE.  inside and outside (references,)
    int32, by reference of a surface's material: the medium that a ray is in after it crossed to the side that the
    normal leaves, or that it points to; KEEP for the one that it came through.  camera, where the camera stands.
    """

    tables: tuple[Any, ...]
    inside: NDArray[np.int32]
    outside: NDArray[np.int32]
    camera: int


class Flight(NamedTuple):
    """What becomes of light on its way through a medium.

    distance to where it scatters, infinite if it does not; weight = transmittance (times what is scattered per metre)
    / probability (density), by channel; numbers, how many of the segment's random numbers have been used.
    """

    distance: float
    weight: Vec3
    numbers: int


@generic
def row(table, index):
    """The parameters of medium `index` as a record."""
    raise NotImplementedError


@generic
def fly(medium, origin, direction, distance, throughput, draws, numbers):
    """Draw where light that sets out along a ray scatters, before it has come `distance` far: a Flight.

    `throughput`, by channel, says which channels matter; `numbers`, how many random numbers the segment has used.
    """
    raise NotImplementedError


@generic
def transmittance(medium, origin, direction, distance, draws, numbers):
    """(the fraction of light that comes through to `distance`, by channel, or an estimate of it; numbers used)."""
    raise NotImplementedError


@generic
def scatter_phase(medium, direction, u1, u2):
    """(direction, pdf) of scattered light; the weight is 1.  The pdf is infinite where there is no choice."""
    raise NotImplementedError


@generic
def evaluate_phase(medium, direction, outgoing):
    """The phase function (1/sr), which is also the pdf of `scatter_phase`; 0 where there is no choice."""
    raise NotImplementedError


@generic
def moved(table: Any, by: Vec3) -> Any:
    """The table of media in a world that is moved by a vector (m): itself where they are alike everywhere."""
    raise NotImplementedError(type(table))


@moved.register(tuple)
def _(table: Any, by: Vec3) -> Any:
    return table


# ---- Random numbers

_UNBOUNDED = 1 << 31
_PER_SEGMENT = 1 << 15
FLIGHT_NUMBERS = _PER_SEGMENT >> 1
"""Beyond the slots of all segments, each has 2^15 numbers of its own: half for its flight, half for its shadow ray.

A segment that takes more goes round; no two uses on one path have the same number before that.
"""


@kernel
def _dimension(draws, number):
    segment = draws.dimension >> 3
    return _UNBOUNDED + ((segment * _PER_SEGMENT + number) & (_UNBOUNDED - 1))


@kernel
def flight_numbers(draws, number):
    """The pair of random numbers that a flight takes as its `number`th of the segment: the first is well stratified."""
    if number == 0:
        return sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + MEDIUM)
    return sample_2d(draws.sampler, draws.key, draws.index, _dimension(draws, number & (FLIGHT_NUMBERS - 1)))


@kernel
def shadow_numbers(draws, number):
    """As `flight_numbers`, for the segment's shadow ray."""
    return sample_2d(
        draws.sampler, draws.key, draws.index, _dimension(draws, FLIGHT_NUMBERS + (number & (FLIGHT_NUMBERS - 1)))
    )


# ---- By reference


def _fly_row(table, index, origin, direction, distance, throughput, draws, numbers):
    return fly(row(table, index), origin, direction, distance, throughput, draws, numbers)


def _transmittance_row(table, index, origin, direction, distance, draws, numbers):
    return transmittance(row(table, index), origin, direction, distance, draws, numbers)


def _scatter_row(table, index, direction, u1, u2):
    return scatter_phase(row(table, index), direction, u1, u2)


def _evaluate_row(table, index, direction, outgoing):
    return evaluate_phase(row(table, index), direction, outgoing)


_fly_any = switch(kernel(_fly_row))
_transmittance_any = switch(kernel(_transmittance_row))
_scatter_any = switch(kernel(_scatter_row))
_evaluate_any = switch(kernel(_evaluate_row))


@kernel
def fly_at(media, reference, origin, direction, distance, throughput, draws, numbers):
    """`fly` in a medium that is not NONE."""
    kinds = len(media.tables)
    kind, index = reference % kinds, reference // kinds
    return _fly_any(media.tables, kind, index, origin, direction, distance, throughput, draws, numbers)


@kernel
def transmittance_at(media, reference, origin, direction, distance, draws, numbers):
    """`transmittance` of a medium that is not NONE."""
    kinds = len(media.tables)
    kind, index = reference % kinds, reference // kinds
    return _transmittance_any(media.tables, kind, index, origin, direction, distance, draws, numbers)


@kernel
def scatter_phase_at(media, reference, direction, draws):
    """`scatter_phase` of a medium that is not NONE."""
    kinds = len(media.tables)
    u1, u2 = sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + PHASE)
    return _scatter_any(media.tables, reference % kinds, reference // kinds, direction, u1, u2)


@kernel
def evaluate_phase_at(media, reference, direction, outgoing):
    """`evaluate_phase` of a medium that is not NONE."""
    kinds = len(media.tables)
    return _evaluate_any(media.tables, reference % kinds, reference // kinds, direction, outgoing)


@kernel
def crossed(media, material, medium, enters):
    """The medium behind a surface of this material, for a ray that comes through `medium`."""
    behind = np.int64(media.inside[material] if enters else media.outside[material])
    return medium if behind == KEEP else behind
