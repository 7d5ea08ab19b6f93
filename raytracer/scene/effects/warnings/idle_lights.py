"""Warn of lights that make no difference."""

from raytracer.scene.effects.warnings import EffectsInUse, EffectWarningKind
from raytracer.scene.pack.lights import lights_of
from raytracer.schema.warning_kind import Sentence, Warned


class IdleLights(EffectWarningKind):
    """Lights that were left out when the scene was packed."""

    name = "lights that make no difference"
    rank = 30
    idle = Sentence(
        ", which is black, or which no material here can be lit by",
        when="`light.TYPE`: the scene has lights of this type, but none has any effect",
        remedy="give them light, or give something a material that is neither a mirror nor glass",
    )

    def find(self, subject: EffectsInUse) -> Warned:
        for kind in dict.fromkeys(light.type for light in lights_of(subject.spec)):
            if not subject.effects[f"light.{kind}"].active:
                yield self.record(self.idle.fill(), f"light.{kind}")
