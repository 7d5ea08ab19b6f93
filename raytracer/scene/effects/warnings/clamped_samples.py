"""Warn of samples that are made darker."""

from raytracer.scene.effects.warnings import EffectsInUse, EffectWarningKind
from raytracer.schema.warning_kind import Sentence, Warned


class ClampedSamples(EffectWarningKind):
    """Pictures that are too dark where they are brightest."""

    name = "clamped samples"
    rank = 10
    clamped = Sentence(
        ", which takes light away",
        when="`clamp`: `render.clamp` is given",
        remedy="leave it out where the light must be right",
    )

    def find(self, subject: EffectsInUse) -> Warned:
        if subject.spec.render.clamp is not None:
            yield self.record(self.clamped.fill(), "clamp")
