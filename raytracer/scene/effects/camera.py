"""Which effects a scene calls for, and why: read off its packed type, so that what is said is what is compiled."""

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import chain
from typing import Any, NamedTuple

from raytracer.cameras.interface import Defocus, defocus_of
from raytracer.cameras.moving import MovingCamera
from raytracer.hues import LensSpectrum, Spectrum
from raytracer.integrator import Scene
from raytracer.kinds import LIGHTS, MATERIALS, MEDIA, SHAPES, TEXTURES, Family
from raytracer.lights.background import Background
from raytracer.lights.emitters import Emitters
from raytracer.lights.interface import AimedOnly, Lights
from raytracer.materials.interface import MaterialSpec
from raytracer.primitives.interface import has_vertex_normals
from raytracer.scene.lights import lights_of
from raytracer.scene.materials import parts
from raytracer.scene.pack import material_of
from raytracer.scene.spec import SceneSpec
from raytracer.textures.interface import textures_of


class Effect(NamedTuple):
    """Whether an effect is simulated, and the reason in words."""

    active: bool
    why: str


def effects_of(spec: SceneSpec, scene: Scene) -> dict[str, Effect]:
    """Every effect that the program knows, by name; those of a packed scene are active."""
    camera = getattr(scene.camera, "camera", scene.camera)
    lens, glass = getattr(camera, "lens", None), getattr(camera, "surfaces", None)
    thin = defocus_of(camera)
    of_objects = [material_of(spec, item) for _, item in spec.all_objects()]
    by_object = [tuple(parts([material])) for material in of_objects]
    made_of = list(dict.fromkeys(chain.from_iterable(by_object)))
    emitting = [material for material in of_objects if material.emits()]
    return {
        "defocus": Effect(
            lens is not None or glass is not None, _why_defocus(spec, None if lens is None else thin, glass)
        ),
        "real_lens": Effect(glass is not None, _why_real_lens(spec, glass)),
        "dispersion": _dispersion(made_of, scene, has_glass=glass is not None),
        "flare": Effect(getattr(camera, "flare", None) is not None, _why_flare(camera, glass)),
        **_photograph(spec),
        **_opening(spec, lens, glass),
        "projection": _projection(spec, thin is not None and glass is None, glass is not None),
        "light_field": _light_field(spec),
        "motion_blur": Effect(_moves(spec, scene), _why_motion_blur(spec, scene)),
        **_shutter(spec, scene),
        "light_sampling": Effect(isinstance(scene.lights, Lights), _why_light_sampling(spec, scene, len(emitting))),
        "environment": Effect(scene.environment is not None, _why_environment(spec, scene)),
        "environment_sampling": Effect(_aims(scene, Background), _why_environment_sampling(spec, scene)),
        "media": Effect(scene.media is not None, _why_media(spec, scene)),
        "instances": Effect(scene.instances is not None, _why_instances(scene)),
        "recentring": Effect(scene.origin is not None, _why_recentring(scene)),
        "roulette": Effect(
            scene.roulette < scene.depth,
            f"paths may end by chance after {scene.roulette} of at most {scene.depth} segments"
            if scene.roulette < scene.depth
            else f"rr_depth {scene.roulette} is not below max_depth {scene.depth}",
        ),
        "clamp": Effect(
            scene.clamp is not None,
            "samples are as bright as they are"
            if spec.render.clamp is None
            else f"samples brighter than {spec.render.clamp:g} are made as dark as that, which takes light away",
        ),
        "relief": _relief(made_of, scene),
        "smooth_shading": _smooth_shading(scene),
        "passage": Effect(scene.passage is not None, _why_passage(of_objects, scene)),
        "nested_dielectrics": Effect(scene.interior is not None, _why_nested(scene)),
        **_materials(by_object, scene),
        **_textures(spec, made_of, scene),
        **_media_kinds(spec, scene),
        **_kinds("shape", SHAPES, (item.type for item in spec.objects)),
        **_lights(spec, scene),
    }


def _projection(spec: SceneSpec, in_perspective: bool, has_glass: bool) -> Effect:
    """Whether the picture is other than in perspective."""
    if in_perspective:
        return Effect(False, f"the {spec.camera.type} camera shows the scene in perspective")
    if has_glass:
        return Effect(True, "the glass of the lens distorts the perspective")
    return Effect(True, f"the {spec.camera.type} camera shows the scene otherwise than in perspective")


