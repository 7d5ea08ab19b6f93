"""Samples taken once more, packet by packet, with the bits that they have in the picture.

A film keeps no samples; where one of them is to be looked at, its packet is traced again.  It takes the same company: a
packet of other rays may reach other code of the ray caster.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.accumulation import FilmView
from raytracer.embree import PACKET
from raytracer.integrator import Scene, render_tile
from raytracer.interior import ranks_of
from raytracer.pathlog import path_log
from raytracer.paths import Workspace, workspace

# Room for the events of a path, at first.
_EVENTS = 4096


class Samples(NamedTuple):
    """A packet of a pixel's samples.

    first, the number of its first; values (n, 3) float64, what each adds to the pixel; weights (n,) float64, what its
    radiance was multiplied by, NaN if the sample is dropped since it is not finite.  If any is, the values say nothing.
    """

    first: int
    values: NDArray[np.float64]
    weights: NDArray[np.float64]


def packet_of(sample: int, taken: int | None) -> tuple[int, int]:
    """First sample of the packet that holds a sample, and the end of it.

    taken : samples that the pixel gets, which may cut its last packet short; None if that is whole.
    """
    first = sample - sample % PACKET
    end = first + PACKET
    return first, end if taken is None or sample >= taken else min(end, taken)


def samples(scene: Scene, scratch: FilmView, x: int, y: int, taken: int) -> Iterator[Samples]:
    """All samples of pixel (x, y) of the picture, packet by packet.

    Parameters
    ----------
    scratch : a film to write on, of any size.
    taken : how many there are.
    """
    room = workspace(solids=ranks_of(scene.interior))
    for first in range(0, taken, PACKET):
        end = min(first + PACKET, taken)
        _trace(scene, scratch, room, x, y, first, end)
        yield Samples(first, room.radiance[: end - first, :3].copy(), room.radiance[: end - first, 3].copy())


def first_dropped(scene: Scene, scratch: FilmView, x: int, y: int, taken: int) -> int | None:
    """The number of the first sample of pixel (x, y) that is not finite, of those taken; None if all are."""
    for packet in samples(scene, scratch, x, y, taken):
        dropped = np.flatnonzero(np.isnan(packet.weights))
        if len(dropped):
            return packet.first + int(dropped[0])
    return None


def brightest_of(packets: Sequence[Samples]) -> int:
    """The number of the sample that adds the most, the first of equal ones; packets not all finite do not count."""
    sums = [np.where(np.isnan(packet.weights).any(), -np.inf, packet.values.sum(axis=1)) for packet in packets]
    return int(np.argmax(np.concatenate(sums)))


def log_path(
    scene: Scene, scratch: FilmView, x: int, y: int, sample: int, taken: int | None = None
) -> NDArray[np.float64]:
    """The path of a sample of pixel (x, y), as it is written down: (events, pathlog.COLUMNS) float64.

    taken : see `packet_of`.
    """
    first, end = packet_of(sample, taken)
    events = _EVENTS
    while True:
        log = path_log(sample - first, events)
        _trace(scene, scratch, workspace(log, solids=ranks_of(scene.interior)), x, y, first, end)
        written = int(log.state[0])
        if written <= events:
            return log.rows[:written]
        events = written


def _trace(scene: Scene, scratch: FilmView, room: Workspace, x: int, y: int, first: int, end: int) -> None:
    film = scratch._replace(left=x, top=y)
    render_tile(scene, film, room, x, y, x + 1, y + 1, first, end)
