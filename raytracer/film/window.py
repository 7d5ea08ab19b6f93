"""Windows: rectangles of a picture's pixels, such as tiles and crops."""

from typing import NamedTuple

from raytracer.util.errors import InputError


class Window(NamedTuple):
    """Pixels left <= x < right, top <= y < bottom of the picture."""

    left: int
    top: int
    right: int
    bottom: int

    @property
    def pixels(self) -> int:
        """Count the pixels."""
        return (self.right - self.left) * (self.bottom - self.top)


def crop_window(size: tuple[int, int], crop: tuple[int, int, int, int] | None, whole: str) -> Window:
    """Make the window of a crop (x0, y0, x1, y1), or of a whole picture of width x height pixels if there is none.

    whole : what the picture is called in messages.

    Raises InputError: the crop is empty, or not within the picture.
    """
    width, height = size
    if crop is None:
        return Window(0, 0, width, height)
    window = Window(*crop)
    if not (0 <= window.left < window.right <= width and 0 <= window.top < window.bottom <= height):
        corners = ",".join(map(str, crop))
        raise InputError(f"crop {corners} must lie within {whole}, 0,0,{width},{height}, and hold at least a pixel")
    return window
