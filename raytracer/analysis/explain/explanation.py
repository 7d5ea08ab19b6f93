"""Explanation of a scene, as numbers and as text."""

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from raytracer.analysis.explain.camera_numbers import CameraView, Circle, depth_of_field, exposure, multi_view_size
from raytracer.analysis.explain.scene_keys import SceneKey, list_keys
from raytracer.analysis.explain.text import (
    camera_text,
    effects_text,
    keys_text,
    objects_text,
    thin_lens_text,
    trade_off_text,
    warnings_text,
)
from raytracer.analysis.explain.warnings import PHOTOGRAPHIC_WARNINGS, Photograph
from raytracer.optics.to_yaml import value_to_plain
from raytracer.report import fragment
from raytracer.scene.effects import Effect, effects_of
from raytracer.scene.load import load
from raytracer.scene.object_bounds import ObjectBounds, object_name
from raytracer.scene.pack.scene import pack
from raytracer.scene.scene_assets import SceneAssets
from raytracer.scene.spec import SceneSpec
from raytracer.scene.warnings import find_warnings, warning_messages


@dataclass(frozen=True, repr=False)
class Explanation:
    """Effects and numbers of a scene; numbers have names that end in their units, and may be infinite.

    Printed it is the text for readers, and a notebook shows it with the effects as a table.

    effects : simulated and left out, each with a reason.
    kind : of the camera.
    camera : its numbers.
    objects : numbers of each object that has a name or moves.
    warnings : sentences: those of the scene (docs/warnings.md), and one for each difference from a real camera.
    thin_lens : keys of the equivalent ideal camera of a lens of glass; None for any other camera.
    trade_off : numbers of other microlenses in place of a light-field camera's, its own among them.
    keys : every key of the scene at any depth, if that was asked for.
    """

    effects: dict[str, Effect]
    kind: str
    camera: dict[str, float]
    objects: dict[str, dict[str, float]]
    warnings: list[str]
    thin_lens: dict[str, Any] | None = None
    trade_off: list[dict[str, float]] = field(default_factory=list)
    keys: list[SceneKey] = field(default_factory=list)

    def json(self) -> dict[str, Any]:
        """Return the values for `--json`; infinity, which JSON lacks, becomes the string "inf"."""
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

    def _repr_html_(self) -> str:
        """Write the explanation for a notebook."""
        active, left_out = (
            [[name, e.why] for name, e in self.effects.items() if e.active is on] for on in (True, False)
        )
        head = ("effect", "why")
        return fragment.join(
            [
                fragment.heading("Simulated"),
                fragment.table(head, active, left=2),
                fragment.folded(f"left out: {len(left_out)} effects", fragment.table(head, left_out, left=2)),
                *map(fragment.preformatted, self._texts(with_effects=False)),
            ]
        )

    def text(self) -> str:
        """Write the explanation as text, the camera first; effects that are left out only where keys are listed."""
        return "\n".join(self._texts())

    def _texts(self, *, with_effects: bool = True) -> list[str]:
        """Write the parts of the text that there are."""
        parts = [
            camera_text(self.kind, self.camera),
            trade_off_text(self.trade_off, self.camera),
            thin_lens_text(self.thin_lens),
            objects_text(self.objects),
            effects_text(self.effects, with_left_out=bool(self.keys)) if with_effects else "",
            warnings_text(self.warnings),
            keys_text(self.keys),
        ]
        return [part for part in parts if part]


def _finite(numbers: Mapping[str, Any]) -> dict[str, Any]:
    return {name: "inf" if value == math.inf else value for name, value in numbers.items()}


def explain(
    scene: SceneSpec | str | os.PathLike[str], *, circle: Circle | None = None, every_key: bool = False
) -> Explanation:
    """Explain a checked scene, or a scene file.

    Parameters
    ----------
    circle : the blur at which the depth of field ends; 1/1500 of the diagonal of the sensor, or without one of the
        picture, if None.
    every_key : True to list all keys of the scene, with their values and meanings, and in the text the effects that
        are left out.

    Raises
    ------
    SceneError : the scene cannot be packed.
    InputError : a circle in mm for a camera whose film has no size.
    """
    spec = load(scene) if isinstance(scene, str | os.PathLike) else scene
    keys = list_keys(spec) if every_key else []
    assets = SceneAssets(spec)
    packed = pack(spec, assets=assets)
    spec = packed.spec
    view = CameraView(spec, packed.scene.camera, packed.shift)
    where = ObjectBounds(spec, assets)
    numbers = view.numbers | depth_of_field(view, circle) | multi_view_size(spec) | exposure(spec)
    explained = [number for number, item in enumerate(spec.objects) if item.name is not None or where.moves(number)]
    objects = {object_name(spec, number): view.object_numbers(where, number) for number in explained}
    photographic = PHOTOGRAPHIC_WARNINGS.find(Photograph(view, numbers))
    warnings = [*warning_messages(find_warnings(packed)), *(record.text for record in photographic)]
    effects = effects_of(spec, packed.scene)
    trade_off = spec.camera.trade_off(spec.film.width, spec.film.height)
    ideal = spec.camera.thin_lens_equivalent(spec.film.width, spec.film.height)
    thin_lens = None if ideal is None else {key: value_to_plain(value) for key, value in ideal.items()}
    return Explanation(effects, spec.camera.type, numbers, objects, warnings, thin_lens, trade_off, keys)
