"""Effects that a scene simulates and leaves out, and settings that trade accuracy for time, each with its reason."""

from collections.abc import Mapping

from raytracer.analysis.cost.results import PlanItem
from raytracer.analysis.cost.variants import reasons_without_variant
from raytracer.scene.effects import effects_of
from raytracer.scene.pack.scene import PackedScene
from raytracer.scene.render_settings import Render
from raytracer.scene.spec import SceneSpec

_TRADES: Mapping[str, str] = {
    "spp": "{} samples per pixel: time grows with them, and noise falls by their root or faster",
    "max_depth": "at most {} path segments: fewer are faster, and lose the light of longer paths",
    "sampler": "{}: how evenly samples are spread, which decides how fast noise falls, and takes time",
    "accuracy": "{}: how exactly hits are found; what is faster may leak light at edges",
    "light_sampling": "{}: lights are sampled (lights), met by paths (paths) or both (mis); sampling takes shadow "
    "rays, and saves noise",
    "seed": "{}: another seed gives other noise, at the same cost",
    "rr_depth": "Russian roulette after {} segments: sooner is faster, and noisier",
}
"""Descriptions of what a setting trades, by its key in the scene."""


def plan(spec: SceneSpec, packed: PackedScene) -> tuple[PlanItem, ...]:
    """List the effects of a scene, simulated ones first, and its settings; `packed` is what `pack(spec)` gave.

    A simulated effect that has no variant without it says why.
    """
    effects, reasons = effects_of(packed.spec, packed.scene), reasons_without_variant(packed.spec, packed)
    items = [
        PlanItem("simulated", name, effect.why + (f"; no variant: {reasons[name]}" if name in reasons else ""))
        for name, effect in effects.items()
        if effect.active
    ]
    items += [PlanItem("left out", name, effect.why) for name, effect in effects.items() if not effect.active]
    return (*items, *_settings(spec))


def _settings(spec: SceneSpec) -> list[PlanItem]:
    """Describe each setting and what it trades; one without an entry in `_TRADES` by its own description."""
    items = []
    for key, field in Render.model_fields.items():
        value = getattr(spec.render, key)
        trade = _TRADES[key].format(value) if key in _TRADES else f"{value}: {field.description}"
        items.append(PlanItem("setting", key, trade))
    film = spec.film
    width, height = spec.picture()
    size = f"{width} x {height} pixels: time grows with their number, noise by pixel does not depend on it"
    of_filter = f"{film.filter.type}: a wider filter blurs, and what it weighs unevenly is noisier"
    return [*items, PlanItem("setting", "film", size), PlanItem("setting", "filter", of_filter)]
