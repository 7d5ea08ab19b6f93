"""PNG files (.png): 8 bits a channel, sRGB, by the tone curve; each setting is a text chunk.

`film.image_file.save` puts the bytes in place.
"""

import io
from typing import TYPE_CHECKING

from raytracer.film.formats.base.image_format import ImageFormat, Layers, header_settings
from raytracer.film.formats.base.pillow import decode_display, decode_linear

if TYPE_CHECKING:
    from raytracer.film.image import Image


def encode_png(image: "Image", layers: Layers | None = None) -> bytes:
    """Encode an image as an 8-bit sRGB PNG file, with a text chunk for each of its settings; layers are left out."""
    import PIL.Image
    import PIL.PngImagePlugin

    info = PIL.PngImagePlugin.PngInfo()
    info.add(b"sRGB", b"\x00")
    for key, value in header_settings(image).items():
        info.add_text(key, value)
    buffer = io.BytesIO()
    PIL.Image.fromarray(image.display()).save(buffer, "PNG", pnginfo=info)
    return buffer.getvalue()


FORMAT = ImageFormat((".png",), encode=encode_png, decode=decode_linear, decode_display=decode_display, order=1)
