"""Table of the errors of the microlens grid: pitches and layouts, by what may be wrong with a white picture.

`python -m tests.lightfield.grid_matrix` prints the largest errors over all rotations; `test_grid_matrix.py` bounds
them.
Sub-images are drawn from a formula, so that the grid is known exactly: a disc whose light falls off towards its edge,
blurred as by diffraction, and cut by a second disc (a rim of the lens), which is farther off the farther out it is.
"""

import argparse
import itertools
import math
import time
from typing import NamedTuple

import numpy as np

from raytracer.lightfield.decoding.calibration import find_grid
from raytracer.lightfield.decoding.raw_image import flatten_channels
from raytracer.util.errors import InputError
from tests.lightfield.lenslet_pictures import lattice, nearest_middles

PITCHES = (6.0, 7.3, 10.0, 14.3, 20.0, 33.0, 45.0, 60.0)
ROTATIONS = (0.0, 1.3, -3.0)
LIT = 0.47
"""Radius of a sub-image, in pitches."""
BLUR = 0.5
"""Standard deviation of a sub-image's edge (px)."""
GAINS = np.array([[0.5, 1.0], [1.0, 0.7]])
"""Of red, green, green and blue filters."""


class Errors(NamedTuple):
    """Of a grid that was found, in pixels: its pitch, its offset in the middle, and the farthest off in the picture."""

    pitch: float
    offset: float
    corner: float


class Picture:
    """White picture (height, width) behind a lattice of microlenses, and what is done to it."""

    def __init__(self, pitch, hexagonal, degrees, *, microlenses=24, supersampling=None):
        width = max(480, math.ceil(microlenses * pitch))
        height = math.ceil(0.77 * width)
        self.shape, self.pitch = (height, width), pitch
        self.lattice = lattice(pitch, degrees, (5.37, 9.18), hexagonal=hexagonal)
        number = supersampling or (3 if pitch < 12.0 else 1)
        sub = (np.arange(number) + 0.5) / number
        x, y = ((np.arange(size)[:, None] + sub).ravel() for size in (width, height))
        place = np.stack(np.meshgrid(x, y), axis=-1)
        self.middle = nearest_middles(self.lattice, place)
        self.offset = place - self.middle
        self.number = number
        centre = np.array([0.5 * width, 0.5 * height])
        self.outward = (self.middle - centre) / centre[0]

    def light(self, cut_from=None, vignetting=0.3, inside=None):
        """Compute the light; a rim cuts sub-images from `cut_from` half widths off the middle on."""
        away = np.hypot(self.offset[..., 0], self.offset[..., 1])
        radius = LIT * self.pitch
        light = (1.0 - 0.35 * (away / radius) ** 2).clip(0.05) * _edge(radius - away)
        distance = np.hypot(self.outward[..., 0], self.outward[..., 1])
        light *= 1.0 - vignetting * distance**2 / (1.0 + 0.77**2)
        if cut_from is not None:
            # The rim is a fifth larger than the pupil, and reaches it at `cut_from`.
            moved = self.offset + 0.2 * radius * self.outward / cut_from
            light *= _edge(1.2 * radius - np.hypot(moved[..., 0], moved[..., 1]))
        if inside is not None:
            light *= inside(self.middle[..., 0] / self.shape[1], self.middle[..., 1] / self.shape[0])
        height, width = self.shape
        return light.reshape(height, self.number, width, self.number).mean(axis=(1, 3))

    def errors(self, white):
        """Find the grid of a picture, and compare it with the true one."""
        found = find_grid(white.astype(np.float32)).lattice
        height, width = self.shape
        if found.hexagonal != self.lattice.hexagonal:
            return Errors(math.inf, math.inf, math.inf)
        across = np.hypot(*found.across) - np.hypot(*self.lattice.across)
        corners = itertools.product((0, width), (0, height))
        away = [_apart(found, self.lattice, place) for place in ((0.5 * width, 0.5 * height), *corners)]
        pitch = max(abs(found.pitch - self.pitch), abs(across))
        return Errors(float(pitch), away[0], max(away))


