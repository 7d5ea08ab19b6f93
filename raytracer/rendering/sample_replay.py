"""Take samples again, packet by packet, with the bits that they have in the picture.

A film keeps no samples; to look at one of them, its whole packet is traced again: a packet of other rays may reach
other code of the ray caster.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.embree import PACKET
from raytracer.kernel.packed_scene import Scene
from raytracer.kernel.path_log import path_log
from raytracer.kernel.path_state import Workspace
from raytracer.kernel.path_state import workspace as make_workspace
from raytracer.kernel.path_tracer import render_tile
from raytracer.kernel.pixel_accumulator import FilmView

# Size of the buffer for the events of a path, at first.
_INITIAL_EVENTS = 4096


class SamplePacket(NamedTuple):
    """A packet of a pixel's samples.

    first : number of its first sample.
    values : float64 (n, 3), what each sample adds to the pixel; meaningless if a weight is NaN.
    weights : float64 (n,), factor of its radiance; NaN if the sample is dropped because it is not finite.
    """

    first: int
    values: NDArray[np.float64]
    weights: NDArray[np.float64]


def replay_samples(scene: Scene, scratch: FilmView, x: int, y: int, taken: int) -> Iterator[SamplePacket]:
    """Trace all samples of pixel (x, y) of the picture again, packet by packet.

    Parameters
    ----------
    scratch : a film to write on, of any size.
    taken : number of samples.
    """
    workspace = make_workspace(scene)
    for first in range(0, taken, PACKET):
        end = min(first + PACKET, taken)
        _retrace(scene, scratch, workspace, x, y, first, end)
        size = end - first
        yield SamplePacket(first, workspace.radiance[:size].copy(), workspace.weight[:size].copy())


def first_nan_sample(scene: Scene, scratch: FilmView, x: int, y: int, taken: int) -> int | None:
    """Find the first sample of pixel (x, y) that is not finite, of those taken; None if all are finite."""
    for packet in replay_samples(scene, scratch, x, y, taken):
        dropped = np.flatnonzero(np.isnan(packet.weights))
        if len(dropped):
            return packet.first + int(dropped[0])
    return None


def brightest_sample(packets: Sequence[SamplePacket]) -> int:
    """Find the sample that adds the most, the first of equal ones; packets that are not all finite do not count."""
    sums = [np.where(np.isnan(packet.weights).any(), -np.inf, packet.values.sum(axis=1)) for packet in packets]
    return int(np.argmax(np.concatenate(sums)))


def log_path(
    scene: Scene, scratch: FilmView, x: int, y: int, sample: int, taken: int | None = None
) -> NDArray[np.float64]:
    """Trace a sample of pixel (x, y) again, and return its log, float64 (events, path_log.COLUMNS).

    taken : samples that the pixel gets, which may cut its last packet short; None if that is whole.
    """
    first = sample - sample % PACKET
    end = first + PACKET if taken is None or sample >= taken else min(first + PACKET, taken)
    events = _INITIAL_EVENTS
    while True:
        log = path_log(sample - first, events)
        workspace = make_workspace(scene, log)
        _retrace(scene, scratch, workspace, x, y, first, end)
        written = int(log.state[0])
        if written <= events:
            return log.rows[:written]
        events = written


def _retrace(scene: Scene, scratch: FilmView, workspace: Workspace, x: int, y: int, first: int, end: int) -> None:
    film = scratch._replace(left=x, top=y)
    render_tile(scene, film, workspace, x, y, x + 1, y + 1, first, end)
