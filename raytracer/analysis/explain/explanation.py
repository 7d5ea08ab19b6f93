"""All that there is to say of a scene, as numbers and as text."""

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from raytracer.dump import plain_value
from raytracer.explanation.cautions import cautions
from raytracer.explanation.keys import Key, keys_of
from raytracer.explanation.numbers import Circle, View, depth_of_field, exposure, of_views
from raytracer.explanation.text import (
    camera_text,
    effects_text,
    keys_text,
    objects_text,
    thin_lens_text,
    trade_off_text,
    warnings_text,
)
from raytracer.scene.concerns import concerns, told
from raytracer.scene.effects import Effect, effects_of
from raytracer.scene.load import load
from raytracer.scene.objects import Assets
from raytracer.scene.pack import pack
from raytracer.scene.spec import SceneSpec
from raytracer.scene.whereabouts import Whereabouts, label


@dataclass(frozen=True, repr=False)
class Explanation:
    """What is simulated and what not; and numbers, by names that end in their units, infinite ones included.

    Printed, and in a notebook, it is the text that a person reads.

    kind, of the camera; camera, its numbers; objects, those of each object that has a name or moves; warnings, one
    sentence for each thing that the scene makes one doubt (docs/warnings.md), and for each in which the picture will
    differ from what the camera would take, or may not be as meant; thin_lens, keys of the ideal camera in place of one
    with a lens of glass, None for any other; trade_off, what others in place of a light-field camera's microlenses
    would give, its own among them; keys, every key of the scene at any depth, where that was asked for.
    """

    effects: dict[str, Effect]
    kind: str
    camera: dict[str, float]
    objects: dict[str, dict[str, float]]
    warnings: list[str]
    thin_lens: dict[str, Any] | None = None
    trade_off: list[dict[str, float]] = field(default_factory=list)
    keys: list[Key] = field(default_factory=list)

    def json(self) -> dict[str, Any]:
        """For `--json`; infinity, which JSON lacks, becomes the text "inf"."""
        return {
            "effects": {name: effect._asdict() for name, effect in self.effects.items()},
            "camera": _finite(self.camera),
            "objects": {name: _finite(numbers) for name, numbers in self.objects.items()},
            "warnings": self.warnings,
            **({} if self.thin_lens is None else {"thin_lens": _finite(self.thin_lens)}),
            **({"trade_off": [_finite(row) for row in self.trade_off]} if self.trade_off else {}),
            **({"keys": [_finite(key._asdict()) for key in self.keys]} if self.keys else {}),
        }

    def __repr__(self) -> str:
        return self.text().rstrip()

    def text(self) -> str:
        """As a person reads it."""
        parts = [
            effects_text(self.effects),
            camera_text(self.kind, self.camera),
            trade_off_text(self.trade_off, self.camera),
            thin_lens_text(self.thin_lens),
            objects_text(self.objects),
            warnings_text(self.warnings),
            keys_text(self.keys),
        ]
        return "\n".join(part for part in parts if part)


def _finite(numbers: Mapping[str, Any]) -> dict[str, Any]:
    return {name: "inf" if value == math.inf else value for name, value in numbers.items()}


def _thin_lens(spec: SceneSpec) -> dict[str, Any] | None:
    """The thin lens in place of a lens of glass, as a scene file would have it."""
    keys = spec.camera.equivalent(spec.film.width, spec.film.height)
    return None if keys is None else {key: plain_value(value) for key, value in keys.items()}


def explain(
    scene: SceneSpec | str | os.PathLike[str], *, circle: Circle | None = None, every_key: bool = False
) -> Explanation:
    """Explain a checked scene, or a scene file.

    Parameters
    ----------
    circle : the blur at which the depth of field ends; 1/1500 of the diagonal of the sensor, or without one of the
        picture, if None.
    every_key : whether to list all keys of the scene, with their values and meanings.

    Raises
    ------
    SceneError : the scene cannot be packed.
    InputError : a circle in mm for a camera whose film has no size.
    """
    spec = load(scene) if isinstance(scene, str | os.PathLike) else scene
    keys = keys_of(spec) if every_key else []
    assets = Assets(spec)
    packed = pack(spec, assets=assets)
    spec = packed.spec
    view = View(spec, packed.scene.camera, packed.shift)
    where = Whereabouts(spec, assets)
    numbers = view.numbers | depth_of_field(view, circle) | of_views(spec) | exposure(spec)
    objects = {label(spec, number): view.object(where, number) for number in _explained(spec, where)}
    warnings = [*told(concerns(packed)), *cautions(view, numbers)]
    effects = effects_of(spec, packed.scene)
    trade_off = spec.camera.trade_off(spec.film.width, spec.film.height)
    return Explanation(effects, spec.camera.type, numbers, objects, warnings, _thin_lens(spec), trade_off, keys)


def _explained(spec: SceneSpec, where: Whereabouts) -> list[int]:
    """The objects that have a name, or move."""
    return [number for number, item in enumerate(spec.objects) if item.name is not None or where.moves(number)]