def _light_field(spec: SceneSpec) -> Effect:
    """Whether the picture holds more than one view."""
    layout = spec.camera.layout(spec.film.width, spec.film.height)
    if layout is None or layout.views.position.size == 2:
        return Effect(False, f"the {spec.camera.type} camera sees from one place, or does not tell places apart")
    views = layout.views
    size = f"{views.width} x {views.height}"
    return Effect(True, f"the picture holds {views.columns} x {views.rows} views of {size} pixels")


def _why_defocus(spec: SceneSpec, lens: Defocus | None, glass: Any) -> str:
    if glass is not None:
        numbers = spec.camera.describe(spec.film.width, spec.film.height)
        distance = numbers["focus_distance_m"]
        focus = f"{distance:.4g} m" if distance < math.inf else "infinity"
        return f"the stop is open to f/{numbers['f_number']:.4g}, and the lens focused at {focus}"
    if lens is None:
        return f"the {spec.camera.type} camera has no aperture, so everything is sharp"
    width = f"{1e3 * lens.diameter:.4g} mm wide"
    if lens.inverse_focus < 0.0:
        return f"the hole is {width}, and bends no light"
    focus = f"{1.0 / lens.inverse_focus:.4g} m" if lens.inverse_focus > 0.0 else "infinity"
    return f"the lens is {width} and focused at {focus}"


def _why_real_lens(spec: SceneSpec, glass: Any) -> str:
    if glass is None:
        return f"the {spec.camera.type} camera has no glass, and so none of its aberrations"
    number = len(glass.curvature)
    return f"rays are traced through {_count(number, 'surface')} of a lens, with all its aberrations"


def _dispersion(made_of: Sequence[MaterialSpec], scene: Scene, *, has_glass: bool) -> Effect:
    """Whether anything bends light of each wavelength by another angle."""
    parting = sum(part.parting() != 0 for part in made_of)
    whose = [_count(parting, "material") + " in use"] if isinstance(scene.spectrum, Spectrum) else []
    drawn = isinstance(scene.spectrum, LensSpectrum) or getattr(scene.spectrum, "camera", None) is not None
    whose += ["the camera's lens"] if drawn and has_glass else []
    # A camera without glass draws from a single wavelength.
    single = drawn and not has_glass
    if not whose:
        light = "is of the one wavelength that the camera sees" if single else "stays red, green and blue"
        return Effect(False, f"no index of refraction depends on the wavelength, so light {light}")
    verb = "bend" if len(whose) > 1 or parting > 1 else "bends"
    light = "the camera sees one of them" if single else "wavelengths are drawn by chance"
    return Effect(True, f"{' and '.join(whose)} {verb} light of each wavelength by another angle; {light}")


def _why_flare(camera: Any, glass: Any) -> str:
    if glass is None:
        return "there is no glass in the camera that could reflect"
    if getattr(camera, "flare", None) is None:
        return "flare is not asked for, so the glass of the lens reflects nothing, and loses no light"
    return "light that two surfaces of the lens reflect reaches the film, and what one reflects is lost"


def _opening(spec: SceneSpec, lens: Any, glass: Any) -> dict[str, Effect]:
    """What the lens's opening does besides having a size."""
    shape, rim = (getattr(spec.camera, key, None) for key in ("aperture_shape", "vignetting"))
    if glass is not None:
        shaped = glass.diaphragm is not None
        return {
            "aperture_shape": Effect(
                shaped, f"the stop has the shape {shape.type}" if shape and shaped else "the stop is round"
            ),
            "vignetting": Effect(True, "the rims of the glass keep light out that comes in from the side"),
        }
    shaped, vignetted = (getattr(lens, part, None) is not None for part in ("shape", "rim"))
    none = "the camera's opening is a point, or missing"
    shapeless = none if lens is None else "the opening is round"
    rimless = none if lens is None else "nothing but the opening itself keeps light out"
    return {
        "aperture_shape": Effect(shaped, f"the opening has the shape {shape.type}" if shape and shaped else shapeless),
        "vignetting": Effect(
            vignetted, f"a rim {rim.distance:.4g} mm before the lens is in the way" if rim and vignetted else rimless
        ),
    }


