"""Film: what the samples are gathered in, and the images that are developed from it."""

from raytracer.film.film import Film, develop
from raytracer.film.image import Image
from raytracer.film.output import check_writable, load, load_layers, save

__all__ = ["Film", "Image", "check_writable", "develop", "load", "load_layers", "save"]
