"""JPEG files (.jpg, .jpeg): 8 bits a channel, sRGB, by the tone curve; quality 95, colour not subsampled."""

from functools import partial
from typing import TYPE_CHECKING

from raytracer.film.formats.base import pillow
from raytracer.film.formats.base.image_format import ImageFormat, Layers

if TYPE_CHECKING:
    from raytracer.film.image import Image

_QUALITY = 95


def encode_jpeg(image: "Image", layers: Layers) -> bytes:
    """Encode an image as an 8-bit sRGB JPEG file; layers and settings are left out."""
    return pillow.encode_pixels(image.display(), "JPEG", quality=_QUALITY, subsampling="4:4:4")


FORMAT = ImageFormat(
    (".jpg", ".jpeg"),
    is_linear=False,
    is_lossy=True,
    media_type="image/jpeg",
    encode=encode_jpeg,
    encode_pixels=partial(pillow.encode_pixels, name="JPEG", quality=_QUALITY),
    decode=pillow.decode_linear,
    decode_display=pillow.decode_display,
    decode_stored=pillow.decode_stored,
    order=20,
)
