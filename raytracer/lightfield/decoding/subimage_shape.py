"""Shape of sub-images, and the error of their middles that pixels make.

A picture has one value a pixel, not the light at a place.  What the edge of a sub-image has of frequencies above those
that pixels can show is taken for lower ones (aliasing), which moves the phase of a lattice's wave: by some thousandths
of a pixel, and by up to 0.1 px where values are clipped and edges are steep.  The error depends on the place of a
middle inside its pixel.  Over most lattices its mean is 0, but where the pitch is a whole number of pixels and rows are
not turned, it is the same for all microlenses.

So the shape of some sub-images is fitted, drawn at places that are known, and measured as the picture was: what comes
out wrong is the error.  This is the correction of a bias by the parametric bootstrap.

References: Efron, Tibshirani 1993, "An Introduction to the Bootstrap", sec. 10.
"""

import itertools
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.lattice import Lattice
from raytracer.lightfield.decoding.subimage_phases import (
    Levels,
    cell_radius,
    cell_steps,
    measure_subimages,
    take_cells,
)

Floats = NDArray[np.float64]

_PIXELS = 1500
"""Pixels to which a shape is fitted: with noise of 2 % its numbers are right to some thousandths."""

_POINTS = 3
"""Points a side of a pixel over which its light is integrated."""

_ROUNDS = 40
"""Most rounds of least squares."""

_PLACES, _FEWEST_PLACES = 96, 8
"""Places a side of a pixel at which a shape is drawn, times the pitch in pixels: of long pitches errors are small, and
fewer places do."""


class SubimageShape(NamedTuple):
    """Disc whose light falls off towards a soft edge.

    amplitude : light in the middle.
    falloff : share of it that is lost at the edge, with the square of the distance.
    radius : of the disc (px).
    blur : standard deviation of the edge (px).
    base : light everywhere.
    spill : share of a disc's light beyond the cell of its microlens that arrives: 0 if walls stop it, 1 if nothing
        does.
    """

    amplitude: float
    falloff: float
    radius: float
    blur: float
    base: float
    spill: float

    def draw(self, x: Floats, y: Floats, lattice: Lattice, top: float) -> Floats:
        """Compute the light of pixels at places from the middle of a sub-image (px), clipped at 0 and `top`."""
        nodes, weights = np.polynomial.legendre.leggauss(_POINTS)
        steps = cell_steps(lattice)
        light = np.zeros(np.broadcast_shapes(x.shape, y.shape))
        for (u, across), (v, down) in itertools.product(zip(nodes, weights, strict=True), repeat=2):
            right, below = x + 0.5 * u, y + 0.5 * v
            nearest = right**2 + below**2
            second = np.full_like(nearest, np.inf)
            for step in (*steps, *-steps):
                other = (right - step[0]) ** 2 + (below - step[1]) ** 2
                second = np.minimum(second, np.maximum(nearest, other))
                nearest = np.minimum(nearest, other)
            light += 0.25 * across * down * (self._disc(nearest) + self.spill * self._disc(second))
        return np.clip(self.base + self.amplitude * light, 0.0, top)

    def _disc(self, squared: Floats) -> Floats:
        """Compute the light of a disc by the squared distance from its middle, as a share of that there."""
        from scipy.special import ndtr

        falloff = 1.0 - self.falloff * squared / self.radius**2
        return np.asarray(falloff.clip(0.0) * ndtr((self.radius - np.sqrt(squared)) / self.blur))


def fit_shape(white: NDArray[Any], lattice: Lattice, middles: Floats, levels: Levels) -> SubimageShape:
    """Fit the shape of the sub-images at `middles` (n, 2), one for all and moved by as much, by least squares."""
    from scipy.optimize import least_squares

    cells = take_cells(white, lattice, middles, levels)
    chosen = np.flatnonzero(cells.share > 0.0)
    if len(chosen) > _PIXELS:
        chosen = np.random.default_rng(0).permutation(chosen)[:_PIXELS]
    x = np.broadcast_to(cells.x[:, None, :], cells.share.shape).ravel()[chosen]
    y = np.broadcast_to(cells.y[:, :, None], cells.share.shape).ravel()[chosen]
    light, weight = cells.light.ravel()[chosen], np.sqrt(cells.share.ravel()[chosen])
    top = levels.top - levels.bottom

    def residuals(values: Floats) -> Floats:
        right, down, *shape = values
        return np.asarray(weight * (SubimageShape(*shape).draw(x - right, y - down, lattice, top) - light) / top)

    radius = 0.5 * lattice.pitch
    start = (0.0, 0.0, 1.2 * top, 0.2, 0.9 * radius, 0.5, 0.0, 0.5)
    lowest = (-radius, -radius, 0.0, 0.0, 0.2 * radius, 0.1, -top, 0.0)
    highest = (radius, radius, 10.0 * top, 1.0, 2.0 * radius, radius, top, 1.0)
    found = least_squares(
        residuals,
        start,
        bounds=(lowest, highest),
        x_scale=(1, 1, top, 1, radius, 1, top, 1),
        ftol=1e-6,
        max_nfev=_ROUNDS,
    )
    return SubimageShape(*(float(value) for value in found.x[2:]))


class PixelBias(NamedTuple):
    """Error of the middles of sub-images that pixels make.

    table : right and down (px), by the place of the middle inside its pixel (rows, columns, 2).
    """

    table: Floats

    def at(self, middles: Floats) -> Floats:
        """Look up the error (n, 2) of sub-images whose middles are at places (n, 2)."""
        from scipy.ndimage import map_coordinates

        places = (middles % 1.0).T[::-1] * len(self.table)
        axes = [map_coordinates(self.table[..., axis], places, order=3, mode="grid-wrap") for axis in (0, 1)]
        return np.stack(axes, axis=-1)


def measure_bias(shape: SubimageShape, lattice: Lattice, levels: Levels) -> PixelBias:
    """Draw a shape at places inside a pixel, and measure its middles."""
    reach = math.ceil(cell_radius(lattice)) + 3
    size = 2 * reach + 1
    number = max(_FEWEST_PLACES, math.ceil(_PLACES / lattice.pitch))
    phases = np.arange(number) / number
    around = np.arange(-reach, reach + 1) + 0.5
    top = levels.top - levels.bottom
    down, right = np.meshgrid(phases, phases, indexing="ij")
    x = around - right[..., None, None]
    y = around[:, None] - down[..., None, None]
    patches = shape.draw(x, y, lattice, top)
    picture = patches.swapaxes(1, 2).reshape(number * size, number * size)
    corner = np.arange(number) * size + reach
    middles = np.stack([corner + right, corner[:, None] + down], axis=-1).reshape(-1, 2)
    away = measure_subimages(picture, lattice, middles, Levels(0.0, top)).away
    return PixelBias(away.reshape(number, number, 2))
