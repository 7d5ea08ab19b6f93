"""Microlenses of three focal lengths, interleaved on hexagons so that no two neighbours are of one kind.

The microlens in column c and row r is of the kind (c - r) mod 3.  The light that comes to a point of the sensor through
all of one microlens is a bundle.  Of what is at the distance 1 / w it sees a spot as wide as `|angle - diameter w|`, as
a tangent: `diameter` wide at the main lens, `angle` at infinity, and narrowest at the distance where its kind shows
things sharply.

References: Perwass, Wietzke 2012, "Single Lens 3D-Camera with Extended Depth-of-Field", Proc. SPIE 8291; Georgiev,
Lumsdaine 2012, "The Multi-Focus Plenoptic Camera", Proc. SPIE 8299.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.lattice import Lattice

COUNT = 3
"""Kinds of microlenses: as many as three neighbours on hexagons need."""


class Bundle(NamedTuple):
    """The light of a microlens: tangent that it spreads to at infinity, and diameter at the main lens (m)."""

    angle: float
    diameter: float

    def spot(self, inverse_distance: Any) -> Any:
        """Compute how wide (tangents) the spot is that it sees at one over a distance (1/m)."""
        return np.abs(self.angle - self.diameter * inverse_distance)

    @property
    def inverse_distance(self) -> float:
        """One over the distance at which it is narrowest (1/m); inf for that of the main lens."""
        return self.angle / self.diameter if self.diameter != 0.0 else math.inf


def microlens_kinds(lattice: Lattice, middles: NDArray[np.float64]) -> NDArray[np.intp]:
    """Find the kinds of the microlenses at middles (..., 2) of sub-images (px)."""
    steps = np.rint(lattice.index(middles))
    return np.asarray((steps[..., 0] - steps[..., 1]) % COUNT, dtype=np.intp)


def sharpness(spot: Any, pixel: float) -> Any:
    """Weigh light by how sharp it is, where its spot and the pixels of a picture are so wide.

    The error that a blur makes grows with the square of its width, and its mean square with the fourth power: the
    weights are one over the mean square of such errors, and of noise that is as large where both are as wide.
    """
    return 1.0 / (1.0 + (np.asarray(spot) / pixel) ** 4)
