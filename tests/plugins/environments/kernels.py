"""Compiled loops over environments."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import entry
from raytracer.plugins.environments.base.interface import background, background_with_pdf, sample_background


class Drawn(NamedTuple):
    """Draw by `sample_background`: direction and radiance (n, 3), pdf (n,)."""

    direction: NDArray[np.float64]
    radiance: NDArray[np.float64]
    pdf: NDArray[np.float64]


@entry
def _background(environment, directions, out):
    for index in range(len(directions)):
        radiance = background(environment, (directions[index, 0], directions[index, 1], directions[index, 2]))
        for channel in range(3):
            out[index, channel] = radiance[channel]


@entry
def _sample(environment, numbers, out):
    for index in range(len(numbers)):
        direction, radiance, pdf = sample_background(environment, numbers[index, 0], numbers[index, 1])
        out.pdf[index] = pdf
        for axis in range(3):
            out.direction[index, axis] = direction[axis]
            out.radiance[index, axis] = radiance[axis]


@entry
def _pdf(environment, directions, pdf):
    for index in range(len(directions)):
        direction = (directions[index, 0], directions[index, 1], directions[index, 2])
        _, pdf[index] = background_with_pdf(environment, direction)


def _rows(directions: Any) -> NDArray[np.float64]:
    return np.ascontiguousarray(np.atleast_2d(np.asarray(directions, np.float64)))


def seen(environment: Any, directions: Any) -> NDArray[np.float64]:
    """`background` along unit directions (n, 3)."""
    rows = _rows(directions)
    out = np.empty_like(rows)
    _background(environment, rows, out)
    return out


def drawn(environment: Any, numbers: Any) -> Drawn:
    """`sample_background` for numbers (n, 2)."""
    rows = _rows(numbers)
    out = Drawn(np.empty((len(rows), 3)), np.empty((len(rows), 3)), np.empty(len(rows)))
    _sample(environment, rows, out)
    return out


def density(environment: Any, directions: Any) -> NDArray[np.float64]:
    """The density of `background_with_pdf` of unit directions (n, 3)."""
    rows = _rows(directions)
    pdf = np.empty(len(rows))
    _pdf(environment, rows, pdf)
    return pdf
