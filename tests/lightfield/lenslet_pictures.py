"""Raw pictures of a camera with microlenses, drawn from formulas: what the decoder must find again is known exactly.

A point of the sensor belongs to the nearest microlens, at `offset` from the middle of its sub-image, and sees what is
at the microlens plus `slope` times the offset: a scene in one plane, that is moved by `slope` pixels of the raw picture
from one view to the next.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from raytracer.film.light_field.lattice import Lattice


def lattice(pitch, degrees, offset, *, hexagonal=False):
    """Turned counter-clockwise as seen, with a middle at `offset`."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    turn = np.array([[c, s], [-s, c]])
    across = (0.5 * pitch, 0.5 * math.sqrt(3.0) * pitch) if hexagonal else (0.0, pitch)
    return Lattice(tuple(offset), tuple(map(float, turn @ (pitch, 0.0))), tuple(map(float, turn @ across)))


def nearest_middles(lattice, place):
    """Find the middles (..., 2) of the sub-images nearest to places (..., 2)."""
    # In a grid of squares or hexagons the nearest one is a corner of the cell.
    base = np.floor(lattice.index(place))
    corners = [lattice.place(base[..., 0] + i, base[..., 1] + j) for i in (0, 1) for j in (0, 1)]
    nearest = np.argmin([((place - corner) ** 2).sum(axis=-1) for corner in corners], axis=0)
    return np.choose(nearest[..., None], corners)


def texture(x, y, period):
    """Something smooth with three colours, (..., 3), 0.1 to 0.9, whose shortest wave is `period` long."""
    k = 2.0 * np.pi / period
    waves = [
        np.sin(0.9 * k * x + 0.3 * k * y) * np.cos(0.4 * k * y),
        np.cos(0.5 * k * x - 0.7 * k * y + 1.0),
        np.sin(0.2 * k * x + 0.95 * k * y + 2.0) * np.sin(0.3 * k * x),
    ]
    return 0.5 + 0.4 * np.stack(waves, axis=-1)


@dataclass(frozen=True)
class Camera:
    lattice: Lattice
    width: int
    height: int
    lit: float = 0.47
    """Radius of a sub-image, in pitches."""
    falloff: float = 0.35
    """How much darker a sub-image is at its edge than in its middle."""
    vignetting: float = 0.5
    """How much darker the picture's corner is than its middle."""
    soft: float = 0.5
    """Width of a sub-image's edge (pixels)."""

    @lru_cache(maxsize=2)  # noqa: B019
    def _parts(self, supersampling):
        sub = (np.arange(supersampling) + 0.5) / supersampling
        x = (np.arange(self.width)[:, None] + sub).ravel()
        y = (np.arange(self.height)[:, None] + sub).ravel()
        place = np.stack(np.meshgrid(x, y), axis=-1)
        return place, nearest_middles(self.lattice, place)

    def transmission(self, place, middle):
        """Compute the part of the light that arrives."""
        pitch = self.lattice.pitch
        offset = place - middle
        away = np.hypot(offset[..., 0], offset[..., 1])
        edge = 1.0 / (1.0 + np.exp(np.clip((away - self.lit * pitch) / (0.25 * self.soft), -50, 50)))
        centre = np.array([0.5 * self.width, 0.5 * self.height])
        corner = float(np.hypot(*centre))
        outward = (middle - centre) / corner
        inner = 1.0 - self.falloff * (away / (self.lit * pitch)) ** 2
        return np.clip(inner, 0.05, None) * edge * (1.0 - self.vignetting * (outward**2).sum(axis=-1))

    def picture(self, scene=None, slope=0.0, supersampling=2):
        """Expected light (height, width) for a white scene, (height, width, 3) for `scene(x, y)` in raw pixels."""
        place, middle = self._parts(supersampling)
        light = self.transmission(place, middle)
        if scene is not None:
            seen = middle + slope * (place - middle)
            light = light[..., None] * scene(seen[..., 0], seen[..., 1])
        shape = (self.height, supersampling, self.width, supersampling, *light.shape[2:])
        return light.reshape(shape).mean(axis=(1, 3))


def spoiled(picture, seed, *, photons=4000.0, read=0.004, dark=0.02, clip=None, dust=0, hot=0.0, half_lit=0.0):
    """As a camera would record it: dust, a border in half-light, photon and read noise, hot pixels, clipping."""
    rng = np.random.default_rng(seed)
    light = picture * np.asarray(dusty(picture.shape[:2], dust))[(...,) + (None,) * (picture.ndim - 2)]
    if half_lit:
        shade = np.ones(picture.shape[:2])
        edge = int(half_lit)
        shade[:, :edge] = np.linspace(0.0, 1.0, edge)
        shade[-edge:] *= np.linspace(1.0, 0.1, edge)[:, None]
        light = light * shade.reshape(*shade.shape, *(1,) * (picture.ndim - 2))
    out = rng.poisson(photons * light) / photons + dark + rng.normal(0.0, read, light.shape)
    if hot:
        where = np.random.default_rng(7).random(picture.shape[:2]) < hot
        out[where] = 1.0 if clip is None else clip
    return out if clip is None else np.minimum(out, clip)


def dusty(shape, number):
    """Compute the part of the light that passes specks of dust, which stay where they are."""
    rng = np.random.default_rng(11)
    shade = np.ones(shape)
    y, x = np.mgrid[: shape[0], : shape[1]]
    for _ in range(number):
        cx, cy, r = rng.uniform(0, shape[1]), rng.uniform(0, shape[0]), rng.uniform(3.0, 15.0)
        shade *= 1.0 - 0.8 / (1.0 + np.exp(np.clip(np.hypot(x - cx, y - cy) - r, -30, 30)))
    return shade
