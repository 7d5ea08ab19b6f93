"""Epipolar-plane images: one line of pixels from all views of a row or a column, over one another.

A point of the scene is a straight line there, which leans more the nearer the point is.

References: Bolles, Baker, Marimont 1987, "Epipolar-Plane Image Analysis"; Levoy & Hanrahan 1996, sec. 2.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.field import LightField
from raytracer.report.lettering import load_font
from raytracer.report.palette import INK, PAPER
from raytracer.util import srgb
from raytracer.util.errors import InputError

if TYPE_CHECKING:
    import PIL.ImageDraw

Direction = Literal["horizontal", "vertical"]

_TEXT, _TICK, _LEFT, _BOTTOM, _TOP, _MARGIN = 12, 4, 64, 40, 24, 16
_THICK = 12
"""Height (pixels) of each view's line in the picture."""

_TICKS = 5


@dataclass(frozen=True, eq=False)
class EpipolarSlice:
    """Epipolar-plane image.

    radiance : float64 (views, pixels, 3); of a vertical one pixels go down the views.
    places : of the views (m): right of the middle if it is horizontal, up if it is vertical.
    tangents : places of the pixels in the image at a distance of 1: right, or up.
    direction : horizontal or vertical.
    """

    radiance: NDArray[np.float64]
    places: NDArray[np.float64]
    tangents: NDArray[np.float64]
    direction: Direction


def epipolar_slice(
    field: LightField,
    *,
    direction: Direction = "horizontal",
    line: int | None = None,
    views: int | None = None,
    inverse_distance: float | None = None,
) -> EpipolarSlice:
    """Cut the slice through one line of pixels of all views of a row (horizontal) or of a column (vertical).

    Views are read one at a time, and of each one line of pixels.

    Parameters
    ----------
    line : row or column of the pixels, from 0; default: the middle.
    views : row or column of the views, from 0; default: the middle.
    inverse_distance : 1 / distance (1/m) of the points whose lines become upright; default: of the plane where all
        views see the same.

    Raises
    ------
    InputError : there is no such line, or no such row or column of views.
    """
    geometry = field.views
    is_row = direction == "horizontal"
    middle = geometry.nearest()
    number = middle[0 if is_row else 1] if views is None else views
    lines, size = (geometry.height, geometry.width) if is_row else (geometry.width, geometry.height)
    at = lines // 2 if line is None else line
    counts = (geometry.rows, geometry.columns) if is_row else (geometry.columns, geometry.rows)
    word = "row" if is_row else "column"
    if not 0 <= number < counts[0]:
        raise InputError(f"no {word} {number} of views: there are {counts[0]}, counted from 0")
    if not 0 <= at < lines:
        raise InputError(f"no {word} {at} of pixels: views have {lines}, counted from 0")

    radiance = np.empty((counts[1], size, 3))
    for index in range(counts[1]):
        radiance[index] = field.radiance[number, index, at] if is_row else field.radiance[index, number, :, at]
    places = geometry.position[number, :, 0] if is_row else geometry.position[:, number, 1]
    step = geometry.plane.pixel
    middles = (np.arange(size) + 0.5) * step
    tangents = geometry.plane.left + middles if is_row else geometry.plane.top - middles
    if inverse_distance is not None:
        radiance = _shear(radiance, places, (geometry.inverse_focus - inverse_distance) / step * (1 if is_row else -1))
    return EpipolarSlice(radiance, np.asarray(places), np.asarray(tangents, dtype=np.float64), direction)


def _shear(radiance: NDArray[np.float64], places: NDArray[np.float64], moved: float) -> NDArray[np.float64]:
    """Shift the line of each view by `moved` pixels a metre of its place."""
    from raytracer.lightfield.splines import Spline

    both = zip(radiance, places, strict=True)
    return np.stack([Spline(line[None]).shifted(float(place) * moved, 0.0)[0][0] for line, place in both])


def draw_slice(epi: EpipolarSlice, *, unit: str = "mm", scale: float = 1e3) -> NDArray[np.uint8]:
    """Draw a slice with labelled axes, uint8 (height, width, 3) in sRGB; each view is twelve pixels thick.

    unit, scale : of the views' places: the name of the unit, and its number in one of `places`.
    """
    import PIL.Image
    import PIL.ImageDraw

    body = np.repeat(srgb.to_uint8(epi.radiance), _THICK, axis=0)
    height, width = body.shape[:2]
    whole = PIL.Image.new("RGB", (_LEFT + width + 2 * _MARGIN, height + _BOTTOM + _TOP), PAPER)
    whole.paste(PIL.Image.fromarray(body), (_LEFT, _TOP))
    draw = PIL.ImageDraw.Draw(whole)

    # Places of the views, from top to bottom as they are read.
    shown = sorted({round(number) for number in np.linspace(0, len(epi.places) - 1, min(_TICKS, len(epi.places)))})
    for number in shown:
        y = _TOP + (number + 0.5) * _THICK
        draw.line((_LEFT - _TICK, y, _LEFT, y), INK)
        _write(draw, (_LEFT - _TICK - 2, y), f"{epi.places[number] * scale:.3g}", "rm")
    name = "u" if epi.direction == "horizontal" else "v"
    _write(draw, (_LEFT - _TICK - 2, _TOP / 2), f"{name} ({unit})", "rm")

    # Tangents along the pixels.
    for number in {round(number) for number in np.linspace(0, width - 1, _TICKS)}:
        x = _LEFT + number + 0.5
        draw.line((x, _TOP + height, x, _TOP + height + _TICK), INK)
        _write(draw, (x, _TOP + height + _TICK + 2), f"{epi.tangents[number]:.2f}", "ma")
    axis = "s (tangent to the right)" if epi.direction == "horizontal" else "t (tangent up)"
    _write(draw, (_LEFT + width / 2, _TOP + height + _BOTTOM - 6), axis, "mm")
    return np.asarray(whole)


def _write(draw: "PIL.ImageDraw.ImageDraw", place: tuple[float, float], text: str, anchor: str) -> None:
    """Write a label."""
    draw.text(place, text, INK, load_font(_TEXT), anchor=anchor)
