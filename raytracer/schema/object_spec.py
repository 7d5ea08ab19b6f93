"""The base class of all shapes' specs: the keys that every object may have."""

from collections.abc import Mapping
from typing import Any

from pydantic import Field, ValidationInfo, field_validator

from raytracer.schema.fields import Name, check_name
from raytracer.schema.spec import Spec
from raytracer.schema.transform import Transform

INLINE_MATERIAL = "material"
"""Key of the validation context under which the scene hands its check of inline materials to the objects."""


def name_or_material(value: Any, info: ValidationInfo) -> Any:
    """Validate a field that holds a material: its name, or a mapping that is checked as one.

    Raises
    ------
    ValueError: neither.
    """
    if isinstance(value, Spec | Mapping):
        check = (info.context or {}).get(INLINE_MATERIAL)
        return check(value) if check else value
    return check_name(value)


class ObjectSpec(Spec):
    """Base of the shapes: the keys that every object may have."""

    name: Name | None = Field(
        default=None, description="Name by which messages, `focus_on` and `-D objects.NAME.key=...` find the object"
    )
    material: Any = Field(
        default=None, description="Name of a material under `materials`, or a material itself: {type: ...}"
    )
    medium: Name | None = Field(
        default=None,
        description="Name of the medium under `media` that fills the object; without a material it has no surface",
    )
    outside_medium: Name | None = Field(
        default=None, description="Name of the medium round the object; the scene's `medium` by default"
    )
    transform: Transform | None = Field(
        default=None,
        description="Steps in order, [{scale: 2}, {rotate: {axis: [0, 1, 0], angle: 30}}, {translate: [0, 1, 0]}], "
        "or a 4x4 matrix",
    )

    @field_validator("material", mode="before")
    @classmethod
    def _name_or_material(cls, value: Any, info: ValidationInfo) -> Any:
        return None if value is None else name_or_material(value, info)
