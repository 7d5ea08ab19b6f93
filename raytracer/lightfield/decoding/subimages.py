"""Sub-images of microlenses: pixels by their place under the microlens, and what these say of the camera."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.lattice import Lattice

Floats = NDArray[np.float64]

_SAMPLE_SIZE = 12.0
"""Microlenses a side of the part in the picture's middle whose sub-images are taken together."""


class Subimages(NamedTuple):
    """Pixels in the middle of a picture.

    light : above black, (n,).
    offset : from the middle of the nearest sub-image, right and down (pixels), (n, 2).
    """

    light: Floats
    offset: Floats


def collect_subimages(white: NDArray[Any], lattice: Lattice, bottom: float, top: float) -> Subimages:
    """Collect the pixels in the middle of a picture, clipped to `bottom` ... `top`, by their place in a sub-image."""
    height, width = white.shape
    size = math.ceil(_SAMPLE_SIZE * lattice.pitch)
    first_row, first = max(0, (height - size) // 2), max(0, (width - size) // 2)
    part = np.clip(white[first_row : first_row + size, first : first + size].astype(np.float64), bottom, top) - bottom
    x, y = first + np.arange(part.shape[1]) + 0.5, first_row + np.arange(part.shape[0]) + 0.5
    place = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    # The nearest by index may, of hexagons, be a neighbour of the nearest.
    base = np.rint(lattice.index(place))
    around = [place - lattice.place(base[:, 0] + i, base[:, 1] + j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    offsets = np.stack(around)
    nearest = (offsets**2).sum(axis=-1).argmin(axis=0)
    return Subimages(part.reshape(-1), offsets[nearest, np.arange(len(place))])


def wave_tilt(subimages: Subimages, frequency: Floats) -> NDArray[np.complex128]:
    """Compute the tilt (2,) of a wave for each unit of fall-off of the light a pixel.

    The light under one microlens is that at its middle, so that with a fall-off g from one to the next a block holds
    f (1 + g . (x - offset)): besides the wave c of f the first moments m of one sub-image, c - g . m.
    """
    wave = subimages.light * np.exp(-2j * np.pi * (subimages.offset @ frequency))
    return np.asarray((wave @ subimages.offset) / wave.sum())


def lit_diameter(subimages: Subimages, lattice: Lattice) -> float:
    """Measure the diameter (pixels) of the disc as large as the part of a sub-image above half its peak light."""
    light, away = subimages.light, np.hypot(subimages.offset[:, 0], subimages.offset[:, 1])
    bright = float(np.median(light[away < 0.25 * lattice.pitch]))
    share = np.count_nonzero(light >= 0.5 * bright) / light.size
    return min(lattice.pitch, 2.0 * math.sqrt(share * lattice.area / math.pi))
