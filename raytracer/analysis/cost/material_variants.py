"""Replacements of materials by plain ones, for the variants of `effect_variants.py`."""

from typing import Any

import numpy as np

from raytracer.core.fresnel import REC709_LUMINANCE
from raytracer.core.geometry import Site
from raytracer.optics.glass import Glass, constant_index_glass
from raytracer.plugins.materials.base.interface import MaterialSpec, SelectorSpec, reflectance, row
from raytracer.plugins.materials.lambertian import Lambertian
from raytracer.plugins.textures.base.interface import ParameterPacker, Texturable, TextureSpec, textures_of
from raytracer.schema.fields import Triple

_ANYWHERE = Site((0.0, 0.0, 0.0), 0.0, 0.0, 0.0)


def _mean(packer: ParameterPacker, field: Texturable, value: str | TextureSpec) -> Any:
    """Compute the plain value nearest to a texture: its mean, or None for a normal or bump map."""
    if field.plain is None:
        return None
    mean = np.clip(packer.mean(value, data=field.data), field.bounds.low, field.bounds.high)
    return tuple(mean.tolist()) if isinstance(field.plain, Triple) else float(mean @ np.array(REC709_LUMINANCE))


def _plain(material: MaterialSpec, packer: ParameterPacker, kind: str | None = None) -> MaterialSpec:
    """Replace textures of a material, all or those of a kind, by their means."""
    means = {
        use.key: _mean(packer, use.field, use.value)
        for use in textures_of(material)
        if kind in (None, packer.texture(use.value, data=use.field.data).type)
    }
    return material.with_mean_textures(means) if means else material


class _MaterialReplacer:
    """A replacement of materials, of a kind or of any, those in others first; each is made once."""

    def __init__(self, kind: str = "") -> None:
        self._kind = kind
        self._replaced: dict[MaterialSpec, MaterialSpec] = {}

    def __call__(self, material: MaterialSpec, packer: ParameterPacker) -> MaterialSpec:
        if material not in self._replaced:
            self._replaced[material] = self._of(material, packer)
        return self._replaced[material]

    def _of(self, material: MaterialSpec, packer: ParameterPacker) -> MaterialSpec:
        changed = self.change(material, packer)
        if changed is not material:
            return self(changed, packer)
        if not isinstance(material, SelectorSpec):
            return material
        return material.with_children([self(child, packer) for child in material.children().values()])

    def change(self, material: MaterialSpec, packer: ParameterPacker) -> MaterialSpec:
        """Return the replacement of one material, whatever is in it."""
        raise NotImplementedError


class MeanTextures(_MaterialReplacer):
    """Replacement of the textures of a kind by their means."""

    def change(self, material: MaterialSpec, packer: ParameterPacker) -> MaterialSpec:
        return _plain(material, packer, self._kind)


class PlainMaterials(_MaterialReplacer):
    """Replacement of the materials of a kind: by what a selector mostly shows, else by a matte surface."""

    def change(self, material: MaterialSpec, packer: ParameterPacker) -> MaterialSpec:
        if material.type != self._kind:
            return material
        if isinstance(material, SelectorSpec):
            return material.nearest_child(packer) or material
        even = _plain(material, packer)
        albedo = reflectance(row(type(even).pack([even], ParameterPacker()), 0, None, _ANYWHERE))
        # Normal and bump maps are an effect of their own.
        maps = {key: getattr(material, key) for key in MaterialSpec.model_fields if key != "type"}
        matte = {"albedo": tuple(np.clip(albedo, 0.0, 1.0).tolist())}
        return Lambertian().model_copy(update=maps | matte)


class ConstantIndex(_MaterialReplacer):
    """Replacement of dispersive glass by glass that refracts all colours as it refracts the d line."""

    def change(self, material: MaterialSpec, packer: ParameterPacker) -> MaterialSpec:
        fixed = {
            key: constant_index_glass(float(value.ior()))
            for key, value in material.__dict__.items()
            if isinstance(value, Glass) and value.disperses()
        }
        return material.model_copy(update=fixed) if fixed else material
