"""Part of a view that a refocused photograph shows."""

from typing import NamedTuple

from raytracer.film.light_field.views import Views
from raytracer.util.errors import InputError


class PixelWindow(NamedTuple):
    """Part of a view: the pixels left <= x < right, top <= y < bottom."""

    left: int
    top: int
    right: int
    bottom: int


def make_window(views: Views, crop: tuple[int, int, int, int] | None) -> PixelWindow:
    """Make the window of a crop (x0, y0, x1, y1); all of a view if there is none.

    Raises
    ------
    InputError : the crop is empty, or not within a view.
    """
    width, height = views.width, views.height
    if crop is None:
        return PixelWindow(0, 0, width, height)
    window = PixelWindow(*crop)
    if not (0 <= window.left < window.right <= width and 0 <= window.top < window.bottom <= height):
        corners = ",".join(map(str, crop))
        raise InputError(f"crop {corners} must lie within a view, 0,0,{width},{height}, and hold at least a pixel")
    return window
