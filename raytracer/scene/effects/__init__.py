"""Effects that a scene calls for, and why: read off the packed scene, so that they are those that are compiled."""

from itertools import chain

from raytracer.kernel.packed_scene import Scene
from raytracer.scene.effects.camera import camera_effects
from raytracer.scene.effects.effect import Effect
from raytracer.scene.effects.light import light_kinds, light_sampling_effects
from raytracer.scene.effects.objects import object_kinds, placement_effects, surface_effects
from raytracer.scene.effects.warnings import EFFECT_WARNINGS, EffectsInUse
from raytracer.scene.pack.materials import collect_components, object_material
from raytracer.scene.spec import SceneSpec

__all__ = ["Effect", "effects_of"]


def effects_of(spec: SceneSpec, scene: Scene) -> dict[str, Effect]:
    """List every effect that the program knows, by name; those of the packed scene are active."""
    of_objects = [object_material(spec, item) for _, item in spec.all_objects()]
    by_object = [tuple(collect_components([material])) for material in of_objects]
    made_of = list(dict.fromkeys(chain.from_iterable(by_object)))
    effects = {
        **camera_effects(spec, scene, made_of),
        **light_sampling_effects(spec, scene, sum(material.is_emissive() for material in of_objects)),
        **placement_effects(spec, scene),
        **_path_limits(spec, scene),
        **surface_effects(of_objects, made_of, scene),
        **object_kinds(spec, scene, by_object, made_of),
        **light_kinds(spec, scene),
    }
    for warning in EFFECT_WARNINGS.find(EffectsInUse(spec, scene, effects)):
        name = str(warning.keys[0])
        effects[name] = effects[name]._replace(why=effects[name].why + warning.text)
    return effects


def _path_limits(spec: SceneSpec, scene: Scene) -> dict[str, Effect]:
    """List the effects that end paths, or take light from them."""
    return {
        "roulette": Effect(
            scene.roulette < scene.depth,
            f"Russian roulette may end paths after {scene.roulette} of at most {scene.depth} segments"
            if scene.roulette < scene.depth
            else f"rr_depth {scene.roulette} is not below max_depth {scene.depth}",
        ),
        "clamp": Effect(
            scene.clamp is not None,
            "samples are as bright as they are"
            if spec.render.clamp is None
            else f"samples brighter than {spec.render.clamp:g} are made as dark as that",
        ),
    }
