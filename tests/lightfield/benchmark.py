"""Scenes in the spirit of the 4D Light Field Benchmark, small and exact, and the baseline that its paper compares with.

The four stratified scenes of the benchmark each vary one difficulty: backgammon (slats that hide more and more of what
is behind), dots (noise that grows), pyramids (curved and slanted solids), stripes (contrast and texture that fall).
Disparities stay within one pixel from view to view, for which the structure tensor was published.

References: Honauer, Johannsen, Kondermann, Goldluecke 2016, "A Dataset and Evaluation Methodology for Depth Estimation
    on 4D Light Fields", sec. 3 and 4; Wanner, Goldluecke 2014, "Variational Light Field Analysis for Disparity
    Estimation and Super-Resolution", sec. 3.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from raytracer.film.light_field.field import LightField
from tests.lightfield.analytic import Array, Mask, Meetable, Surface, Texture, light_field, views, waves

SIZE, VIEWS, SPACING = 144, 9, 0.02


@dataclass(frozen=True)
class Masked:
    """A plane cut out by a shape: `inside` of places right and up (m)."""

    plane: Surface
    inside: Callable[[Array, Array], Mask]

    @property
    def texture(self) -> Texture:
        return self.plane.texture

    def meet(self, at: tuple[float, float], slope_x: Array, slope_y: Array) -> tuple[Array, Mask]:
        z, hit = self.plane.meet(at, slope_x, slope_y)
        return z, hit & self.inside(at[0] + slope_x * z, at[1] + slope_y * z)


@dataclass(frozen=True)
class Sphere:
    """A ball around (x, y, z) (m)."""

    center: tuple[float, float, float]
    radius: float
    texture: Texture

    def meet(self, at: tuple[float, float], slope_x: Array, slope_y: Array) -> tuple[Array, Mask]:
        x, y, z = self.center
        a = slope_x**2 + slope_y**2 + 1.0
        b = slope_x * (at[0] - x) + slope_y * (at[1] - y) - z
        c = (at[0] - x) ** 2 + (at[1] - y) ** 2 + z * z - self.radius**2
        root = b * b - a * c
        return (-b - np.sqrt(np.maximum(root, 0.0))) / a, root > 0.0


@dataclass(frozen=True)
class Pyramid:
    """The convex solid behind all of some planes: where rays have entered the last of them."""

    planes: Sequence[Surface]
    reach: float

    @property
    def texture(self) -> Texture:
        return self.planes[0].texture

    def meet(self, at: tuple[float, float], slope_x: Array, slope_y: Array) -> tuple[Array, Mask]:
        z = np.max([plane.meet(at, slope_x, slope_y)[0] for plane in self.planes], axis=0)
        return z, z < self.reach


def pyramid(x: float, y: float, tip: float, slope: float, base: float, texture: Texture) -> Pyramid:
    """Build a pyramid whose tip at (x, y) points at the views, and whose base is at a distance (m)."""
    faces = [
        Surface(tip - a * x - b * y, texture, tilt=(a, b))
        for a, b in ((slope, 0.0), (-slope, 0.0), (0.0, slope), (0.0, -slope))
    ]
    return Pyramid(faces, base)


def striped(finest: float, seed: int) -> Texture:
    """Vary the contrast of a texture from left to right, between bands, as in the benchmark's stripes."""
    wavy = waves(seed, finest)

    def texture(x: Array, y: Array) -> Array:
        x, y = np.broadcast_arrays(x, y)
        contrast = np.where(np.sin(2.0 * math.pi * y / 0.25) > 0.0, 1.0, 0.12)[..., None]
        return 0.5 + contrast * (wavy(x, y) - 0.5)

    return texture


def scene(name: str) -> LightField:
    """Render one of the scenes: backgammon, dots, pyramids, stripes, or curved."""
    geometry = views(VIEWS, VIEWS, spacing=SPACING, width=SIZE, height=SIZE, vfov=30.0, focus_distance=2.3)
    surfaces, noise = SCENES[name]
    if name != "dots":
        return light_field(geometry, surfaces, noise=noise, supersampling=2)
    field = light_field(geometry, surfaces, supersampling=2)
    random = np.random.default_rng(1)
    grows = np.linspace(0.0, noise, SIZE)[:, None, None]
    return LightField(field.radiance + grows * random.standard_normal(field.radiance.shape), geometry, field.layers)


