"""JPEG files (.jpg, .jpeg): 8 bits a channel, sRGB, by the tone curve; quality 95, colour not subsampled."""

import io
from typing import TYPE_CHECKING

from raytracer.film.formats.base.image_format import ImageFormat, Layers
from raytracer.film.formats.base.pillow import decode_display, decode_linear

if TYPE_CHECKING:
    from raytracer.film.image import Image

_QUALITY = 95


def encode_jpeg(image: "Image", layers: Layers) -> bytes:
    """Encode an image as an 8-bit sRGB JPEG file; layers and settings are left out."""
    import PIL.Image

    buffer = io.BytesIO()
    PIL.Image.fromarray(image.display()).save(buffer, "JPEG", quality=_QUALITY, subsampling="4:4:4")
    return buffer.getvalue()


FORMAT = ImageFormat(
    (".jpg", ".jpeg"), encode=encode_jpeg, decode=decode_linear, decode_display=decode_display, order=2
)
