"""Light field files (.lf): the views of a light field, float32, linear; layers and rays, and settings as attributes.

The file itself is that of `raytracer.film.light_field.lf`.
"""

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING

from raytracer.film.formats.base.image_format import ImageFormat
from raytracer.film.light_field.layout import extract_light_field
from raytracer.util.errors import InputError

if TYPE_CHECKING:
    from raytracer.film.image import Image


def write_lf(image: "Image", path: Path) -> None:
    """Write the light field that an image holds; an InputError says that it holds none, an OutputError why not."""
    from raytracer.film.light_field import lf

    try:
        field = extract_light_field(image)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    samples = {"samples": image.samples}
    lf.write(path, dataclasses.replace(field, settings={**field.settings, **samples}))


FORMAT = ImageFormat((".lf",), is_linear=True, has_layers=True, write=write_lf, order=100)
