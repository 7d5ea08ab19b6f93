"""The Python API of scene files: `rt.camera.thin_lens(...)` is `{type: thin_lens, ...}`.

A mapping with a type is a function of its family, in lower case: `rt.material.metal(albedo=0.9)`.  One without a
type is a capitalised function: `rt.Film(width=640, height=360)`.  Arguments are the keys of a scene file; they
take its values, and arrays.  Both are made of the schema of scene files, as is the stub beside this file
(`make docs`), by which editors and type checkers know them.
"""

import functools
from typing import Any

from raytracer.scene.python_builders import KindFactories, mapping_classes, part_factory
from raytracer.scene.spec import SceneSpec
from raytracer.schema import registry
from raytracer.schema.spec import Spec

FAMILIES: dict[str, registry.Family] = {
    "aperture": registry.APERTURES,
    "camera": registry.CAMERAS,
    "environment": registry.ENVIRONMENTS,
    "filter": registry.FILTERS,
    "light": registry.LIGHTS,
    "material": registry.MATERIALS,
    "medium": registry.MEDIA,
    "object": registry.SHAPES,
    "texture": registry.TEXTURES,
}
"""The families of kinds by their names in the API."""

_KINDS = {word: KindFactories(word, family) for word, family in FAMILIES.items()}


@functools.cache
def parts() -> dict[str, type[Spec]]:
    """List the mappings without a type by their names in the API; it takes the models of all kinds, which hold them."""
    return mapping_classes(SceneSpec, *(spec for family in FAMILIES.values() for spec in family.specs().values()))


def __dir__() -> list[str]:
    return [*_KINDS, *parts()]


@functools.cache
def __getattr__(name: str) -> Any:
    if name in _KINDS:
        return _KINDS[name]
    if name[:1].isupper() and name in parts():
        return part_factory(parts()[name], f"rt.{name}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
