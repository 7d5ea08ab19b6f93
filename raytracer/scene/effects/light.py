"""Effects of light: next-event estimation, the environment, and the kinds of lights."""

from raytracer.kernel.packed_scene import Scene
from raytracer.plugins.lights.background import Background
from raytracer.plugins.lights.base.interface import Lights
from raytracer.plugins.lights.base.light_choice import count_lights
from raytracer.plugins.lights.base.light_tree import LightTree
from raytracer.plugins.lights.emitters import Emitters
from raytracer.report.wording import count
from raytracer.scene.effects.effect import Effect, kind_effects
from raytracer.scene.pack.lights import lights_of
from raytracer.scene.spec import SceneSpec
from raytracer.schema.registry import LIGHTS


def light_sampling_effects(spec: SceneSpec, scene: Scene, emitting: int) -> dict[str, Effect]:
    """List the effects of light sampling and of the environment; `emitting`: number of objects that emit light."""
    return {
        "light_sampling": Effect(isinstance(scene.lights, Lights), _why_light_sampling(spec, scene, emitting)),
        "environment": Effect(scene.environment is not None, _why_environment(spec, scene)),
        "environment_sampling": Effect(_has_light_kind(scene, Background), _why_environment_sampling(spec, scene)),
    }


def _has_light_kind(scene: Scene, kind: type) -> bool:
    return scene.lights is not None and any(isinstance(table, kind) for table in scene.lights.tables)


def _why_light_sampling(spec: SceneSpec, scene: Scene, emitting: int) -> str:
    if isinstance(scene.lights, Lights):
        parts = []
        for table in scene.lights.tables:
            how = " by a light tree" if isinstance(getattr(table, "choice", None), LightTree) else ""
            if isinstance(table, Emitters):
                lamps = f"{count(len(table.table), 'primitive')} of {count(emitting, 'object')} that emit light"
                parts.append(lamps + how)
            elif isinstance(table, Background):
                parts.append("the environment")
            else:
                lamps = count(count_lights(table.choice), f"{type(table).__module__.rpartition('.')[2]} light")
                parts.append(lamps + how)
        return f"next-event estimation samples {', '.join(parts)}"
    if spec.render.light_sampling == "paths":
        return "light_sampling is paths, so there is no next-event estimation, and paths find light by themselves"
    if not emitting and not spec.lights:
        return "no object emits light, so paths find the environment by themselves"
    if scene.depth == 1:
        return "max_depth 1 leaves no segment for light that a surface reflects"
    return "no material can use next-event estimation: mirrors and glass find lights only by following their paths"


def _why_environment(spec: SceneSpec, scene: Scene) -> str:
    if scene.environment is not None and spec.environment is not None:
        return f"rays that meet nothing see the {spec.environment.type} environment"
    if spec.environment is not None:
        return f"the {spec.environment.type} environment is black"
    return "the scene names none, so rays that meet nothing see black"


def _why_environment_sampling(spec: SceneSpec, scene: Scene) -> str:
    if _has_light_kind(scene, Background):
        return "next-event estimation samples directions in proportion to their radiance"
    if spec.environment is None or scene.environment is None:
        return "there is no environment"
    if not spec.environment.has_importance_sampling:
        return f"paths find the {spec.environment.type} environment by themselves, it being smooth"
    if spec.render.light_sampling == "paths":
        return "light_sampling is paths, so paths find the environment by themselves"
    return "no surface could sample it: all are mirrors or glass, or max_depth is 1"


def light_kinds(spec: SceneSpec, scene: Scene) -> dict[str, Effect]:
    """List one effect a kind of light, active where a light of this kind can make a difference."""
    lights = [light.type for light in lights_of(spec)]
    modules = {kind: cls.__module__ for kind, cls in LIGHTS.specs().items()}
    tables = scene.lights.tables if scene.lights is not None else ()
    return kind_effects("light", modules, lights, "light", len(lights), tables)