def _slats() -> list[Meetable]:
    # Slats that narrow upwards, before a wall that leans.
    def inside(x: Array, y: Array) -> Mask:
        return np.abs(np.mod(x + 0.12, 0.24) - 0.12) < 0.02 + 0.035 * (y + 0.5)

    return [
        Surface(2.9, waves(3, 0.05), tilt=(0.2, 0.1)),
        Masked(Surface(1.9, waves(4, 0.03), bounds=(-0.6, -0.4, 0.6, 0.4)), inside),
    ]


def _dots() -> list[Meetable]:
    def inside(x: Array, y: Array) -> Mask:
        return np.hypot(np.mod(x + 0.125, 0.25) - 0.125, np.mod(y + 0.125, 0.25) - 0.125) < 0.06

    return [Surface(2.8, waves(5, 0.05)), Masked(Surface(2.1, waves(6, 0.04)), inside)]


SCENES: dict[str, tuple[list[Meetable], float]] = {
    "backgammon": (_slats(), 0.01),
    "dots": (_dots(), 0.15),
    "pyramids": (
        [
            Surface(2.9, waves(7, 0.05)),
            pyramid(-0.3, 0.25, 1.9, 3.0, 2.9, waves(8, 0.05)),
            pyramid(0.3, -0.25, 2.1, 2.0, 2.9, waves(9, 0.05)),
            Sphere((0.3, 0.3, 2.4), 0.25, waves(10, 0.04)),
            Sphere((-0.3, -0.3, 2.9), 0.28, waves(11, 0.04)),
        ],
        0.01,
    ),
    "stripes": ([Surface(2.4, striped(0.04, 12), tilt=(0.35, 0.2))], 0.01),
    "curved": (
        [Surface(3.0, waves(13, 0.05), tilt=(0.2, 0.3)), Sphere((0.0, 0.0, 2.6), 0.6, waves(14, 0.04))],
        0.02,
    ),
}

INNER, OUTER = 0.8, 0.8


def structure_tensor(field: LightField, inner: float = INNER, outer: float = OUTER) -> Array:
    """Estimate the disparity of the middle view (pixels from view to view) as Wanner and Goldluecke do, sec. 3.

    Of the slices through the middle row and column of views, the structure tensor with Gaussian derivatives at the
    inner scale, averaged at the outer one; the direction of its smaller eigenvector; and of both slices the one whose
    coherence is larger.  Values of colour channels are added.
    """
    row, column = field.views.nearest()
    radiance = np.asarray(field.radiance)
    results = []
    for stack, axis in ((radiance[row], 2), (radiance[:, column], 1)):
        xx = xu = uu = 0.0
        for channel in range(3):
            volume = stack[..., channel]
            sigma = [inner if other in {0, axis} else 0.0 for other in range(3)]
            along = ndimage.gaussian_filter(volume, sigma, order=[int(other == axis) for other in range(3)])
            across = ndimage.gaussian_filter(volume, sigma, order=[int(other == 0) for other in range(3)])
            wide = [outer if other in {0, axis} else 0.0 for other in range(3)]
            xx = xx + ndimage.gaussian_filter(along * along, wide)
            xu = xu + ndimage.gaussian_filter(along * across, wide)
            uu = uu + ndimage.gaussian_filter(across * across, wide)
        middle = row if axis == 1 else column
        xx, xu, uu = (np.asarray(value)[middle] for value in (xx, xu, uu))
        angle = 0.5 * np.arctan2(2.0 * xu, xx - uu)
        # The gradient is across the line: it moves by -tan(angle) pixels a view; to the left for what is near.
        root = (uu - xx) ** 2 + 4.0 * xu**2
        results.append((np.tan(angle), root / np.maximum((xx + uu) ** 2, 1e-300)))
    (first, sure), (second, sure_second) = results
    return np.where(sure >= sure_second, first, second)
