"""Variants of a scene by its render settings."""

from collections.abc import Callable, Iterator
from typing import Any, Literal, get_args, get_origin

from raytracer.analysis.cost.variant import Variant
from raytracer.core.sampling import SAMPLERS
from raytracer.kernel.packed_scene import Scene
from raytracer.plugins.lights.base.interface import Lights
from raytracer.scene.pack.lights import lights_of
from raytracer.scene.render_settings import Render
from raytracer.scene.spec import SceneSpec

_DEPTHS = (2, 4, 8, 16)


def setting_variants(spec: SceneSpec, scene: Scene) -> Iterator[Variant]:
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
