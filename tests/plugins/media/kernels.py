"""Compiled loops over a medium's functions."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import entry
from raytracer.core.sampling import SAMPLERS, pixel_key
from raytracer.core.vec import Vec3
from raytracer.plugins.materials.base.interface import DIMENSIONS_PER_SEGMENT, Draws
from raytracer.plugins.media.base.interface import (
    MediumSpec,
    evaluate_phase,
    row,
    sample_distance,
    sample_phase,
    transmittance,
)

WHITE = (1.0, 1.0, 1.0)


@entry
def _fly_many(table, index, origin, direction, distance, throughput, sampler, far, weight, numbers):
    key = pixel_key(sampler, 0, 0)
    for number in range(len(far)):
        draws = Draws(sampler, key, number, DIMENSIONS_PER_SEGMENT)
        flight = sample_distance(row(table, index), origin, direction, distance, throughput, draws, 0)
        far[number] = flight.distance
        for channel in range(3):
            weight[number, channel] = flight.weight[channel]
        numbers[number] = flight.numbers


@entry
def _transmittance_many(table, index, origin, direction, distance, sampler, out):
    key = pixel_key(sampler, 0, 0)
    for number in range(len(out)):
        draws = Draws(sampler, key, number, DIMENSIONS_PER_SEGMENT)
        through, _ = transmittance(row(table, index), origin, direction, distance, draws, 0)
        for channel in range(3):
            out[number, channel] = through[channel]


@entry
def _scatter_many(table, index, direction, u, outgoing, pdf, again):
    medium = row(table, index)
    for number in range(len(pdf)):
        out, pdf[number] = sample_phase(medium, direction, u[number, 0], u[number, 1])
        again[number] = evaluate_phase(medium, direction, out)
        for axis in range(3):
            outgoing[number, axis] = out[axis]


@entry
def _evaluate_many(table, index, direction, outgoing, pdf):
    medium = row(table, index)
    for number in range(len(pdf)):
        toward = (outgoing[number, 0], outgoing[number, 1], outgoing[number, 2])
        pdf[number] = evaluate_phase(medium, direction, toward)


Assets = Mapping[str, Any]


def packed(*specs: MediumSpec, assets: Sequence[Assets] | None = None) -> Any:
    """The table of media of one kind."""
    return type(specs[0]).pack(list(specs), assets or [{} for _ in specs])


def fly_many(
    table: Any,
    count: int,
    *,
    index: int = 0,
    origin: Vec3 = (0.0, 0.0, 0.0),
    direction: Vec3 = (0.0, 0.0, 1.0),
    distance: float = math.inf,
    throughput: Vec3 = WHITE,
    sampler: str = "independent",
    seed: int = 3,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Distances (count,), weights (count, 3) and numbers used (count,) of flights."""
    far, weight, numbers = np.empty(count), np.empty((count, 3)), np.empty(count, np.int64)
    made = SAMPLERS[sampler](seed, count)
    _fly_many(table, index, origin, direction, float(distance), throughput, made, far, weight, numbers)
    return far, weight, numbers


def transmittance_many(
    table: Any,
    count: int,
    *,
    index: int = 0,
    origin: Vec3 = (0.0, 0.0, 0.0),
    direction: Vec3 = (0.0, 0.0, 1.0),
    distance: float = math.inf,
    seed: int = 4,
) -> NDArray[np.float64]:
    """Estimates (count, 3)."""
    out = np.empty((count, 3))
    _transmittance_many(table, index, origin, direction, float(distance), SAMPLERS["independent"](seed, count), out)
    return out


def scatter_many(
    table: Any, direction: Vec3, u: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Directions (n, 3), their pdfs (n,), and those of `evaluate_phase` (n,), for random numbers (n, 2)."""
    outgoing, pdf, again = np.empty((len(u), 3)), np.empty(len(u)), np.empty(len(u))
    _scatter_many(table, 0, direction, np.ascontiguousarray(u), outgoing, pdf, again)
    return outgoing, pdf, again


def evaluate_many(table: Any, direction: Vec3, outgoing: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pdfs (n,) of directions (n, 3)."""
    pdf = np.empty(len(outgoing))
    _evaluate_many(table, 0, direction, np.ascontiguousarray(outgoing), pdf)
    return pdf
