"""The image formats that there are: modules of this package that declare a `FORMAT`, found by looking."""

import importlib
import pkgutil
from functools import cache

from raytracer.film import formats
from raytracer.film.formats.base.image_format import ImageFormat


@cache
def image_formats() -> dict[str, ImageFormat]:
    """Find all formats by suffix, in the order of messages; imports every module of the package.

    Raises
    ------
    TypeError : two formats have the same suffix.
    """
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


def writable_suffixes() -> tuple[str, ...]:
    """List the suffixes of all files that pictures can be written to."""
    return tuple(suffix for suffix, each in image_formats().items() if each.encode or each.write)


def image_suffixes() -> tuple[str, ...]:
    """List the suffixes of all files that hold one image, and are read as one."""
    return tuple(suffix for suffix, each in image_formats().items() if each.decode)


def display_suffixes() -> tuple[str, ...]:
    """List the suffixes of files that hold what a display shows; all others hold linear light."""
    return tuple(suffix for suffix, each in image_formats().items() if each.decode_display)
