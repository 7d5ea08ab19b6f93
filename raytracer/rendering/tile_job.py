"""Samples that are taken elsewhere: what is asked for, what comes back, and the taking.

Adding a packet to a pixel's running mean is not associative, so what others bring cannot be added up in any order.  An
errand therefore takes along what its tiles have gathered so far, and goes on from there: the picture has the bits that
it has where all of its samples are taken in one place.
"""

import time
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.accumulation import FilmView
from raytracer.integrator import Scene, render_tile
from raytracer.paths import Workspace


class Errand(NamedTuple):
    """Samples of some tiles.

    tiles, their numbers, T of them; windows (T,), the pixels (left, top, right, bottom) of each; begins and ends (T,),
    samples begin .. end - 1 of each pixel; marks (T,), numbers of samples in between, rising, at which the mean is to
    be noted; sampler, a packed one; gathered, what the tiles have so far: for each of a film's arrays
    (`arrays_of`) one of shape (pixels, ...), tile after tile, or None where they have nothing; mean_only, whether
    nothing else is to come back.
    """

    tiles: tuple[int, ...]
    windows: tuple[tuple[int, int, int, int], ...]
    begins: tuple[int, ...]
    ends: tuple[int, ...]
    marks: tuple[tuple[int, ...], ...]
    sampler: Any
    gathered: tuple[NDArray[Any], ...] | None
    mean_only: bool = False


class Haul(NamedTuple):
    """What an errand brings back.

    gathered, as the errand's, with the samples added, but the mean alone where no more was asked for; noted (n, 3)
    float64, the means of the pixels at the marks, tile after tile and mark after mark; rays (T,) int64, traced; seconds
    (T,) float64, that each tile took.
    """

    gathered: tuple[NDArray[Any], ...]
    noted: NDArray[np.float64]
    rays: NDArray[np.int64]
    seconds: NDArray[np.float64]


class Brought(NamedTuple):
    """What a haul holds of one tile: a film's arrays (height, width, ...), and its means at marks."""

    arrays: tuple[NDArray[Any], ...]
    noted: tuple[tuple[int, NDArray[np.float64]], ...]


def arrays_of(film: FilmView) -> tuple[NDArray[Any], ...]:
    """All arrays (height, width, ...) that a film gathers in; the first is the mean."""
    arrays = [film.mean, film.m2, film.count, film.bad]
    if film.removed is not None:
        arrays.append(film.removed)
    layers = () if film.aovs is None else film.aovs.layers
    return (*arrays, *(part for layer in layers for part in layer if isinstance(part, np.ndarray)))


def shape_of(window: Sequence[int]) -> tuple[int, int]:
    """Height and width of a window."""
    left, top, right, bottom = window
    return bottom - top, right - left


def collected(film: FilmView, windows: Sequence[Sequence[int]]) -> tuple[NDArray[Any], ...]:
    """What a film has in some windows of the picture, as an errand takes it along."""
    return tuple(
        np.concatenate([_flat(array, film, window) for window in windows], axis=0) for array in arrays_of(film)
    )


def _flat(array: NDArray[Any], film: FilmView, window: Sequence[int]) -> NDArray[Any]:
    left, top, right, bottom = window
    part = array[top - film.top : bottom - film.top, left - film.left : right - film.left]
    return part.reshape(-1, *array.shape[2:])


def brought(errand: Errand, haul: Haul) -> list[Brought]:
    """What came back, tile by tile."""
    found = []
    first = mark = 0
    for window, marks in zip(errand.windows, errand.marks, strict=True):
        height, width = shape_of(window)
        size = height * width
        arrays = tuple(array[first : first + size].reshape(height, width, *array.shape[1:]) for array in haul.gathered)
        means = haul.noted[mark : mark + size * len(marks)].reshape(len(marks), height, width, 3)
        found.append(Brought(arrays, tuple(zip(marks, means, strict=True))))
        first, mark = first + size, mark + size * len(marks)
    return found


def take(scene: Scene, scratch: FilmView, room: Workspace, errand: Errand) -> Haul:
    """Take the samples of an errand.

    Parameters
    ----------
    scratch : a film of the largest tile's size to work on, of the same type as the picture's.
    """
    scene = scene._replace(sampler=errand.sampler)
    arrays = arrays_of(scratch)
    kept = arrays[:1] if errand.mean_only else arrays
    parts: list[tuple[NDArray[Any], ...]] = []
    noted = [np.zeros((0, 3))]
    rays, seconds = np.zeros(len(errand.windows), dtype=np.int64), np.zeros(len(errand.windows))
    first = 0
    for tile, window in enumerate(errand.windows):
        started = time.perf_counter()
        height, width = shape_of(window)
        size = height * width
        film = scratch._replace(left=window[0], top=window[1])
        for number, array in enumerate(arrays):
            if errand.gathered is None:
                array.fill(0)
            else:
                so_far = errand.gathered[number][first : first + size]
                array[:height, :width] = so_far.reshape(height, width, *array.shape[2:])
        begin = errand.begins[tile]
        for end in (*errand.marks[tile], errand.ends[tile]):
            rays[tile] += render_tile(scene, film, room, *window, begin, end)
            if end != errand.ends[tile]:
                noted.append(scratch.mean[:height, :width].reshape(-1, 3).copy())
            begin = end
        parts.append(tuple(array[:height, :width].reshape(-1, *array.shape[2:]).copy() for array in kept))
        seconds[tile] = time.perf_counter() - started
        first += size
    gathered = tuple(np.concatenate([part[number] for part in parts], axis=0) for number in range(len(kept)))
    return Haul(gathered, np.concatenate(noted, axis=0), rays, seconds)