def _edge(inside):
    from scipy.special import ndtr

    return ndtr(inside / BLUR)


def _apart(found, true, place):
    """Return the distance of two lattices at a place, by the true microlens nearest to it; counted from the middle."""
    column, row = np.rint(found.index(place))
    here = found.place(column, row)
    away = true.near(tuple(here)).origin - here
    return float(np.hypot(*away))


def noisy(light, seed=1):
    """Add photon noise of a full well of 4000, and read noise."""
    rng = np.random.default_rng(seed)
    return rng.poisson(4000.0 * light.clip(0.0)) / 4000.0 + 0.02 + rng.normal(0.0, 0.004, light.shape)


def _bayer(picture):
    light = noisy(
        picture.light()
        * np.tile(GAINS, [math.ceil(n / 2) for n in picture.shape])[: picture.shape[0], : picture.shape[1]]
    )
    return flatten_channels(light.astype(np.float32), "rggb")


def _half(picture, dark):
    light = picture.light()
    light[:, light.shape[1] // 2 :] *= dark
    return noisy(light)


def _framed(picture, left, top, right, bottom):
    return noisy(picture.light(inside=lambda x, y: (x > left) & (x < 1.0 - right) & (y > top) & (y < 1.0 - bottom)))


CASES = {
    "clean": lambda p: p.light(),
    "noisy": lambda p: noisy(p.light()),
    "clipped": lambda p: np.minimum(noisy(p.light()), 0.6),
    "half dark": lambda p: _half(p, 0.1),
    "half black": lambda p: _half(p, 0.0),
    "framed": lambda p: _framed(p, 0.2, 0.2, 0.2, 0.2),
    "one side": lambda p: _framed(p, 0.4, 0.0, 0.0, 0.0),
    "vignetted": lambda p: noisy(p.light(vignetting=0.9)),
    "cat's eyes": lambda p: noisy(p.light(cut_from=0.5, vignetting=0.5)),
    "cat's eyes early": lambda p: noisy(p.light(cut_from=0.3, vignetting=0.5)),
    "bayer": _bayer,
}


def measure(pitch, hexagonal, degrees, cases=tuple(CASES)):
    """Measure the errors of some cases of one lattice."""
    picture, errors = Picture(pitch, hexagonal, degrees), {}
    for name in cases:
        try:
            errors[name] = picture.errors(CASES[name](picture))
        except InputError:
            errors[name] = Errors(math.nan, math.nan, math.nan)
    return errors


def _main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--pitch", type=float, nargs="*", default=PITCHES)
    parser.add_argument("--rotation", type=float, nargs="*", default=ROTATIONS)
    parser.add_argument("--case", nargs="*", default=list(CASES))
    options = parser.parse_args()
    worst = {}
    print("pitch offset corner, thousandths of a pixel; nan: refused")
    print(f"{'':12s}" + "".join(f"{name:>17s}" for name in options.case))
    for pitch, hexagonal in itertools.product(options.pitch, (False, True)):
        began = time.process_time()
        all_errors = [measure(pitch, hexagonal, degrees, options.case) for degrees in options.rotation]
        line = f"{pitch:5.1f} {'hex' if hexagonal else 'sq':5s} "
        for name in options.case:
            each = 1e3 * np.max([errors[name] for errors in all_errors], axis=0)
            worst[name] = np.maximum(worst.get(name, 0.0), each)
            line += f"{each[0]:5.1f}{each[1]:6.1f}{each[2]:6.0f}"
        print(line, f"{time.process_time() - began:5.0f} s", flush=True)
    print("worst       " + "".join(f"{each[0]:5.1f}{each[1]:6.1f}{each[2]:6.0f}" for each in worst.values()))


if __name__ == "__main__":
    _main()
