"""The image formats that there are: modules of this package that declare a `FORMAT`, found by looking."""

import importlib
import pkgutil
from collections.abc import Callable
from functools import cache

from raytracer.film import formats
from raytracer.film.formats.base.image_format import ImageFormat


@cache
def image_formats() -> dict[str, ImageFormat]:
    """Find all formats by suffix, in the order of messages; two with the same suffix are a TypeError."""
    declared = []
    for info in pkgutil.iter_modules(formats.__path__):
        module = importlib.import_module(f"{formats.__name__}.{info.name}")
        if isinstance(declaration := getattr(module, "FORMAT", None), ImageFormat):
            declared.append(declaration)
    by_suffix: dict[str, ImageFormat] = {}
    for image_format in sorted(declared, key=lambda each: (each.order, each.suffixes)):
        for suffix in image_format.suffixes:
            if suffix in by_suffix:
                raise TypeError(f"two image formats have the suffix {suffix!r}")
            by_suffix[suffix] = image_format
    return by_suffix


def _suffixes(is_meant: Callable[[ImageFormat], object]) -> tuple[str, ...]:
    return tuple(suffix for suffix, each in image_formats().items() if is_meant(each))


def writable_suffixes() -> tuple[str, ...]:
    """List the suffixes of all files that pictures can be written to."""
    return _suffixes(lambda each: each.encode or each.write)


def image_suffixes() -> tuple[str, ...]:
    """List the suffixes of all files that hold one image, and are read as one."""
    return _suffixes(lambda each: each.decode)


def picture_suffixes() -> tuple[str, ...]:
    """List the suffixes of all files that one image can be written to and read from."""
    return _suffixes(lambda each: each.decode and (each.encode or each.write))


def display_suffixes() -> tuple[str, ...]:
    """List the suffixes of images that hold what a display shows; all others hold linear light."""
    return _suffixes(lambda each: each.decode_display)


def texture_suffixes() -> tuple[str, ...]:
    """List the suffixes of all files that textures are read from."""
    return _suffixes(lambda each: each.decode_stored or each.decode)


def linear_suffixes() -> tuple[str, ...]:
    """List the suffixes of files that hold linear light, without a largest value."""
    return _suffixes(lambda each: each.is_linear)


def layered_suffixes() -> tuple[str, ...]:
    """List the suffixes of files that hold the layers of an image."""
    return _suffixes(lambda each: each.has_layers)


def map_suffixes(*, with_image: bool = True) -> tuple[str, ...]:
    """List the suffixes of files that hold a number for each pixel: as colours, as a layer of an image, or alone."""
    return _suffixes(
        lambda each: (
            each.encode_map
            or (each.encode_pixels and not each.is_lossy)
            or (with_image and each.encode and each.has_layers)
        )
    )


def animation_suffixes(*, with_images: bool = True) -> tuple[str, ...]:
    """List the suffixes of animations, after those that hold nothing else those that hold single images too."""
    alone = _suffixes(lambda each: each.encode_frames and not each.encode)
    return (*alone, *_suffixes(lambda each: each.encode_frames and each.encode)) if with_images else alone
