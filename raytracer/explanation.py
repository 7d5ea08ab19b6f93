"""What a scene makes the program do: its effects, each with a reason, and its camera's derived numbers."""

import math
from dataclasses import dataclass
from typing import Any

from raytracer.scene.effects import Effect, effects_of
from raytracer.scene.pack import pack
from raytracer.scene.spec import SceneSpec


@dataclass(frozen=True)
class Explanation:
    """Effects by name, and numbers of the camera by name with unit (infinite ones included)."""

    effects: dict[str, Effect]
    camera: dict[str, float]

    def json(self) -> dict[str, Any]:
        """For `--json`; infinity, which JSON lacks, becomes the text "inf"."""
        return {
            "effects": {name: effect._asdict() for name, effect in self.effects.items()},
            "camera": {name: "inf" if math.isinf(value) else value for name, value in self.camera.items()},
        }

    def text(self) -> str:
        """As a person reads it."""
        width = max(map(len, [*self.effects, *self.camera]))
        lines = [
            f"{heading}\n" + "".join(f"  {name:<{width}}  {effect.why}\n" for name, effect in group)
            for heading, group in (
                ("Simulated", [item for item in self.effects.items() if item[1].active]),
                ("Left out", [item for item in self.effects.items() if not item[1].active]),
            )
        ]
        numbers = "".join(f"  {name:<{width}}  {value:.6g}\n" for name, value in self.camera.items())
        return "".join([*lines, "Camera\n", numbers])


def explain(spec: SceneSpec) -> Explanation:
    """Explain a checked scene.

    Raises
    ------
    SceneError : the scene cannot be packed.
    """
    return Explanation(effects_of(spec, pack(spec).scene), spec.camera.describe(spec.film.width, spec.film.height))
