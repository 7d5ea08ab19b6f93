"""How a picture holds a light field."""

from typing import TYPE_CHECKING, ClassVar, Protocol

from raytracer.plenoptic.field import LightField
from raytracer.plenoptic.views import Views

if TYPE_CHECKING:
    from raytracer.film.image import Image


class Layout(Protocol):
    """Where in a whole picture what the views of a light field saw is found."""

    is_by_view: ClassVar[bool]
    """Whether each view has a part of the picture to itself."""

    @property
    def views(self) -> Views:
        """The geometry of the views."""

    def light_field(self, image: "Image") -> LightField:
        """The light field that a whole picture holds, with its layers."""
