"""Variants of a scene, each without one effect or with one setting changed, which `rt cost` compares.

The effects of a scene follow from its packed form, where an absent effect is None, and from the families of kinds: a
new kind of material, texture, light, medium or camera has its variant without a line here.  A variant keeps the
picture's brightness where an effect is not about brightness: a lens without its opening lets in as much light as
before.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Literal, get_args, get_origin

from raytracer.analysis.cost.effect_variants import EffectVariants
from raytracer.analysis.cost.variant import Variant
from raytracer.core.sampling import SAMPLERS
from raytracer.kernel.packed_scene import Scene
from raytracer.plugins.lights.base.interface import Lights
from raytracer.scene.pack.lights import lights_of
from raytracer.scene.pack.scene import PackedScene
from raytracer.scene.render_settings import Render
from raytracer.scene.spec import SceneSpec
from raytracer.util.errors import InputError, suggest_name

REPEAT = "A/A"
"""Name of the repeat of the same, the variant that differs in nothing."""

_DEPTHS = (2, 4, 8, 16)


def make_variants(spec: SceneSpec, packed: PackedScene) -> list[Variant]:
    """Make all variants of a scene, the control first; the scene itself is not among them.

    Parameters
    ----------
    packed : the packed scene; its own spec, whose camera is focused, may stand for `spec`.
    """
    what = "the scene itself once more: what differs is the noise of measuring"
    control = Variant(REPEAT, "control", what, same_mean=True)
    return [control, *EffectVariants(spec, packed).variants, *_setting_variants(spec, packed.scene)]


def reasons_without_variant(spec: SceneSpec, packed: PackedScene) -> dict[str, str]:
    """Say why an active effect has no variant without it, by its name: one clause each."""
    return dict(EffectVariants(spec, packed).reasons_without_variant)


def select_variants(
    variants: Sequence[Variant], names: Sequence[str], reasons: Mapping[str, str] | None = None
) -> list[Variant]:
    """Select variants by name, in their order, and the control.

    Parameters
    ----------
    reasons : see `reasons_without_variant`.

    Raises
    ------
    InputError : a name that no variant has.
    """
    known = [variant.name for variant in variants]
    for name in names:
        if reasons and name in reasons:
            raise InputError(f"there is no variant without {name}: {reasons[name]}")
        if name not in known:
            raise InputError(f"unknown variant {name!r}; {suggest_name(name, known, 'variants')}")
    return [variant for variant in variants if variant.name in names or variant.group == "control"]


# ---- Settings


def _setting_variants(spec: SceneSpec, scene: Scene) -> Iterator[Variant]:
    """Make variants by a setting; those that are values of the packed scene compile nothing anew."""
    for key, field in Render.model_fields.items():
        if get_origin(field.annotation) is Literal:
            now = getattr(spec.render, key)
            for value in get_args(field.annotation):
                if value != now and _applies(spec, scene, key, value):
                    yield _choice(spec, key, value, now)
    depth, roulette = scene.depth, scene.roulette
    if roulette < depth:
        what = "no Russian roulette: each path goes on until it leaves, is absorbed or has max_depth segments"
        yield _number("roulette=off", what, depth=depth, roulette=depth, same_mean=True)
    elif depth > 1:
        first = min(Render().rr_depth, depth - 1)
        what = f"Russian roulette after {first} segments"
        yield _number("roulette=on", what, depth=depth, roulette=first, same_mean=True)
    for limit in _DEPTHS:
        if limit < depth:
            what = f"paths have at most {limit} segments in place of {depth}"
            yield _number(f"max_depth={limit}", what, depth=limit, roulette=roulette, same_mean=False)


def _with_render(**values: Any) -> Callable[[SceneSpec], SceneSpec]:
    return lambda spec: spec.model_copy(update={"render": spec.render.model_copy(update=values)})


def _applies(spec: SceneSpec, scene: Scene, key: str, value: str) -> bool:
    """Tell if another choice of a setting makes a difference in this scene, and can be made."""
    if key != "light_sampling":
        return True
    if spec.render.light_sampling != "paths" and not isinstance(scene.lights, Lights):
        return False
    return value != "paths" or all(light.is_visible_to_paths() for light in lights_of(spec))


def _choice(spec: SceneSpec, key: str, value: str, now: str) -> Variant:
    name, what, change = f"{key}={value}", f"{key} is {value} in place of {now}", _with_render(**{key: value})
    if key != "sampler":
        return Variant(name, "setting", what, change, needs_repacking=True, same_mean=key == "light_sampling")
    sampler = SAMPLERS[value](spec.render.seed, spec.render.spp)
    return Variant(name, "sampler", what, change, lambda scene: scene._replace(sampler=sampler), same_mean=True)


def _number(name: str, what: str, *, depth: int, roulette: int, same_mean: bool) -> Variant:
    change = _with_render(max_depth=depth, rr_depth=roulette)
    return Variant(
        name,
        "setting",
        what,
        change,
        lambda scene: scene._replace(depth=depth, roulette=roulette),
        same_mean=same_mean,
    )