def _photograph(spec: SceneSpec) -> dict[str, Effect]:
    """What happens to the light that the film has gathered."""
    exposure = spec.camera.photograph(spec.film.width, spec.film.height)
    sensor, balance, tone = spec.camera.simulated_sensor(), spec.film.white_balance, spec.film.tone_curve.type
    exposed = "neither iso nor exposure is given, so pixels are plain radiance"
    if exposure is not None:
        speed = "the ISO speed that metering chooses" if exposure.iso is None else f"ISO {exposure.iso:.4g}"
        known = exposure.radiometric and exposure.seconds is not None
        exposed = f"{speed}, the aperture and the shutter set" if known else "metering sets"
        exposed += " how bright the picture is"
    return {
        "exposure": Effect(exposure is not None, exposed),
        "sensor_noise": Effect(
            sensor is not None,
            f"photons are counted in wells of {sensor.full_well:g} electrons"
            if sensor is not None
            else "no sensor with `noise: true` is given, so the only noise is that of sampling",
        ),
        "white_balance": Effect(
            balance is not None,
            "red, green and blue are multiplied so that grey looks grey" if balance else "colours stay as they are",
        ),
        "tone_curve": Effect(
            tone != "linear",
            "display files are clipped at 1" if tone == "linear" else f"display files are shown by a {tone} curve",
        ),
    }


def _able_to_move(spec: SceneSpec) -> int:
    """How many objects have a motion."""
    return sum(bool(item.motion or getattr(item, "frames", None)) for _, item in spec.all_objects())


def _moves(spec: SceneSpec, scene: Scene) -> bool:
    """Whether something may move while the shutter is open; paths may have a time for the sake of a flash alone."""
    return scene.shutter is not None and (isinstance(scene.camera, MovingCamera) or _able_to_move(spec) > 0)


def _why_motion_blur(spec: SceneSpec, scene: Scene) -> str:
    shutter = spec.camera.opening()
    if _moves(spec, scene):
        able = _able_to_move(spec)
        moving = [_count(able, "object")] if able else []
        moving += ["the camera"] if isinstance(scene.camera, MovingCamera) else []
        return f"the shutter is open for {shutter.close - shutter.open:.4g} s, in which {' and '.join(moving)} may move"
    if shutter.close == shutter.open:
        return f"the shutter is open for no time, at {shutter.open:g} s"
    return f"nothing moves while the shutter is open, for {shutter.close - shutter.open:.4g} s"


def _shutter(spec: SceneSpec, scene: Scene) -> dict[str, Effect]:
    """What a shutter, and the hand that holds it, do besides letting light in for some time."""
    timing, shake = spec.camera.timing(), spec.camera.shake
    still = "nothing changes while the shutter is open"
    curve = "the shutter opens and closes at once" if timing.profile is None else still
    rolling = still if timing.readout else "all of the film is exposed at the same time"
    hand = "it has no time to shake" if shake is not None and shake.amplitude else "the camera is held still"
    is_curved = scene.shutter is not None and scene.shutter.curve is not None
    if is_curved:
        curve = f"its transmission changes while it is open; in all it counts as {timing.seconds():.4g} s"
    is_rolling = scene.shutter is not None and scene.shutter.scan is not None
    if is_rolling:
        rolling = f"lines are exposed one after another, {timing.direction}, over {timing.readout:.4g} s"
    is_shaking = shake is not None and shake.amplitude > 0.0 and isinstance(scene.camera, MovingCamera)
    if shake is not None and is_shaking:
        hand = f"it turns by {shake.amplitude:.4g} deg (rms) about each axis, up to {shake.bandwidth:.4g} Hz"
    return {
        "shutter_curve": Effect(is_curved, curve),
        "rolling_shutter": Effect(is_rolling, rolling),
        "camera_shake": Effect(is_shaking, hand),
    }


def _aims(scene: Scene, kind: type) -> bool:
    """Whether the scene has a table of lights of this class."""
    return scene.lights is not None and any(isinstance(table, kind) for table in scene.lights.tables)


