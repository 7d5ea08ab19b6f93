"""Functions of environments, for rows of directions and numbers."""

from typing import Any, NamedTuple

import numpy as np

from raytracer.plugins.environments.base.interface import background, background_with_pdf, sample_background
from tests.vectorised import rows, vectorised


class Drawn(NamedTuple):
    """Drawn by `sample_background`: direction and radiance (n, 3), pdf (n,)."""

    direction: Any
    radiance: Any
    pdf: Any


def _rows(vectors):
    return rows(np.atleast_2d(np.asarray(vectors, np.float64)))


def seen(environment, directions):
    """`background` along unit directions (n, 3)."""
    return vectorised(background)(environment, _rows(directions))


def drawn(environment, numbers):
    """`sample_background` for numbers (n, 2)."""
    return Drawn(*vectorised(sample_background)(environment, *map(rows, np.asarray(numbers, np.float64).T)))


def density(environment, directions):
    """The density of `background_with_pdf` of unit directions (n, 3)."""
    return vectorised(background_with_pdf)(environment, _rows(directions))[1]
