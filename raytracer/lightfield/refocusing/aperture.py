"""Aperture of a refocused photograph: its size, shape and place, from the options of `refocus`."""

import math
from typing import Any, NamedTuple

from raytracer.film.light_field.focusing import aperture_diameter
from raytracer.film.light_field.views import Views
from raytracer.plugins.apertures.base.interface import ApertureSpec
from raytracer.util.errors import InputError


class RefocusAperture(NamedTuple):
    """Aperture through which a photograph is taken.

    diameter : of the disc of the same area (m); None for all that the views look through.
    shape : packed; None for a disc.
    center : right and up (m).
    """

    diameter: float | None
    shape: Any
    center: tuple[float, float]


def make_aperture(
    views: Views,
    f_number: float | None,
    aperture: float | None,
    shape: ApertureSpec | str | None,
    center: tuple[float, float],
) -> RefocusAperture:
    """Make the aperture that options describe.

    Raises
    ------
    InputError : the options contradict each other, or the size is missing or impossible.
    """
    if f_number is not None and aperture is not None:
        raise InputError("f_number and aperture both set the size of the opening: give one of them")
    if f_number is not None:
        try:
            aperture = aperture_diameter(views, f_number)
        except ValueError as error:
            raise InputError(str(error)) from None
    if aperture is not None and not 0.0 < aperture < math.inf:
        raise InputError(f"an aperture must be greater than 0 and finite, got {aperture:g} m")
    if aperture is None and (shape is not None or center != (0.0, 0.0)):
        aperture = views.aperture
        if aperture is None:
            raise InputError("an aperture's shape or place needs its size: give aperture")
    return RefocusAperture(aperture, _pack_shape(shape), center)


def _pack_shape(shape: ApertureSpec | str | None) -> Any:
    """Pack the shape of an aperture; None stays None."""
    if shape is None:
        return None
    if isinstance(shape, str):
        shape = parse_aperture(shape)
    from raytracer.scene.assets.images import read_image

    # The assets of apertures are pictures.
    try:
        return shape.pack({key: read_image(getattr(shape, key)) for key in shape.loads})
    except ValueError as error:
        raise InputError(str(error)) from None


def parse_aperture(text: str) -> ApertureSpec:
    """Parse an aperture as scenes write it: a type, or a mapping in YAML, `{type: polygon, blades: 7}`.

    Raises
    ------
    InputError : the text describes none.
    """
    from pydantic import TypeAdapter, ValidationError

    from raytracer.schema.registry import APERTURES
    from raytracer.schema.yaml_parser import parse

    root = parse(text, "", option=f"aperture_shape {text}")
    try:
        aperture = TypeAdapter(APERTURES.union_or_name()).validate_python(None if root is None else root.plain())
    except ValidationError as error:
        reason = str(error.errors()[0]["msg"]).removeprefix("Value error, ")
        wanted = reason or "must be a type of aperture, or a mapping such as {type: polygon, blades: 6}"
        raise InputError(f"aperture_shape {text}: {wanted}") from None
    assert isinstance(aperture, ApertureSpec)
    return aperture