def _why_light_sampling(spec: SceneSpec, scene: Scene, emitting: int) -> str:
    if isinstance(scene.lights, Lights):
        parts = []
        for table in scene.lights.tables:
            if isinstance(table, Emitters):
                parts.append(f"{_count(len(table.table), 'primitive')} of {_count(emitting, 'object')} that emit light")
            elif isinstance(table, Background):
                parts.append("the environment")
            else:
                parts.append(_count(len(table.choice.pmf), f"{type(table).__module__.rpartition('.')[2]} light"))
        alone = "; paths that find them by chance do not count" if isinstance(scene.lights.heuristic, AimedOnly) else ""
        return f"surfaces aim at {', '.join(parts)}{alone}"
    if spec.render.light_sampling == "paths":
        return "light_sampling is paths, so nothing is aimed at, and paths find light by themselves"
    if not emitting and not spec.lights:
        return "no object emits light, so paths find the environment by themselves"
    if scene.depth == 1:
        return "max_depth 1 leaves no segment for light that a surface reflects"
    return "no material can be lit by choice: mirrors and glass find lights only by being followed"


def _why_environment(spec: SceneSpec, scene: Scene) -> str:
    if scene.environment is not None and spec.environment is not None:
        return f"rays that meet nothing see the {spec.environment.type} environment"
    if spec.environment is not None:
        return f"the {spec.environment.type} environment is black"
    return "the scene names none, so rays that meet nothing see black"


def _why_environment_sampling(spec: SceneSpec, scene: Scene) -> str:
    if _aims(scene, Background):
        return "surfaces aim at directions in proportion to their radiance"
    if spec.environment is None or scene.environment is None:
        return "there is no environment"
    if not spec.environment.can_be_drawn:
        return f"paths find the {spec.environment.type} environment by themselves, it being smooth"
    if spec.render.light_sampling == "paths":
        return "light_sampling is paths, so paths find the environment by themselves"
    return "no surface could aim at it: none is lit by choice, or max_depth is 1"


def _media(spec: SceneSpec) -> list[str]:
    """The name of a medium for each time that the scene uses one."""
    objects = [name for _, item in spec.all_objects() for name in (item.medium, item.outside_medium)]
    return [name for name in (spec.medium, spec.camera.medium, *objects) if name is not None]


def _why_media(spec: SceneSpec, scene: Scene) -> str:
    used = _media(spec)
    if scene.media is not None:
        inside = sum(item.medium is not None for _, item in spec.all_objects())
        places = [f"{spec.medium!r} fills the scene"] if spec.medium is not None else []
        return "; ".join([*places, f"{_count(inside, 'object')} of {len(spec.all_objects())} with a medium inside"])
    if used:
        return "the media that are used take nothing from light"
    return "no medium is used, so light travels unhindered"


def _media_kinds(spec: SceneSpec, scene: Scene) -> dict[str, Effect]:
    """One effect a kind of medium: whether any in use takes something from light."""
    packed = {type(table).__module__ for table in scene.media.tables} if scene.media is not None else set()
    used = _kinds("medium", MEDIA, (spec.media[name].type for name in _media(spec)), "use")
    return {
        f"medium.{kind}": Effect(cls.__module__ in packed, used[f"medium.{kind}"].why)
        for kind, cls in MEDIA.specs().items()
    }


def _why_instances(scene: Scene) -> str:
    if scene.instances is None:
        return "no object is placed more than once, turns, or is stretched to an ellipsoid"
    instances = scene.instances
    number, moving = len(instances.group), len(instances.group) - len(instances.pose)
    moves = f", of which {moving:,} move{'s' if moving == 1 else ''}" if moving else ""
    groups = _count(len(instances.rows), "group")
    return f"{number:,} placement{'' if number == 1 else 's'} of {groups} of primitives{moves}"


def _why_recentring(scene: Scene) -> str:
    if scene.origin is None:
        return "the scene, and each group, lies near enough to its origin for float32"
    x, y, z = scene.origin.world
    away = f"the scene is packed round its point [{x:.10g}, {y:.10g}, {z:.10g}]" if any(scene.origin.world) else ""
    moved = 0 if scene.origin.groups is None else int(scene.origin.groups.any(axis=1).sum())
    inside = f"{_count(moved, 'group')} of primitives round a point of its own" if moved else ""
    return " and ".join(filter(None, (away, inside))) + ", since float32 is coarse far from the origin"


