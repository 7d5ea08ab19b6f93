"""What fills the space of a scene: its media, and which of them lies on each side of an object."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from pydantic import ValidationError

from raytracer.errors import InputError
from raytracer.materials.interface import MaterialSpec
from raytracer.media.interface import KEEP, NONE, Media
from raytracer.scene.objects import Assets
from raytracer.scene.spec import SceneSpec
from raytracer.shapes.interface import ShapeSpec
from raytracer.spec import sentence


class Space(NamedTuple):
    """References of the media inside and outside of an object, or NONE; or KEEP twice for one that changes nothing."""

    inside: int
    outside: int


KEEPING = Space(KEEP, KEEP)


class Spaces:
    """The media that a scene uses, packed, and what each object makes of them.

    Raises
    ------
    SceneError : the file of a medium cannot be read, or does not suit it.
    """

    def __init__(self, spec: SceneSpec, files: Assets) -> None:
        self._spec, self._files = spec, files
        objects = [name for _, item in spec.all_objects() for name in (item.medium, item.outside_medium)]
        used = sorted({name for name in (spec.medium, spec.camera.medium, *objects) if name is not None})
        assets = {name: self._load(name) for name in used}
        for name in used:
            self._check(name, assets[name])
        there = [name for name in used if not spec.media[name].is_clear(assets[name])]
        kinds = sorted({spec.media[name].type for name in there})
        self._tables: list[Any] = []
        self._references: dict[str, int] = {}
        for number, kind in enumerate(kinds):
            names = [name for name in there if spec.media[name].type == kind]
            specs = [spec.media[name] for name in names]
            self._tables.append(type(specs[0]).pack(specs, [assets[name] for name in names]))
            self._references.update({name: row * len(kinds) + number for row, name in enumerate(names)})

    def _load(self, name: str) -> Mapping[str, Any]:
        medium = self._spec.media[name]
        for key, kind in medium.loads.items():
            try:
                return {key: self._files.read(kind, getattr(medium, key))}
            except InputError as error:
                raise self._spec.error(str(error), "media", name, key) from None
        return {}

    def _check(self, name: str, assets: Mapping[str, Any]) -> None:
        try:
            self._spec.media[name].check(assets)
        except ValidationError as error:
            (found,) = error.errors(include_url=False)
            raise self._spec.error(sentence(found), "media", name, *found["loc"]) from None

    def _reference(self, name: str | None) -> int:
        """That of a medium; NONE for one that is clear, or where there is none."""
        return NONE if name is None else self._references.get(name, NONE)

    def of(self, item: ShapeSpec, material: MaterialSpec) -> Space:
        """What lies inside and outside of an object of this material.

        Without a medium of its own, what light is refracted into is clear; and other surfaces leave a ray in the
        medium that it came through.
        """
        named = item.medium is not None or item.outside_medium is not None
        if not self._tables or not (named or material.holds_medium()):
            return KEEPING
        around = self._spec.medium if item.outside_medium is None else item.outside_medium
        return Space(self._reference(item.medium), self._reference(around))

    def scatters(self) -> bool:
        """Whether any medium sends light elsewhere, so that it is worth to aim at lights from within."""
        return any(self._spec.media[name].scatters() for name in self._references)

    def pack(self, references: Sequence[int], spaces: Sequence[Space]) -> Media | None:
        """The packed media, for objects whose materials have these references; None where all of space is clear."""
        if not self._tables:
            return None
        inside = np.full(max(references) + 1, KEEP, np.int32)
        outside = inside.copy()
        for reference, space in zip(references, spaces, strict=True):
            inside[reference], outside[reference] = space
        camera = self._spec.camera.medium or self._spec.medium
        return Media(tuple(self._tables), inside, outside, self._reference(camera))
