"""A developed image: linear pixel values, their variance, and the settings that it was rendered with."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from raytracer.film.formats.png import encode_png
from raytracer.film.image_file import save
from raytracer.film.light_field.layout import Layout
from raytracer.util import srgb


@dataclass(frozen=True, repr=False, eq=False)
class Image:
    """An image in linear light with the primaries and white of Rec. 709 (which are those of sRGB).

    NumPy takes it for its radiance, `np.asarray(image)`, without a copy; a notebook shows it.

    Attributes
    ----------
    radiance : float64 (height, width, 3), row 0 at the top, in W/(m2 sr), or in the scene's own plain numbers; of an
        exposed picture, values in which 1 saturates the sensor.
    variance : float64 (height, width, 3), the variance of each value of `radiance` as an estimate of its
        expectation, in the square of its unit; inf where a pixel has fewer than two samples; None if not known.
    samples : samples a pixel.
    settings : what the image was rendered with; written into the headers of the files that have any.
    layers : further arrays by name (AOVs), (height, width) or (height, width, channels); only .exr files hold them.
    channels : names of the channels of a layer in a file, where not R, G and B, or the layer's own name.
    tone_curve : maps linear values to those that a display shows, in 0..1; None for clipping.
    layout : layout of the light field that the picture holds; None where it holds none, or is only a part of one.

    Raises
    ------
    ValueError : an array is not of shape (height, width, 3), or a layer of another size.
    """

    radiance: NDArray[np.float64]
    variance: NDArray[np.float64] | None = None
    samples: int = 0
    settings: Mapping[str, str | float | int] = field(default_factory=dict)
    layers: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    channels: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    tone_curve: Callable[[NDArray[np.float64]], NDArray[np.float64]] | None = None
    layout: Layout | None = None

    def __post_init__(self) -> None:
        shape = np.shape(self.radiance)
        if len(shape) != 3 or shape[2] != 3 or 0 in shape:
            raise ValueError(f"radiance must have the shape (height, width, 3), got {shape}")
        if self.variance is not None and np.shape(self.variance) != shape:
            raise ValueError(f"variance must have the shape of radiance, {shape}, got {np.shape(self.variance)}")
        for name, layer in self.layers.items():
            if np.shape(layer)[:2] != shape[:2] or np.ndim(layer) not in (2, 3):
                raise ValueError(f"layer {name} must be of the image's size, {shape[:2]}, got {np.shape(layer)}")

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:
        """Return the radiance, without a copy unless the type asks for one."""
        if copy:
            return np.array(self.radiance, dtype)
        array = np.asarray(self.radiance, dtype)
        if copy is False and not np.shares_memory(array, self.radiance):
            raise ValueError(f"the radiance is {self.radiance.dtype}, and no view of it is {array.dtype}")
        return array

    def __repr__(self) -> str:
        height, width, _ = self.radiance.shape
        layers = f", {', '.join(self.layers)}" if self.layers else ""
        return f"<rt.Image: {width} x {height}, {self.samples} spp{layers}>"

    def display(self) -> NDArray[np.uint8]:
        """Convert for a display: uint8 (height, width, 3) in sRGB, by the tone curve, clipped at 0 and 1."""
        return srgb.to_uint8(self.radiance if self.tone_curve is None else self.tone_curve(self.radiance))

    def save(self, path: str | Path) -> None:
        """Write the image to `path`, in the format that its suffix names; see `raytracer.film.image_file.save`."""
        save(self, path)

    def _repr_png_(self) -> bytes:
        """Encode the image for a notebook."""
        return encode_png(self)
