"""The words of scene files for Python: `rt.camera.thin_lens(...)` is `{type: thin_lens, ...}`.

What stands for a mapping with a type is a function of its family, in lower case: `rt.material.metal(albedo=0.9)`. What
stands for one without is capitalised: `rt.Film(width=640, height=360)`. Arguments are the keys of a scene file; they
take what it takes, and arrays. Both are made of the schema of scene files, as is the stub beside this file
(`make docs`), by which editors and type checkers know them.
"""

from typing import Any

from raytracer.kinds import (
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
from raytracer.scene.making import Kinds, maker, parts_of
from raytracer.scene.spec import SceneSpec

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
"""The families of kinds by the words for them."""

PARTS = parts_of(SceneSpec)
"""The mappings without a type by the words for them."""

_WORDS = {word: Kinds(word, family) for word, family in FAMILIES.items()} | {
    name: maker(part, f"rt.{name}") for name, part in PARTS.items()
}

__all__ = list(_WORDS)


def __getattr__(name: str) -> Any:
    try:
        return _WORDS[name]
    except KeyError:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}") from None
