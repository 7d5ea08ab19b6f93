"""Pack media, and find those on each side of an object."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from raytracer.plugins.materials.base.interface import MaterialSpec
from raytracer.plugins.media.base.interface import KEEP_MEDIUM, NO_MEDIUM, Media
from raytracer.plugins.shapes.base.interface import ShapeSpec
from raytracer.scene.scene_assets import SceneAssets
from raytracer.scene.spec import SceneSpec


class MediumInterface(NamedTuple):
    """References of the media inside and outside of an object: NO_MEDIUM for none, KEEP_MEDIUM for no change."""

    inside: int
    outside: int


KEEP_MEDIA = MediumInterface(KEEP_MEDIUM, KEEP_MEDIUM)


class SceneMedia:
    """The media that a scene uses, and the medium interfaces of its objects.

    Raises
    ------
    SceneError : the file of a medium cannot be read, or does not suit it.
    """

    def __init__(self, spec: SceneSpec, files: SceneAssets) -> None:
        self._spec = spec
        objects = [name for _, item in spec.all_objects() for name in (item.medium, item.outside_medium)]
        used = sorted({name for name in (spec.medium, spec.camera.medium, *objects) if name is not None})
        assets = {name: files.of(spec.media[name], ("media", name)) for name in used}
        for name in used:
            with spec.errors_at("media", name):
                spec.media[name].check(assets[name])
        there = [name for name in used if not spec.media[name].is_clear(assets[name])]
        kinds = sorted({spec.media[name].type for name in there})
        self._tables: list[Any] = []
        self._references: dict[str, int] = {}
        for number, kind in enumerate(kinds):
            names = [name for name in there if spec.media[name].type == kind]
            specs = [spec.media[name] for name in names]
            self._tables.append(type(specs[0]).pack(specs, [assets[name] for name in names]))
            self._references.update({name: row * len(kinds) + number for row, name in enumerate(names)})

    def _reference(self, name: str | None) -> int:
        """Return the reference of a medium; NO_MEDIUM for a clear one, or for none."""
        return NO_MEDIUM if name is None else self._references.get(name, NO_MEDIUM)

    def of(self, item: ShapeSpec, material: MaterialSpec) -> MediumInterface:
        """Find the media inside and outside of an object of this material.

        Without a medium of its own, a refracting object is clear inside; other surfaces leave a ray in the
        medium that it came through.
        """
        named = item.medium is not None or item.outside_medium is not None
        if not self._tables or not (named or material.has_interior()):
            return KEEP_MEDIA
        around = self._spec.medium if item.outside_medium is None else item.outside_medium
        return MediumInterface(self._reference(item.medium), self._reference(around))

    def scatters(self) -> bool:
        """Return True if any medium scatters, so that next-event estimation is useful within it."""
        return any(self._spec.media[name].scatters() for name in self._references)

    def pack(self, references: Sequence[int], interfaces: Sequence[MediumInterface]) -> Media | None:
        """Pack the media, for objects whose materials have these references; None if all of space is clear."""
        if not self._tables:
            return None
        inside = np.full(max(references) + 1, KEEP_MEDIUM, np.int32)
        outside = inside.copy()
        for reference, space in zip(references, interfaces, strict=True):
            inside[reference], outside[reference] = space
        camera = self._spec.camera.medium or self._spec.medium
        return Media(tuple(self._tables), inside, outside, self._reference(camera))
