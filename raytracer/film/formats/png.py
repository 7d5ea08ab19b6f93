"""PNG files (.png): 8 bits a channel, sRGB, by the tone curve; each setting is a text chunk.

`film.image_file.save` puts the bytes in place.  An animated one has all pixels as they are.
"""

from functools import partial
from typing import TYPE_CHECKING

from raytracer.film.formats.base import pillow
from raytracer.film.formats.base.image_format import ImageFormat, Layers, header_settings

if TYPE_CHECKING:
    from raytracer.film.image import Image


def encode_png(image: "Image", layers: Layers | None = None) -> bytes:
    """Encode an image as an 8-bit sRGB PNG file, with a text chunk for each of its settings; layers are left out."""
    import PIL.PngImagePlugin

    info = PIL.PngImagePlugin.PngInfo()
    info.add(b"sRGB", b"\x00")
    for key, value in header_settings(image).items():
        info.add_text(key, value)
    return pillow.encode_pixels(image.display(), "PNG", pnginfo=info)


FORMAT = ImageFormat(
    (".png",),
    is_linear=False,
    media_type="image/png",
    encode=encode_png,
    encode_pixels=partial(pillow.encode_pixels, name="PNG"),
    encode_frames=partial(pillow.encode_frames, name="PNG", disposal=0, blend=0),
    decode=pillow.decode_linear,
    decode_display=pillow.decode_display,
    decode_stored=pillow.decode_stored,
    order=10,
)
