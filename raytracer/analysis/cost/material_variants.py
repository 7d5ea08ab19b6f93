"""Plain materials in place of others, for the variants that `arms.py` makes of a scene."""

from typing import Any

import numpy as np

from raytracer.geometry import Site
from raytracer.glass import Glass, constant
from raytracer.materials.interface import MaterialSpec, SelectorSpec, reflectance, row
from raytracer.materials.lambertian import Lambertian
from raytracer.optics import REC709_LUMINANCE
from raytracer.spec import Triple
from raytracer.textures.interface import Book, Texturable, TextureSpec, textures_of

_ANYWHERE = Site((0.0, 0.0, 0.0), 0.0, 0.0, 0.0)


def _mean(book: Book, field: Texturable, value: str | TextureSpec) -> Any:
    """The plain value of a field that comes nearest to a texture: its mean, or nothing where it is a relief."""
    if field.plain is None:
        return None
    mean = np.clip(book.mean(value, data=field.data), field.bounds.low, field.bounds.high)
    return tuple(mean.tolist()) if isinstance(field.plain, Triple) else float(mean @ np.array(REC709_LUMINANCE))


def _plain(material: MaterialSpec, book: Book, kind: str | None = None) -> MaterialSpec:
    """A material with means in place of its textures, or of those of a kind."""
    means = {
        use.key: _mean(book, use.field, use.value)
        for use in textures_of(material)
        if kind in (None, book.texture(use.value, data=use.field.data).type)
    }
    return material.with_means(means) if means else material


class _Changed:
    """A change of materials, those in others first; each is made once."""

    def __init__(self) -> None:
        self._made: dict[MaterialSpec, MaterialSpec] = {}

    def __call__(self, material: MaterialSpec, book: Book) -> MaterialSpec:
        if material not in self._made:
            self._made[material] = self._of(material, book)
        return self._made[material]

    def _of(self, material: MaterialSpec, book: Book) -> MaterialSpec:
        changed = self.change(material, book)
        if changed is not material:
            return self(changed, book)
        if not isinstance(material, SelectorSpec):
            return material
        return material.with_children([self(child, book) for child in material.children().values()])

    def change(self, material: MaterialSpec, book: Book) -> MaterialSpec:
        """What takes the place of one material, whatever is in it."""
        raise NotImplementedError


class Means(_Changed):
    """Means in place of the textures of a kind."""

    def __init__(self, kind: str) -> None:
        super().__init__()
        self._kind = kind

    def change(self, material: MaterialSpec, book: Book) -> MaterialSpec:
        return _plain(material, book, self._kind)


class Plain(_Changed):
    """Something plain in place of the materials of a kind: what a selector mostly shows, else a matte surface."""

    def __init__(self, kind: str) -> None:
        super().__init__()
        self._kind = kind

    def change(self, material: MaterialSpec, book: Book) -> MaterialSpec:
        if material.type != self._kind:
            return material
        if isinstance(material, SelectorSpec):
            return material.nearest_child(book) or material
        even = _plain(material, book)
        albedo = reflectance(row(type(even).pack([even], Book()), 0, None, _ANYWHERE))
        # The relief is an effect of its own.
        relief = {key: getattr(material, key) for key in MaterialSpec.model_fields if key != "type"}
        matte = {"albedo": tuple(np.clip(albedo, 0.0, 1.0).tolist())}
        return Lambertian().model_copy(update=relief | matte)


class OneIndex(_Changed):
    """Glass that bends all colours as it bends the d line, in place of what disperses."""

    def change(self, material: MaterialSpec, book: Book) -> MaterialSpec:
        fixed = {
            key: constant(float(value.ior()))
            for key, value in material.__dict__.items()
            if isinstance(value, Glass) and value.disperses()
        }
        return material.model_copy(update=fixed) if fixed else material
