"""Synthetic aperture: the opening of the lens, chosen after the shot by options, as weights of the views."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.focusing import aperture_diameter, view_spacing
from raytracer.film.light_field.views import Views
from raytracer.optics.lens_system.surfaces import aperture_transmission
from raytracer.plugins.apertures.base.interface import ApertureSpec
from raytracer.util.errors import InputError

# Points along the edge of a cell, by which the part that an opening covers is measured: the area of a disc of 15 cells
# is then right to 3e-5.
_POINTS = 64

# The same for a shape that is evaluated point by point, which is slower.
_POINTS_OF_SHAPE = 24

# Rounding that is allowed where an opening is as wide as the lens.
_ROUNDING = 1e-9


def opening_transmission(
    right: NDArray[np.float64], up: NDArray[np.float64], diameter: float, shape: Any = None
) -> NDArray[np.float64]:
    """Compute the transmission of an opening at places in the plane of the views (m), 0 to 1.

    diameter : of the disc of the same area (m).
    shape : a packed aperture; None for a disc.
    """
    radius = 0.5 * diameter
    x, y = right / radius, up / radius
    if shape is None:
        return np.asarray(np.hypot(x, y) <= 1.0, dtype=np.float64)
    return np.asarray(np.vectorize(lambda a, b: aperture_transmission(shape, a, b), otypes=[np.float64])(x, y))


def cell_weights(
    views: Views, diameter: float | None = None, shape: Any = None, center: tuple[float, float] = (0.0, 0.0)
) -> NDArray[np.float64]:
    """Compute the part of each view's cell that an opening covers: float64 (rows, columns), 0 to 1.

    The cell of a view without one of its own reaches half way to its neighbours.  Behind a lens whose own opening is
    not round, no more of a cell counts than that leaves open.

    Parameters
    ----------
    diameter : of the opening (m); by default the lens's, and where there is none all views count the same.
    shape : a packed aperture (`ApertureSpec.pack`), of the same area as the disc of that diameter; a disc by default.
    center : of the opening, right and up (m).

    Raises
    ------
    InputError : the opening is wider than the lens, or than all views together, or covers no view.
    """
    is_lens = diameter is None
    if is_lens and views.coverage is not None:
        return np.array(views.coverage)
    if diameter is None:
        diameter = views.aperture
    if diameter is None:
        return np.ones((views.rows, views.columns))
    if views.aperture is not None and diameter > views.aperture * (1.0 + _ROUNDING):
        raise InputError(
            f"an opening of {1e3 * diameter:.4g} mm is wider than the lens was, {1e3 * views.aperture:.4g} mm"
            + ("" if views.focal_length is None else f" (f/{1e-3 * views.focal_length / views.aperture:.3g})")
        )
    if views.rows * views.columns == 1:
        return np.ones((1, 1))
    step = view_spacing(views)
    width, height = views.cell or (step.right or step.up, step.up or step.right)
    across, down = np.ptp(views.position.reshape(-1, 2), axis=0)
    reach = math.hypot(across + width, down + height)
    # Views may cover the middle of a lens alone; then only an opening that was asked for is refused.
    if diameter > reach * (1.0 + _ROUNDING) and not is_lens:
        raise InputError(
            f"an opening of {1e3 * diameter:.4g} mm is wider than all views together, {1e3 * reach:.4g} mm"
        )
    count = _POINTS if shape is None else _POINTS_OF_SHAPE
    inside = (np.arange(count) + 0.5) / count - 0.5
    right = views.position[..., 0, None, None] + width * inside - center[0]
    up = views.position[..., 1, None, None] + height * inside[:, None] - center[1]
    weights = opening_transmission(right, up, diameter, shape).mean(axis=(-2, -1))
    if views.coverage is not None:
        weights = np.minimum(weights, views.coverage)
    if not weights.any():
        away = math.dist(center, (0.0, 0.0))
        raise InputError(f"no view lies within an opening of {1e3 * diameter:.4g} mm, {1e3 * away:.4g} mm off the axis")
    return np.asarray(weights)


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
    """Make the aperture that options describe; an InputError says that they contradict each other, or lack a size."""
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
    if shape is None:
        return RefocusAperture(aperture, None, center)
    from raytracer.scene.assets.images import read_image

    spec = parse_aperture(shape) if isinstance(shape, str) else shape
    # The assets of apertures are pictures.
    try:
        packed = spec.pack({key: read_image(getattr(spec, key)) for key in spec.loads})
    except ValueError as error:
        raise InputError(str(error)) from None
    return RefocusAperture(aperture, packed, center)


def parse_aperture(text: str) -> ApertureSpec:
    """Parse an aperture as scenes write it: type or a mapping `{type: polygon, blades: 7}`, or raise an InputError."""
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
