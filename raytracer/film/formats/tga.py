"""Truevision files (.tga), which textures are read from: 8 bits a channel, by custom sRGB."""

from raytracer.film.formats.base.image_format import ImageFormat
from raytracer.film.formats.base.pillow import decode_stored

FORMAT = ImageFormat((".tga",), is_linear=False, decode_stored=decode_stored, order=40)
