"""Images to compare, from memory or files, with the properties that a comparison needs.

A picture is either linear light or display values, which are what .png and .jpg files hold: sRGB-encoded, in 0..1.
"""

import math
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raytracer.film.formats.registry import display_suffixes, image_formats
from raytracer.film.image import Image
from raytracer.film.image_file import load, load_encoded, load_layers
from raytracer.film.white_balance import AUTO
from raytracer.util import srgb
from raytracer.util.errors import InputError

Array = NDArray[np.float64]

Source = str | Path | Image | ArrayLike
"""A file's name, an image that was rendered, or an array (height, width, 3): uint8 for display values, else linear."""


class ComparedImage(NamedTuple):
    """An image to compare.

    name : for messages.
    values : float64 (height, width, 3), linear or, if `is_display`, encoded in 0..1.
    image : the rendered image, if it comes from memory.
    variance : of `values`; None for the reason that `unknown` gives.
    sampler : of the render; "" if not known.
    spp : samples per pixel, the mean if they differ; None if not known.
    measured_gains : factors of the channels (3,) by each of `auto` exposure and white balance.
    """

    name: str
    values: Array
    is_display: bool
    image: Image | None = None
    variance: Array | None = None
    unknown: str = "holds no variance"
    sampler: str = ""
    spp: float | None = None
    measured_gains: Mapping[str, Array] = MappingProxyType({})

    def to_display_bytes(self) -> NDArray[np.uint8]:
        """Convert to display values, as in a .png file."""
        if self.is_display:
            return np.rint(255.0 * np.nan_to_num(self.values)).astype(np.uint8)
        return srgb.to_uint8(self.values) if self.image is None else self.image.display()


def read(source: Source, name: str) -> ComparedImage:
    """Read an image from a `source`; `name` is for sources without one.

    Raises
    ------
    InputError : a file is missing, broken or of an unknown suffix, or an array is not an image.
    """
    if isinstance(source, Image):
        return _of_image(source, name)
    if isinstance(source, str | Path):
        return _of_file(Path(source))
    array = np.asarray(source)
    if array.ndim != 3 or array.shape[2] != 3 or array.size == 0 or array.dtype.kind not in "fiub":
        raise InputError(f"{name}: an image has the shape (height, width, 3), got {array.dtype} {array.shape}")
    if array.dtype == np.uint8:
        return ComparedImage(name, array / 255.0, True)
    return ComparedImage(name, array.astype(np.float64, copy=False), False)


def _of_image(image: Image, name: str) -> ComparedImage:
    picture = ComparedImage(name, image.radiance, False, image, **_recorded(image.settings))
    if image.variance is None:
        return picture._replace(unknown="was denoised" if "denoised" in image.settings else "has no variance")
    return _with_variance(picture, image.variance)


def _of_file(path: Path) -> ComparedImage:
    if path.suffix.lower() in display_suffixes():
        return ComparedImage(str(path), load_encoded(path), True)
    image_format = image_formats().get(path.suffix.lower())
    if image_format is None or image_format.decode_layers is None:
        return ComparedImage(str(path), load(path), False)
    layers, settings = load_layers(path, {"radiance", "variance", "Y"})
    if "radiance" not in layers and "Y" not in layers:
        raise InputError(f"{path}: has neither channels R, G and B nor Y")
    values = layers["radiance"] if "radiance" in layers else np.repeat(layers["Y"][..., None], 3, axis=2)
    picture = ComparedImage(str(path), values, False, **_recorded(settings))
    given = layers.get("variance")
    if given is None or given.shape != values.shape:
        return picture
    if "denoised" in settings:
        return picture._replace(unknown="was denoised")
    return _with_variance(picture, given)


def _recorded(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Read sampler, samples a pixel and measured gains from an image's settings, which a file holds as strings."""
    try:
        spp = float(settings["spp"])
    except (KeyError, ValueError):
        spp = None
    return {"sampler": str(settings.get("sampler", "")), "spp": spp, "measured_gains": _measured_gains(settings)}


def _measured_gains(settings: Mapping[str, Any]) -> dict[str, Array]:
    """Read the gains that were measured on the picture itself: (3,) of exposure, and of white balance.

    The compensation of an exposure was not measured, and is left out.
    """
    measured: dict[str, Array] = {}
    try:
        if "metering" in settings:
            compensation = float(settings.get("exposure_compensation", 0.0))
            measured["exposure"] = np.full(3, float(settings["exposure_gain"]) / math.exp2(compensation))
        if settings.get("white_balance") == AUTO:
            measured["white_balance"] = np.array(
                [float(gain) for gain in str(settings["white_balance_gains"]).split(",")]
            )
    except (KeyError, ValueError, ArithmeticError):
        return {}
    is_known = all(gain.shape == (3,) and np.all(np.isfinite(gain) & (gain > 0.0)) for gain in measured.values())
    return measured if is_known else {}


def _with_variance(picture: ComparedImage, variance: Array) -> ComparedImage:
    if np.isfinite(variance).all():
        return picture._replace(variance=variance, unknown="")
    return picture._replace(unknown="does not know its variance everywhere, which takes two samples in every pixel")
