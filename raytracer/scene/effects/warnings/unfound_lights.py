"""Warn of lights that paths do not find."""

from raytracer.plugins.lights.base.interface import Lights, LightSamplingOnly
from raytracer.scene.effects.warnings import EffectsInUse, EffectWarningKind
from raytracer.schema.warning_kind import Sentence, Warned


class UnfoundLights(EffectWarningKind):
    """Lights whose reflections in mirrors are missing."""

    name = "lights that paths do not find"
    rank = 20
    unfound = Sentence(
        "; paths that hit them by chance do not count",
        when="`light_sampling`: `render.light_sampling` is `lights`",
        remedy="`mis`, which counts both",
    )

    def find(self, subject: EffectsInUse) -> Warned:
        lights = subject.scene.lights
        if isinstance(lights, Lights) and isinstance(lights.heuristic, LightSamplingOnly):
            yield self.record(self.unfound.fill(), "light_sampling")
