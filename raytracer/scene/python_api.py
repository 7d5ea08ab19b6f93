"""The Python API of scene files: `rt.camera.thin_lens(...)` is `{type: thin_lens, ...}`.

A mapping with a type is a function of its family, in lower case: `rt.material.metal(albedo=0.9)`.  One without a
type is a capitalised function: `rt.Film(width=640, height=360)`.  Arguments are the keys of a scene file; they
take its values, and arrays.  Both are made of the schema of scene files, as is the stub beside this file
(`make docs`), by which editors and type checkers know them.
"""

from typing import Any

from raytracer.scene.python_builders import KindFactories, mapping_classes, part_factory
from raytracer.scene.spec import SceneSpec
from raytracer.schema.registry import (
    APERTURES,
    CAMERAS,
    ENVIRONMENTS,
    FILTERS,
    LIGHTS,
    MATERIALS,
    MEDIA,
    SHAPES,
    TEXTURES,
    Family,
)

FAMILIES: dict[str, Family] = {
    "aperture": APERTURES,
    "camera": CAMERAS,
    "environment": ENVIRONMENTS,
    "filter": FILTERS,
    "light": LIGHTS,
    "material": MATERIALS,
    "medium": MEDIA,
    "object": SHAPES,
    "texture": TEXTURES,
}
"""The families of kinds by their names in the API."""

PARTS = mapping_classes(SceneSpec)
"""The mappings without a type by their names in the API."""

_WORDS = {word: KindFactories(word, family) for word, family in FAMILIES.items()} | {
    name: part_factory(part, f"rt.{name}") for name, part in PARTS.items()
}

__all__ = list(_WORDS)


def __getattr__(name: str) -> Any:
    try:
        return _WORDS[name]
    except KeyError:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}") from None
