"""What a scene simulates, what it leaves out, and which settings trade accuracy for time, each with its reason."""

from collections.abc import Mapping

from raytracer.cost.arms import kept
from raytracer.cost.results import PlanItem
from raytracer.scene.effects import effects_of
from raytracer.scene.pack import Packed
from raytracer.scene.spec import Render, SceneSpec

_TRADES: Mapping[str, str] = {
    "spp": "{} samples per pixel: time grows with them, and noise falls by their root or faster",
    "max_depth": "at most {} path segments: fewer are faster, and lose the light of longer paths",
    "sampler": "{}: how evenly samples are spread, which decides how fast noise falls, and takes time",
    "accuracy": "{}: how exactly hits are found; what is faster may leak light at edges",
    "light_sampling": "{}: light is aimed at (lights), met by chance (paths) or both (mis); aiming takes shadow rays, "
    "and saves noise",
    "seed": "{}: another seed gives other noise, at the same cost",
    "rr_depth": "after {} segments paths may end by chance: sooner is faster, and noisier",
}
"""What a setting trades, by its key in the scene."""


def plan(spec: SceneSpec, packed: Packed) -> tuple[PlanItem, ...]:
    """The effects of a scene, simulated ones first, and its settings; `packed` is what `pack(spec)` gave.

    Of what is simulated and cannot be left out for a comparison the reason is told.
    """
    effects, stays = effects_of(packed.spec, packed.scene), kept(packed.spec, packed)
    items = [
        PlanItem("simulated", name, effect.why + (f"; no arm: {stays[name]}" if name in stays else ""))
        for name, effect in effects.items()
        if effect.active
    ]
    items += [PlanItem("left out", name, effect.why) for name, effect in effects.items() if not effect.active]
    return (*items, *_settings(spec))


def _settings(spec: SceneSpec) -> list[PlanItem]:
    """What each setting is and what it trades; one that nothing more is known of, by its own description."""
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
