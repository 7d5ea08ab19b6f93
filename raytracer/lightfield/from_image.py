"""The light field of a rendered picture."""

from typing import TYPE_CHECKING

from raytracer.film.light_field.field import LightField

if TYPE_CHECKING:
    from raytracer.film.image import Image


def of(image: "Image") -> LightField:
    """Return the light field that a rendered picture holds, without a copy of its pixels.

    Raises
    ------
    InputError : the picture's camera has one view only, or the picture is a crop.
    """
    from raytracer.film.light_field.layout import extract_light_field

    return extract_light_field(image)
