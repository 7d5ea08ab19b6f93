"""Light fields of textured planes, computed by rays in NumPy: what a renderer should give, without noise."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.views import Plane, Views

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

Texture = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]


def waves(seed: int, finest: float, count: int = 24) -> Texture:
    """A smooth texture: sines of wavelengths from 8 times `finest` (m) to it, in all directions, around 0.5."""
    random = np.random.default_rng(seed)
    length = finest * 8.0 ** random.random(count)
    angle = random.uniform(0.0, 2.0 * math.pi, count)
    phase = random.uniform(0.0, 2.0 * math.pi, (count, 3))
    strength = 1.2 / math.sqrt(count) * random.random((count, 3)) * np.exp(1j * phase)
    fx, fy = 2.0 * math.pi / length * np.cos(angle), 2.0 * math.pi / length * np.sin(angle)

    def texture(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        if x.shape == y.shape:
            angle = x[..., None] * fx + y[..., None] * fy
            value = np.sin(angle) @ strength.real + np.cos(angle) @ strength.imag
        else:
            # A row and a column: many fewer angles.
            value = (np.exp(1j * x[..., None] * fx) * np.exp(1j * y[..., None] * fy) @ strength).imag
        return np.clip(0.5 + value, 0.0, None)

    return texture


@dataclass(frozen=True)
class Surface:
    """The plane z = distance + tilt . (X, Y), z along the axis (m); bounded (left, bottom, right, top) or not."""

    distance: float
    texture: Texture
    tilt: tuple[float, float] = (0.0, 0.0)
    bounds: tuple[float, float, float, float] | None = None

    def meet(self, at: tuple[float, float], slope_x: Array, slope_y: Array) -> tuple[Array, Mask]:
        """Return z where rays meet the plane, one number for all if it does not lean; True for those that do."""
        a, b = self.tilt
        z = np.asarray(self.distance + a * at[0] + b * at[1])
        if a or b:
            z = z / (1.0 - a * slope_x - b * slope_y)
        hit = z > 0.0
        if self.bounds is not None:
            left, bottom, far_right, top = self.bounds
            place_x, place_y = at[0] + slope_x * z, at[1] + slope_y * z
            hit = hit & (place_x >= left) & (place_x <= far_right) & (place_y >= bottom) & (place_y <= top)
        return z, hit


class Meetable(Protocol):
    """What rays can meet."""

    @property
    def texture(self) -> Texture:
        """Return the radiance at places right and up (m)."""
        ...

    def meet(self, at: tuple[float, float], slope_x: Array, slope_y: Array) -> tuple[Array, Mask]:
        """Return z (m) where rays from a place in the plane of the views meet it, and True for those that do."""
        ...


def views(
    rows: int = 9,
    columns: int = 9,
    *,
    spacing: float = 0.01,
    width: int = 96,
    height: int = 72,
    vfov: float = 30.0,
    focus_distance: float = 2.0,
) -> Views:
    """A regular array of pinholes around the axis."""
    right = spacing * (np.arange(columns) - 0.5 * (columns - 1))
    up = spacing * (0.5 * (rows - 1) - np.arange(rows))
    half = math.tan(math.radians(0.5 * vfov))
    pixel = 2.0 * half / height
    return Views(
        position=np.stack(np.meshgrid(right, up), axis=-1),
        plane=Plane(pixel=pixel, left=-0.5 * width * pixel, top=half),
        width=width,
        height=height,
        inverse_focus=0.0 if math.isinf(focus_distance) else 1.0 / focus_distance,
    )


def seen(geometry: Views, surfaces: Sequence[Meetable], at: tuple[float, float], supersampling: int = 3):
    """Render the view of a pinhole in the plane of the views: radiance (h, w, 3), and depth in pixels' middles.

    Each pixel is the mean over a grid of rays.
    """

    def traced(samples: int):
        steps = (np.arange(samples) + 0.5) / samples
        right = geometry.plane.left + geometry.plane.pixel * (np.arange(geometry.width)[:, None] + steps).ravel()
        up = geometry.plane.top - geometry.plane.pixel * (np.arange(geometry.height)[:, None] + steps).ravel()
        slope_x, slope_y = right - geometry.inverse_focus * at[0], up[:, None] - geometry.inverse_focus * at[1]
        nearest = np.full((len(up), len(right)), np.inf)
        value = np.zeros((*nearest.shape, 3))
        for surface in surfaces:
            z, hit = surface.meet(at, slope_x, slope_y)
            hit = hit & (z < nearest)
            place_x, place_y = at[0] + slope_x * z, at[1] + slope_y * z
            nearest = np.where(hit, z, nearest)
            value = np.where(hit[..., None], surface.texture(place_x, place_y), value)
        return value, nearest

    value, depth = traced(supersampling)
    if supersampling > 1:
        value = value.reshape(geometry.height, supersampling, geometry.width, supersampling, 3).mean(axis=(1, 3))
        depth = traced(1)[1]
    return value, depth


def light_field(
    geometry: Views, surfaces: Sequence[Meetable], *, noise: float = 0.0, supersampling: int = 3
) -> LightField:
    """Render all views, with the layer `depth`, exact; `noise`: standard deviation of what is added to each value."""
    found = [
        [seen(geometry, surfaces, tuple(place), supersampling) for place in row] for row in geometry.position.tolist()
    ]
    radiance = np.array([[value for value, _ in row] for row in found])
    radiance += noise * np.random.default_rng(0).standard_normal(radiance.shape)
    return LightField(
        radiance=radiance, views=geometry, layers={"depth": np.array([[depth for _, depth in row] for row in found])}
    )


def away(picture: NDArray[np.float64], exact: NDArray[np.float64], border: int = 0) -> float:
    """Root mean square of the difference, relative to that of the picture as it should be, but for a border."""
    inner = (slice(border, -border or None), slice(border, -border or None))
    return float(np.sqrt(((picture - exact)[inner] ** 2).mean() / (exact[inner] ** 2).mean()))
