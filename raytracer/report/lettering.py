"""Letters on pictures, in Pillow's own font."""

from functools import cache
from typing import TYPE_CHECKING

from raytracer.util.errors import one_line

if TYPE_CHECKING:
    import PIL.ImageFont


@cache
def load_font(size: int) -> "PIL.ImageFont.FreeTypeFont":
    """Load Pillow's own font."""
    import PIL.ImageFont

    loaded = PIL.ImageFont.load_default(size)
    # Pillow has had FreeType in it, and with it a font of any size, since it has had this argument.
    assert isinstance(loaded, PIL.ImageFont.FreeTypeFont)
    return loaded


def truncate_text(text: str, size: int, width: float) -> str:
    """Truncate a text to one line of a width (px)."""
    text, letters = one_line(text), load_font(size)
    if letters.getlength(text) <= width:
        return text
    while text and letters.getlength(f"{text}...") > width:
        text = text[:-1]
    return f"{text}..."
