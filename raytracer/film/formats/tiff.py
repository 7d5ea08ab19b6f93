"""TIFF files (.tif, .tiff), which textures are read from: 8 or 16 bits, by custom sRGB, or float32."""

from raytracer.film.formats.base.image_format import ImageFormat
from raytracer.film.formats.base.pillow import decode_stored

FORMAT = ImageFormat((".tif", ".tiff"), is_linear=False, decode_stored=decode_stored, order=50)
