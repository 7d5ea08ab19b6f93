"""Light fields out of pictures."""

from typing import TYPE_CHECKING

from raytracer.plenoptic.field import LightField

if TYPE_CHECKING:
    from raytracer.film.image import Image


def of(image: "Image") -> LightField:
    """The light field that a rendered picture holds, without a copy of its pixels.

    Raises
    ------
    InputError : the picture's camera has one view only, or the picture is a crop.
    """
    from raytracer.film.output import light_field

    return light_field(image)
