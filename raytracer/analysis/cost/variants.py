"""Variants of a scene, each without one effect or with one setting changed, which `rt cost` compares.

The effects of a scene follow from its packed form, where an absent effect is None, and from the families of kinds: a
new kind of material, texture, light, medium or camera has its variant without a line here.  A variant keeps the
picture's brightness where an effect is not about brightness: a lens without its opening lets in as much light as
before.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, Literal, NamedTuple, get_args, get_origin

from raytracer.analysis.cost import removals
from raytracer.core.sampling import SAMPLERS
from raytracer.kernel.normal_mapping import vertex_normal_mapping
from raytracer.kernel.packed_scene import Scene
from raytracer.plugins.lights.base.interface import Lights
from raytracer.plugins.lights.emitters import Emitters
from raytracer.plugins.materials.base.interface import SelectorSpec
from raytracer.plugins.materials.lambertian import Lambertian
from raytracer.scene.effects import Effect, effects_of
from raytracer.scene.pack.lights import lights_of
from raytracer.scene.pack.materials import collect_components, object_material
from raytracer.scene.pack.scene import PackedScene, pack
from raytracer.scene.pack.world import MaterialVariant
from raytracer.scene.render_settings import Render
from raytracer.scene.scene_assets import SceneAssets
from raytracer.scene.spec import SceneSpec
from raytracer.schema.registry import LIGHTS, MATERIALS, MEDIA
from raytracer.util.errors import InputError, suggest_name

REPEAT = "A/A"
"""Name of the repeat of the same, the variant that differs in nothing."""

_DEPTHS = (2, 4, 8, 16)


class Variant(NamedTuple):
    """A scene that differs in one thing from the one that is measured.

    name : short, as on the command line.
    group : "control", "effect", "setting" or "sampler".
    what : the change, in one sentence.
    spec_variant : changes the checked scene.
    packed_variant : changes the packed scene.
    material_variant : changes each material in use when the scene is packed; None for no change.
    needs_repacking : True if the scene must be packed again, and its ray caster built; else both can be shared, as
        `packed_variant` makes the change of `spec_variant` in the packed scene.
    same_mean : True if by construction the picture is that of the scene but for noise; what looks like a bias then is
        light that is found so rarely that no sample of it was seen.
    """

    name: str
    group: str
    what: str
    spec_variant: Callable[[SceneSpec], SceneSpec] = lambda spec: spec
    packed_variant: Callable[[Scene], Scene] = lambda scene: scene
    needs_repacking: bool = False
    material_variant: MaterialVariant | None = None
    same_mean: bool = False

    def pack(self, spec: SceneSpec, assets: SceneAssets | None = None) -> PackedScene:
        """Pack the variant of a scene, without `packed_variant`.

        assets : the scene's files if they have been read.

        Raises
        ------
        InputError : it cannot be packed.
        """
        change = self.material_variant and removals.in_all_materials(self.material_variant)
        return pack(self.spec_variant(spec), assets=assets, material_variant=change)


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


# ---- Effects


def _of_spec(name: str, what: str, without: Callable[[SceneSpec], SceneSpec]) -> Variant:
    """Make the variant without an effect that is in the checked scene."""
    return Variant(name, "effect", what, without, needs_repacking=True)


def _of_packed(name: str, what: str, without: Callable[[Scene], Scene], *, same_mean: bool = False) -> Variant:
    """Make the variant without an effect that is a part of the packed scene."""
    return Variant(name, "effect", what, packed_variant=without, same_mean=same_mean)


def _clear_at(*path: str) -> Callable[[Scene], Scene]:
    """Make a function that sets a path of fields of the scene to None."""
    return lambda scene: removals.without_path(scene, path)


_VARIANTS = {
    variant.name: variant
    for variant in (
        _of_packed(
            "defocus",
            "everything is sharp: the opening is a point, which lets in as much light",
            _clear_at("camera", "lens"),
        ),
        _of_packed(
            "aperture_shape", "the opening is a round one of the same area", _clear_at("camera", "lens", "shape")
        ),
        _of_packed("vignetting", "no rim before the lens keeps light out", _clear_at("camera", "lens", "rim")),
        _of_packed("media", "all of space is clear", _clear_at("media")),
        _of_packed(
            "relief",
            "surfaces are shaded as smooth as they are",
            lambda scene: scene._replace(normal_mapping=vertex_normal_mapping(scene.primitives)),
        ),
        _of_packed("clamp", "samples are as bright as they are", _clear_at("clamp")),
        _of_packed(
            "nested_dielectrics",
            "of what overlaps every surface is seen, each as a boundary to air",
            _clear_at("nested_dielectrics"),
        ),
        _of_packed(
            "environment_sampling",
            "no next-event estimation (MIS) of the environment: only paths find it",
            removals.without_environment_sampling,
            same_mean=True,
        ),
        _of_spec(
            "dispersion",
            "glass bends all colours alike, as it bends the yellow of the d line",
            removals.without_dispersion,
        )._replace(material_variant=removals.with_constant_index),
        _of_spec("motion_blur", "nothing moves: all is as in the middle of the exposure", removals.without_motion),
        _of_spec(
            "shutter_curve",
            "the shutter opens and closes at once, and exposes for as long",
            removals.with_instant_shutter,
        ),
        _of_spec("rolling_shutter", "all of the film is exposed when its middle was", removals.with_global_shutter),
        _of_spec("camera_shake", "the camera is held still", removals.with_still_camera),
        _of_spec(
            "environment",
            "rays that meet nothing see black",
            lambda spec: spec.model_copy(update={"environment": None}),
        ),
        _of_spec(
            "real_lens",
            "an ideal thin lens has the place of the glass: its entrance pupil, focus and scale",
            removals.with_thin_lens,
        ),
        _of_spec(
            "flare",
            "the glass of the lens reflects nothing",
            lambda spec: removals.with_camera(spec, flare=False),
        ),
    )
}

_DEVELOPED = "it is done to the finished picture, whatever its samples took"

_NEVER_LEFT_OUT = {
    "recentring": "it is done before the first ray, and takes none of their time",
    "exposure": _DEVELOPED,
    "sensor_noise": _DEVELOPED,
    "white_balance": _DEVELOPED,
    "tone_curve": _DEVELOPED,
    "projection": "another projection shows another picture",
    "light_field": "a single view is another picture",
    "instances": "without them there would be other objects",
    "smooth_shading": "the normals of its vertices are a part of a mesh's form",
    "passage": "it is a part of the materials that light goes straight through",
}
"""Reasons of effects that cannot be left out."""

# Of a lens of glass, in place of the above: the variant, or why there is none.
_GLASS: Mapping[str, Variant | str] = {
    "aperture_shape": _of_spec(
        "aperture_shape",
        "the stop is a round one of the same area",
        lambda spec: removals.with_camera(spec, aperture_shape=None),
    ),
    "defocus": "a real lens needs its opening: see real_lens",
    "vignetting": "it is what the rims of the glass do: see real_lens",
}

# Effects that are settings, which have variants of their own.
_SETTINGS = {"light_sampling", "roulette"}

_SOLE = "it is all the light that there is"


class EffectVariants:
    """Variants that each leave out one effect, and reasons for the active effects that have none."""

    def __init__(self, spec: SceneSpec, packed: PackedScene) -> None:
        self._spec, self._scene = spec, packed.scene
        effects = effects_of(packed.spec, packed.scene)
        self._table: Mapping[str, Variant | str] = {**_VARIANTS, **_NEVER_LEFT_OUT}
        if effects["real_lens"].active:
            self._table = {**self._table, **_GLASS}
        self._sources = _sources(spec, packed.scene, effects)
        self._parts = list(
            dict.fromkeys(collect_components(object_material(spec, item) for _, item in spec.all_objects()))
        )
        self.variants: list[Variant] = []
        self.reasons_without_variant: dict[str, str] = {}
        for name, effect in effects.items():
            if not effect.active or name in _SETTINGS:
                continue
            variant = self._without(name)
            if isinstance(variant, Variant):
                self.variants.append(variant)
            else:
                self.reasons_without_variant[name] = variant

    def _without(self, name: str) -> Variant | str:
        """Make the variant without an effect, or say why there is none."""
        lost = {name} | (self._lights_of_environment() if name == "environment" else set())
        if self._sources and self._sources <= lost:
            return _SOLE
        family, dot, kind = name.partition(".")
        if dot:
            make = _FAMILIES.get(family)
            return "it is what the scene is made of" if make is None else make(self, name, kind)
        # By their values: a key that is set to what it is by default makes no other picture here.
        if name == "motion_blur" and dict(removals.without_motion(self._spec)) == dict(
            removals.with_still_camera(self._spec)
        ):
            return "without camera_shake it is the same scene: see there"
        if name in self._table:
            return self._table[name]
        # An effect that the packed scene has a place for.
        if name in Scene._fields:
            return _of_packed(name, f"{name} is left out", _clear_at(name))
        return "nothing could take its place"

    def _lights_of_environment(self) -> set[str]:
        """Name the effects of lights that are only a part of the environment."""
        kinds = {light.type for light in lights_of(self._spec)} - {light.type for light in self._spec.lights}
        return {f"light.{kind}" for kind in kinds}

    def _material(self, name: str, kind: str) -> Variant | str:
        if kind == Lambertian.model_fields["type"].default:
            return "it is what other materials are replaced by"
        cls = MATERIALS.specs()[kind]
        if not issubclass(cls, SelectorSpec):
            what = f"{kind} materials are lambertian ones of their mean reflectance"
        elif all(part.children() for part in self._parts if part.type == kind):
            what = f"of a {kind} material only the one is left that comes nearest to it"
        else:
            return "it is nothing that is seen, so no other material is near to it"
        return Variant(
            name, "effect", what, needs_repacking=True, material_variant=partial(removals.without_material, kind=kind)
        )

    def _texture(self, name: str, kind: str) -> Variant:
        what = f"in place of {kind} textures there are their means"
        return Variant(
            name, "effect", what, needs_repacking=True, material_variant=partial(removals.with_mean_textures, kind=kind)
        )

    def _light(self, name: str, kind: str) -> Variant:
        module = LIGHTS.specs()[kind].__module__
        return Variant(
            name,
            "effect",
            f"no {kind} light shines",
            lambda spec: spec.model_copy(update={"lights": tuple(item for item in spec.lights if item.type != kind)}),
            # The light that is a part of the environment.
            lambda scene: removals.without_light_kind(scene, module),
            needs_repacking=any(item.type == kind for item in self._spec.lights),
        )

    def _medium(self, name: str, kind: str) -> Variant | str:
        if len(self._scene.media.tables) == 1:
            return "it is the only kind of medium: see media"
        module = MEDIA.specs()[kind].__module__
        what = f"space is clear where {kind} media were"
        return _of_packed(name, what, lambda scene: removals.without_media_kind(scene, module))


_FAMILIES: Mapping[str, Callable[[EffectVariants, str, str], Variant | str]] = {
    "material": EffectVariants._material,
    "texture": EffectVariants._texture,
    "light": EffectVariants._light,
    "medium": EffectVariants._medium,
}


def _sources(spec: SceneSpec, scene: Scene, effects: Mapping[str, Effect]) -> set[str]:
    """Name the effects that bring light into a scene."""
    sources = {"environment"} if scene.environment is not None else set()
    sources |= {name for name, effect in effects.items() if effect.active and name.startswith("light.")}
    used = collect_components(object_material(spec, item) for _, item in spec.all_objects())
    sources |= {f"material.{part.type}" for part in used if part.is_emissive() and not isinstance(part, SelectorSpec)}

    # Materials of mesh files are known by the emitters that are sampled.
    modules = {cls.__module__: kind for kind, cls in MATERIALS.specs().items()}
    kinds = len(scene.materials) + (0 if scene.selectors is None else len(scene.selectors.tables))
    for lights in scene.lights.tables if scene.lights is not None else ():
        if isinstance(lights, Emitters):
            tables = set((lights.material % kinds).tolist()) & set(range(len(scene.materials)))
            sources |= {f"material.{modules[type(scene.materials[table]).__module__]}" for table in tables}
    return sources


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
