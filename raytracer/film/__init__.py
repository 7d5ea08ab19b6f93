"""The film that gathers samples, the images that are developed from it, and the files that hold them."""

from raytracer.film.film import Film, develop
from raytracer.film.image import Image
from raytracer.film.image_file import check_writable, load, load_layers, save

__all__ = ["Film", "Image", "check_writable", "develop", "load", "load_layers", "save"]
