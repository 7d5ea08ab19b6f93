"""Functions of media, for rows of random numbers and directions."""

import math

import numpy as np

from raytracer.core.compiler.dispatch import kernel
from raytracer.plugins.materials.base.interface import DIMENSIONS_PER_SEGMENT
from raytracer.plugins.media.base.interface import evaluate_phase, row, sample_distance, sample_phase, transmittance
from tests.vectorised import random_draws, rows, vectorised


@kernel
def _fly(table, index, origin, direction, distance, throughput, draws):
    return sample_distance(row(table, index), origin, direction, distance, throughput, draws, 0)


@kernel
def _transmit(table, index, origin, direction, distance, draws):
    return transmittance(row(table, index), origin, direction, distance, draws, 0)[0]


@kernel
def _scatter(table, direction, u1, u2):
    outgoing, pdf = sample_phase(row(table, 0), direction, u1, u2)
    return outgoing, pdf, evaluate_phase(row(table, 0), direction, outgoing)


@kernel
def _evaluate(table, direction, outgoing):
    return evaluate_phase(row(table, 0), direction, outgoing)


def packed(*specs, assets=None):
    """The table of media of one kind."""
    return type(specs[0]).pack(list(specs), assets or [{} for _ in specs])


def _ray(index, origin, direction, distance):
    return index, tuple(map(float, origin)), tuple(map(float, direction)), float(distance)


def fly_many(
    table,
    count,
    *,
    index=0,
    origin=(0.0, 0.0, 0.0),
    direction=(0.0, 0.0, 1.0),
    distance=math.inf,
    throughput=(1.0, 1.0, 1.0),
    **sampling,
):
    """Distances (count,), weights (count, 3) and numbers used (count,) of flights."""
    draws = random_draws(count, dimension=DIMENSIONS_PER_SEGMENT, **sampling)
    return vectorised(_fly)(table, *_ray(index, origin, direction, distance), throughput, draws)


def transmittance_many(
    table, count, *, index=0, origin=(0.0, 0.0, 0.0), direction=(0.0, 0.0, 1.0), distance=math.inf, seed=4
):
    """Estimates (count, 3)."""
    draws = random_draws(count, seed=seed, dimension=DIMENSIONS_PER_SEGMENT)
    return vectorised(_transmit)(table, *_ray(index, origin, direction, distance), draws)


def scatter_many(table, direction, u):
    """Directions (n, 3), their pdfs (n,), and those of `evaluate_phase` (n,), for random numbers (n, 2)."""
    return vectorised(_scatter)(table, direction, *map(rows, np.asarray(u).T))


def evaluate_many(table, direction, outgoing):
    """Pdfs (n,) of directions (n, 3)."""
    return vectorised(_evaluate)(table, direction, rows(outgoing))
