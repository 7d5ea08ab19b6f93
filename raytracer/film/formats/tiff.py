"""TIFF files (.tif, .tiff), which are read: 8 or 16 bits, by custom sRGB, or float32, which is linear."""

from raytracer.film.formats.base import pillow
from raytracer.film.formats.base.image_format import ImageFormat

FORMAT = ImageFormat(
    (".tif", ".tiff"),
    is_linear=False,
    decode=pillow.decode_linear,
    decode_display=pillow.decode_display,
    decode_stored=pillow.decode_stored,
    order=50,
)
