"""The picture of a render that is under way, as the page and files take it."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.film.film import Film
from raytracer.film.image import Image
from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.layout import extract_light_field
from raytracer.film.light_field.views import Views
from raytracer.lightfield.refocusing.refocus import refocus
from raytracer.rendering.adaptive_sampling import Outcome
from raytracer.rendering.compilation import PreparedScene
from raytracer.rendering.develop import develop_image, expose_radiance, light_field_layout
from raytracer.rendering.film_region import FilmRegion
from raytracer.rendering.session import Rendered, RenderSession

RADIANCE, ERROR, SAMPLES = "radiance", "standard error", "samples"
"""Layers that every picture has; AOVs come after these."""

REFOCUSED = "refocused"
"""Layer of a light field: the photograph that is made of it."""


class PictureSource:
    """The samples of one render: a preview that is there at once, and the film above it.

    job : number of the edit that it shows.
    step : 1 in full size, 8 of an eighth of the width and height.
    """

    def __init__(self, job: int, step: int, prepared: PreparedScene, session: RenderSession) -> None:
        self.job, self.step = job, step
        self.prepared, self.session = prepared, session
        self.below: NDArray[np.float64] | None = None
        self.rendered: Rendered | None = None
        # A preview's pixels are too few for views, and views with poses of their own have no plane of focus.
        layout = light_field_layout(prepared.packed.spec) if step == 1 else None
        views = None if layout is None else layout.views
        self.has_views = isinstance(views, Views) and views.rows * views.columns > 1

    @property
    def samples(self) -> float:
        """Return the mean number of samples of a pixel."""
        return self.session.queue.samples

    @property
    def layers(self) -> tuple[str, ...]:
        """Name what can be shown of it."""
        return (RADIANCE, *([REFOCUSED] if self.has_views else []), ERROR, SAMPLES, *self.prepared.options.aovs)

    def film_mean(self, width: int, height: int) -> NDArray[np.float64]:
        """Return the undeveloped radiance as a picture of this size."""
        mean = self.session.region.film.mean
        return enlarge(mean, width, height)

    def image(self) -> Image:
        """Develop the picture so far; pixels without a sample are those of the preview below."""
        if self.rendered is not None:
            return self.rendered.image
        region, mean = self.session.region, self._mean()
        if mean is region.film.mean:
            return self.session.picture(Outcome(reached=False, pilot_samples=0, pilot_rays=0))
        film = region.film
        seen = FilmRegion(Film(mean, film.m2, film.count, film.nan_count, film.removed), region.recording)
        return develop_image(seen, self.prepared.packed.spec, self.prepared.options)[0]

    def _mean(self) -> NDArray[np.float64]:
        """Return the radiance so far; pixels without a sample are those of the preview below."""
        film = self.session.region.film
        if self.below is None or film.count.all():
            return film.mean
        return np.where((film.count > 0)[..., None], film.mean, self.below)

    def layer(self, name: str, distance: float | None = None) -> NDArray[np.float32]:
        """Return a layer of the picture, float32 (height, width, channels); zero where it is not known.

        distance (m) : at which REFOCUSED is focused; None for where all views see the same.

        Raises
        ------
        KeyError : it has no such layer.
        """
        if name not in self.layers:
            raise KeyError(name)
        if name == SAMPLES:
            return _as_frame(self.session.region.film.count)
        if name == RADIANCE and self.rendered is None:
            return _as_frame(expose_radiance(self._mean(), self.prepared.packed.spec))
        image = self.image()
        if name == RADIANCE:
            return _as_frame(image.radiance)
        if name == REFOCUSED:
            field = extract_light_field(image)
            assert isinstance(field, LightField)
            return _as_frame(refocus(field, distance).radiance)
        if name == ERROR:
            return _as_frame(_standard_error(image))
        return _as_frame(image.layers[name])

    def values(self, x: int, y: int) -> dict[str, list[float]]:
        """Return all layers at a pixel of the picture."""
        image = self.image()
        layers: Mapping[str, NDArray[Any]] = {
            RADIANCE: image.radiance,
            ERROR: _standard_error(image),
            SAMPLES: self.session.region.film.count,
            **image.layers,
        }
        return {name: np.atleast_1d(layer[y, x]).astype(float).tolist() for name, layer in layers.items()}


def enlarge(pixels: NDArray[Any], width: int, height: int) -> NDArray[Any]:
    """Enlarge a picture by repeating its pixels."""
    rows = np.arange(height) * pixels.shape[0] // height
    columns = np.arange(width) * pixels.shape[1] // width
    return np.asarray(pixels[rows[:, None], columns])


def _standard_error(image: Image) -> NDArray[np.float64]:
    """Compute the standard error of each value; zero where it is not known."""
    if image.variance is None:
        return np.zeros_like(image.radiance)
    known = np.where(np.isfinite(image.variance), np.maximum(image.variance, 0.0), 0.0)
    return np.asarray(np.sqrt(known))


def _as_frame(layer: NDArray[Any]) -> NDArray[np.float32]:
    """Convert a layer to what is sent: one channel, or the first three."""
    with np.errstate(over="ignore"):
        values = np.asarray(layer, dtype=np.float32)
    if values.ndim == 2:
        return values[..., None]
    return values[..., :3] if values.shape[2] >= 3 else values[..., :1]


@dataclass(frozen=True)
class Frame:
    """A layer of a picture, as it is sent.

    pixels : float32 (height, width, 1 or 3).
    """

    job: int
    step: int
    layer: str
    samples: float
    is_done: bool
    pixels: NDArray[np.float32]

    def encode(self) -> bytes:
        """Encode as a line of JSON, padded to whole words, and the pixels in little endian."""
        height, width, channels = self.pixels.shape
        head = {
            "job": self.job,
            "step": self.step,
            "layer": self.layer,
            "samples": self.samples,
            "done": self.is_done,
            "width": width,
            "height": height,
            "channels": channels,
        }
        line = json.dumps(head).encode()
        line += b" " * (-(len(line) + 1) % 4) + b"\n"
        return line + np.ascontiguousarray(self.pixels, dtype="<f4").tobytes()


def make_frame(source: PictureSource, layer: str, distance: float | None = None) -> Frame:
    """Make the frame of a layer of a picture; of its radiance if it has no such layer; see `PictureSource.layer`."""
    name = layer if layer in source.layers else RADIANCE
    is_done = source.rendered is not None and source.step == 1
    return Frame(source.job, source.step, name, source.samples, is_done, source.layer(name, distance))
