"""Types of the parts of a scene: any camera, any material, any shape and so on, by their key `type`."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, TypeAlias

from pydantic import TypeAdapter

from raytracer.schema.fields import INLINE_MATERIAL
from raytracer.schema.registry import CAMERAS, ENVIRONMENTS, FILTERS, LIGHTS, MATERIALS, MEDIA, SHAPES, TEXTURES
from raytracer.schema.spec import Spec

if TYPE_CHECKING:
    from raytracer.plugins.cameras.base.placement import PlacedSpec
    from raytracer.plugins.environments.base.interface import EnvironmentSpec
    from raytracer.plugins.filters.base.interface import FilterSpec
    from raytracer.plugins.lights.base.interface import LightSpec
    from raytracer.plugins.materials.base.interface import MaterialSpec
    from raytracer.plugins.media.base.interface import MediumSpec
    from raytracer.plugins.shapes.base.interface import ShapeSpec
    from raytracer.plugins.textures.base.interface import TextureSpec

    Camera: TypeAlias = PlacedSpec
    Environment: TypeAlias = EnvironmentSpec
    Filter: TypeAlias = FilterSpec
    Light: TypeAlias = LightSpec
    Material: TypeAlias = MaterialSpec
    Medium: TypeAlias = MediumSpec
    Shape: TypeAlias = ShapeSpec
    Texture: TypeAlias = TextureSpec
else:
    Camera = CAMERAS.union()
    Environment = ENVIRONMENTS.union()
    Filter = FILTERS.union_or_name()
    Light = LIGHTS.union()
    Material = MATERIALS.union()
    Medium = MEDIA.union()
    Shape = SHAPES.union()
    Texture = TEXTURES.union()


_MATERIAL: TypeAdapter[Spec] = TypeAdapter(Material)


def check_material(value: Mapping[str, Any]) -> Spec:
    """Validate a material that an object or another material holds inline, like those under `materials`.

    Raises
    ------
    ValidationError: it is no material.
    """
    return _MATERIAL.validate_python(value, context=VALIDATION_CONTEXT)


VALIDATION_CONTEXT = {INLINE_MATERIAL: check_material}
"""Context of pydantic in which a scene, or a part of it, is validated."""
