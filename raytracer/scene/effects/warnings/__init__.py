"""Warn of effects that are not what they may be taken for: clauses behind their reasons."""

from typing import NamedTuple

from raytracer.kernel.packed_scene import Scene
from raytracer.scene.effects.effect import Effect
from raytracer.scene.spec import SceneSpec
from raytracer.schema.warning_kind import WarningFamily, WarningKind


class EffectsInUse(NamedTuple):
    """Effects of a scene, by name."""

    spec: SceneSpec
    scene: Scene
    effects: dict[str, Effect]


class EffectWarningKind(WarningKind[EffectsInUse]):
    """Base of the kinds of warnings about effects; the key of a warning is the effect's name."""

    section = "Effects"


EFFECT_WARNINGS = WarningFamily[EffectsInUse](__name__)