def _why_passage(of_objects: Sequence[MaterialSpec], scene: Scene) -> str:
    if scene.passage is None:
        return "no surface has holes or is a mere boundary, so what is met ends a ray"
    holes = sum(material.passes() for material in of_objects)
    if scene.interior is not None and not holes:
        return "rays, those for shadows too, go on straight through surfaces that others hide by their priority"
    where = _count(holes, "object") if holes else "the file of a mesh"
    return f"rays, those for shadows too, go on straight through {where}"


def _why_nested(scene: Scene) -> str:
    if scene.interior is None:
        return "no material in use has a priority, so each surface is a boundary to its `outside_ior`"
    number = len(scene.interior.surface)
    look = "; rays of the camera find out what they begin in" if scene.interior.camera is not None else ""
    return f"{_count(number, 'material')} in use have a priority, by which they may overlap{look}"


def _materials(by_object: Sequence[Sequence[MaterialSpec]], scene: Scene) -> dict[str, Effect]:
    """One effect a kind of material: whether any object is of it, or of a material made of it."""
    numbers = Counter(chain.from_iterable({part.type for part in made_of} for made_of in by_object))
    tables = (*scene.materials, *(scene.selectors.tables if scene.selectors is not None else ()))
    packed = {type(table).__module__ for table in tables}
    effects = {}
    for kind, cls in MATERIALS.specs().items():
        number = numbers[kind]
        active = cls.__module__ in packed
        brought = ", and in the file of a mesh" if active and not number else ""
        effects[f"material.{kind}"] = Effect(active, f"{_count(number, 'object')} of {len(by_object)}{brought}")
    return effects


def _textures(spec: SceneSpec, made_of: Sequence[MaterialSpec], scene: Scene) -> dict[str, Effect]:
    """One effect a kind of texture: whether any parameter of a material is one of its kind."""
    asked = [use.value for part in made_of for use in textures_of(part)]
    kinds = [(spec.textures[value] if isinstance(value, str) else value).type for value in asked]
    packed = {type(table).__module__ for table in scene.textures or ()}
    effects = {}
    for kind, cls in TEXTURES.specs().items():
        number = kinds.count(kind)
        active = cls.__module__ in packed
        brought = ", and in the file of a mesh" if active and not number else ""
        effects[f"texture.{kind}"] = Effect(active, f"{_count(number, 'parameter')} of materials{brought}")
    return effects


def _relief(made_of: Sequence[MaterialSpec], scene: Scene) -> Effect:
    """Tell whether materials have bump or normal maps."""
    if scene.relief is None or (scene.relief.normal_maps is None and scene.relief.bumps is None):
        return Effect(
            False, "no material in use has a bump or a normal map, so surfaces are shaded as smooth as they are"
        )
    number = sum(part.bump is not None or part.normal_map is not None for part in made_of)
    return Effect(True, f"{_count(number, 'material')} in use have a bump or a normal map")


def _smooth_shading(scene: Scene) -> Effect:
    """Tell whether meshes are shaded with the normals of their vertices."""
    if any(has_vertex_normals(table) for table in scene.primitives):
        return Effect(True, "meshes are shaded with normals that run smoothly from vertex to vertex")
    return Effect(False, "no mesh is smooth, so faces are shaded as flat as they are")


def _lights(spec: SceneSpec, scene: Scene) -> dict[str, Effect]:
    """One effect a kind of light: whether a light of this kind can make a difference."""
    lights = lights_of(spec)
    present = {type(table).__module__ for table in scene.lights.tables} if scene.lights is not None else set()
    effects = {}
    for kind, cls in LIGHTS.specs().items():
        number = sum(light.type == kind for light in lights)
        active = cls.__module__ in present
        idle = ", which is black, or which no material here can be lit by" if number and not active else ""
        effects[f"light.{kind}"] = Effect(active, f"{_count(number, 'light')} of {len(lights)}{idle}")
    return effects


def _kinds(noun: str, family: Family, present: Iterable[str], user: str = "object") -> dict[str, Effect]:
    """One effect a kind of the family: whether any object, or other user, has it."""
    names = list(present)
    return {
        f"{noun}.{kind}": Effect(kind in names, f"{_count(names.count(kind), user)} of {len(names)}")
        for kind in family.specs()
    }


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
