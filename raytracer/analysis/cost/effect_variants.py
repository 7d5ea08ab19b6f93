"""Variants of a scene, each without one effect or with one setting changed: what `rt cost` measures side by side.

What a scene simulates is read off its packed form, where an absent effect is None, and off the families of kinds: a
new kind of material, texture, light, medium or camera has its variant without a line here.  A variant keeps the
picture's brightness where an effect is not about brightness: a lens without its opening lets in as much light as
before.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Literal, NamedTuple, get_args, get_origin

from raytracer.cost.recast import Means, OneIndex, Plain
from raytracer.cost.repack import cleared, cleared_of, unaimed, unlit
from raytracer.cost.respec import (
    dark_glass,
    exposed_at_once,
    frozen,
    held,
    ideal,
    of_one_wavelength,
    opened_at_once,
    round_stop,
)
from raytracer.errors import InputError, suggestion
from raytracer.integrator import Scene
from raytracer.kinds import LIGHTS, MATERIALS, MEDIA
from raytracer.lights.emitters import Emitters
from raytracer.lights.interface import Lights
from raytracer.materials.interface import SelectorSpec
from raytracer.materials.lambertian import Lambertian
from raytracer.relief import relief_of_vertices
from raytracer.sampling import SAMPLERS
from raytracer.scene.effects import Effect, effects_of
from raytracer.scene.lights import lights_of
from raytracer.scene.materials import parts
from raytracer.scene.objects import Assets
from raytracer.scene.pack import Packed, Recast, material_of, pack
from raytracer.scene.spec import Render, SceneSpec

_DEPTHS = (2, 4, 8, 16)

CONTROL = "A/A"
"""Name of the variant that differs in nothing."""


def unchanged(value: Any) -> Any:
    """The value itself."""
    return value


class Variant(NamedTuple):
    """A scene that differs from the one that is measured in one thing.

    name : short, as on the command line.
    group : "control", "effect", "setting" or "sampler".
    what : one sentence, what is different.
    respec, recast, repack : what becomes of the checked scene, of each material in use when it is packed, and of the
        packed scene.
    packs_anew : whether the scene must be packed again, and its ray caster built; else both can be shared, as what
        `respec` changes is in the packed scene what `repack` changes.
    same_mean : whether by construction the picture is that of the scene but for noise; what looks like a bias then is
        light that is found so rarely that no sample of it was seen.
    """

    name: str
    group: str
    what: str
    respec: Callable[[SceneSpec], SceneSpec] = unchanged
    repack: Callable[[Scene], Scene] = unchanged
    packs_anew: bool = False
    recast: Recast | None = None
    same_mean: bool = False

    def pack(self, spec: SceneSpec, assets: Assets | None = None) -> Packed:
        """The variant of a scene, packed but for `repack`; `assets`, the scene's files if they have been read.

        Raises
        ------
        InputError : it cannot be packed.
        """
        return pack(self.respec(spec), assets=assets, recast=self.recast)


def variants(spec: SceneSpec, packed: Packed) -> list[Variant]:
    """All variants of a scene, the control first; the scene itself is not among them.

    Parameters
    ----------
    packed : the packed scene; its own spec, whose camera is focused, may stand for `spec`.
    """
    what = "the scene itself once more: what differs is the noise of measuring"
    control = Variant(CONTROL, "control", what, same_mean=True)
    return [control, *_Switches(spec, packed).found, *_settings(spec, packed.scene)]


def kept(spec: SceneSpec, packed: Packed) -> dict[str, str]:
    """Why an active effect has no variant without it, by its name: a clause each."""
    return dict(_Switches(spec, packed).kept)


def select(found: Sequence[Variant], names: Sequence[str], kept: Mapping[str, str] | None = None) -> list[Variant]:
    """The variants of these names, in the order in which they were found, and the control.

    Parameters
    ----------
    kept : see the function of that name.

    Raises
    ------
    InputError : a name that no variant has.
    """
    known = [variant.name for variant in found]
    for name in names:
        if name in (kept or {}):
            raise InputError(f"there is no arm without {name}: {(kept or {})[name]}")
        if name not in known:
            raise InputError(f"unknown arm {name!r}; {suggestion(name, known, 'arms')}")
    return [variant for variant in found if variant.name in names or variant.group == "control"]


# ---- Settings


def _with_render(**values: Any) -> Callable[[SceneSpec], SceneSpec]:
    return lambda spec: spec.model_copy(update={"render": spec.render.model_copy(update=values)})


def _settings(spec: SceneSpec, scene: Scene) -> Iterator[Variant]:
    """Variants by a setting; those that are values of the packed scene compile nothing anew."""
    for key, field in Render.model_fields.items():
        if get_origin(field.annotation) is Literal:
            now = getattr(spec.render, key)
            for value in get_args(field.annotation):
                if value != now and _applies(spec, scene, key, value):
                    yield _choice(spec, key, value, now)
    depth, roulette = scene.depth, scene.roulette
    if roulette < depth:
        what = "no path is ended by chance: each goes on until it leaves, is absorbed or has max_depth segments"
        yield _number("roulette=off", what, depth=depth, roulette=depth, same_mean=True)
    elif depth > 1:
        first = min(Render().rr_depth, depth - 1)
        what = f"paths may end by chance after {first} segments"
        yield _number("roulette=on", what, depth=depth, roulette=first, same_mean=True)
    for limit in _DEPTHS:
        if limit < depth:
            what = f"paths have at most {limit} segments in place of {depth}"
            yield _number(f"max_depth={limit}", what, depth=limit, roulette=roulette, same_mean=False)


def _applies(spec: SceneSpec, scene: Scene, key: str, value: str) -> bool:
    """Whether another choice of a setting makes a difference in this scene, and can be made."""
    if key != "light_sampling":
        return True
    if spec.render.light_sampling != "paths" and not isinstance(scene.lights, Lights):
        return False
    return value != "paths" or all(light.is_seen() for light in lights_of(spec))


def _choice(spec: SceneSpec, key: str, value: str, now: str) -> Variant:
    name, what, respec = f"{key}={value}", f"{key} is {value} in place of {now}", _with_render(**{key: value})
    if key != "sampler":
        return Variant(name, "setting", what, respec, packs_anew=True, same_mean=key == "light_sampling")
    sampler = SAMPLERS[value](spec.render.seed, spec.render.spp)
    return Variant(name, "sampler", what, respec, lambda scene: scene._replace(sampler=sampler), same_mean=True)


def _number(name: str, what: str, *, depth: int, roulette: int, same_mean: bool) -> Variant:
    respec = _with_render(max_depth=depth, rr_depth=roulette)
    return Variant(
        name,
        "setting",
        what,
        respec,
        lambda scene: scene._replace(depth=depth, roulette=roulette),
        same_mean=same_mean,
    )


# ---- Effects


class _Part(NamedTuple):
    """An effect that is a part of the packed scene: what is without it, the scene without it, and `same_mean`."""

    what: str
    without: Callable[[Scene], Scene]
    same_mean: bool = False


def _at(*path: str) -> Callable[[Scene], Scene]:
    """The scene with None at a path of fields."""
    return lambda scene: cleared(scene, path)


_PACKED: Mapping[str, _Part] = {
    "defocus": _Part("everything is sharp: the opening is a point, which lets in as much light", _at("camera", "lens")),
    "aperture_shape": _Part("the opening is a round one of the same area", _at("camera", "lens", "shape")),
    "vignetting": _Part("no rim before the lens keeps light out", _at("camera", "lens", "rim")),
    "media": _Part("all of space is clear", _at("media")),
    "relief": _Part(
        "surfaces are shaded as smooth as they are",
        lambda scene: scene._replace(relief=relief_of_vertices(scene.primitives)),
    ),
    "clamp": _Part("samples are as bright as they are", _at("clamp")),
    "nested_dielectrics": _Part("of what overlaps every surface is seen, each as a boundary to air", _at("interior")),
    "environment_sampling": _Part(
        "paths find the environment by themselves, and nothing aims at it", unaimed, same_mean=True
    ),
}


class _Event(NamedTuple):
    """An effect that is in the checked scene: what is without it, and the scene without it.

    more_than : another such effect, without which the scene may be the same; there is no need for both then.
    """

    what: str
    without: Callable[[SceneSpec], SceneSpec]
    more_than: str | None = None


_SPECS: Mapping[str, _Event] = {
    "motion_blur": _Event("nothing moves: all is as in the middle of the exposure", frozen, more_than="camera_shake"),
    "shutter_curve": _Event("the shutter opens and closes at once, and exposes for as long", opened_at_once),
    "rolling_shutter": _Event("all of the film is exposed when its middle was", exposed_at_once),
    "camera_shake": _Event("the camera is held still", held),
    "environment": _Event(
        "rays that meet nothing see black",
        lambda spec: spec.model_copy(update={"environment": None}),
    ),
    "real_lens": _Event("an ideal thin lens has the place of the glass: its entrance pupil, focus and scale", ideal),
    "flare": _Event("the glass of the lens reflects nothing", dark_glass),
}

# Of a lens of glass: how it is without an effect, or why there is no such lens.
_GLASS: Mapping[str, _Event | str] = {
    "aperture_shape": _Event("the stop is a round one of the same area", round_stop),
    "defocus": "a real lens needs its opening: see real_lens",
    "vignetting": "it is what the rims of the glass do: see real_lens",
}

_DEVELOPED = "it is done to the finished picture, whatever its samples took"

# Effects that nothing can take the place of.
_KEPT: Mapping[str, str] = {
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

# Effects that are settings, which have variants of their own.
_SETTINGS = {"light_sampling", "roulette"}

_SOLE = "it is all the light that there is"


class _Switches:
    """Variants that each leave out one effect; and the active effects that have none, with the reason."""

    def __init__(self, spec: SceneSpec, packed: Packed) -> None:
        self._spec, self._scene = spec, packed.scene
        effects = effects_of(packed.spec, packed.scene)
        self._has_glass = effects["real_lens"].active
        self._sources = _sources(spec, packed.scene, effects)
        self._parts = list(dict.fromkeys(parts(material_of(spec, item) for _, item in spec.all_objects())))
        self.found: list[Variant] = []
        self.kept: dict[str, str] = {}
        for name, effect in effects.items():
            if not effect.active or name in _SETTINGS:
                continue
            made = self._without(name)
            if isinstance(made, Variant):
                self.found.append(made)
            else:
                self.kept[name] = made

    def _without(self, name: str) -> Variant | str:
        """The variant without an effect, or why there is none."""
        lost = {name} | (
            {f"light.{light}" for light in self._lights_of_environment()} if name == "environment" else set()
        )
        if self._sources and self._sources <= lost:
            return _SOLE
        family, dot, kind = name.partition(".")
        if dot:
            made = _FAMILIES.get(family)
            return "it is what the scene is made of" if made is None else made(self, name, kind)
        if name == "dispersion":
            what = "glass bends all colours alike, as it bends the yellow of the d line"
            return Variant(name, "effect", what, of_one_wavelength, packs_anew=True, recast=OneIndex())
        glass = _GLASS.get(name) if self._has_glass else None
        if isinstance(glass, str):
            return glass
        event = glass or _SPECS.get(name)
        if event is not None:
            # By their values: a key that is set to what it is by default makes no other picture here.
            if event.more_than and dict(event.without(self._spec)) == dict(_SPECS[event.more_than].without(self._spec)):
                return f"without {event.more_than} it is the same scene: see there"
            return Variant(name, "effect", event.what, event.without, packs_anew=True)
        part = _PACKED.get(name)
        # An effect that the packed scene has a place for.
        if part is None and name in Scene._fields and name not in _KEPT:
            part = _Part(f"{name} is left out", _at(name))
        if part is not None:
            return Variant(name, "effect", part.what, repack=part.without, same_mean=part.same_mean)
        return _KEPT.get(name, "nothing could take its place")

    def _lights_of_environment(self) -> set[str]:
        """The kinds of lights that there are only as a part of the environment."""
        return {light.type for light in lights_of(self._spec)} - {light.type for light in self._spec.lights}

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
        return Variant(name, "effect", what, packs_anew=True, recast=Plain(kind))

    def _texture(self, name: str, kind: str) -> Variant:
        what = f"in place of {kind} textures there are their means"
        return Variant(name, "effect", what, packs_anew=True, recast=Means(kind))

    def _light(self, name: str, kind: str) -> Variant:
        module = LIGHTS.specs()[kind].__module__
        return Variant(
            name,
            "effect",
            f"no {kind} light shines",
            lambda spec: spec.model_copy(update={"lights": tuple(item for item in spec.lights if item.type != kind)}),
            # The light that is a part of the environment.
            lambda scene: unlit(scene, module),
            packs_anew=any(item.type == kind for item in self._spec.lights),
        )

    def _medium(self, name: str, kind: str) -> Variant | str:
        if len(self._scene.media.tables) == 1:
            return "it is the only kind of medium: see media"
        module = MEDIA.specs()[kind].__module__
        what = f"space is clear where {kind} media were"
        return Variant(name, "effect", what, repack=lambda scene: cleared_of(scene, module))


_FAMILIES: Mapping[str, Callable[[_Switches, str, str], Variant | str]] = {
    "material": _Switches._material,
    "texture": _Switches._texture,
    "light": _Switches._light,
    "medium": _Switches._medium,
}


def _sources(spec: SceneSpec, scene: Scene, effects: Mapping[str, Effect]) -> set[str]:
    """Names of the effects that bring light into a scene."""
    found = {"environment"} if scene.environment is not None else set()
    found |= {name for name, effect in effects.items() if effect.active and name.startswith("light.")}
    used = parts(material_of(spec, item) for _, item in spec.all_objects())
    found |= {f"material.{part.type}" for part in used if part.emits() and not isinstance(part, SelectorSpec)}

    # Materials that meshes' files bring are known by what is aimed at.
    modules = {cls.__module__: kind for kind, cls in MATERIALS.specs().items()}
    kinds = len(scene.materials) + (0 if scene.selectors is None else len(scene.selectors.tables))
    for lights in scene.lights.tables if scene.lights is not None else ():
        if isinstance(lights, Emitters):
            tables = set((lights.material % kinds).tolist()) & set(range(len(scene.materials)))
            found |= {f"material.{modules[type(scene.materials[table]).__module__]}" for table in tables}
    return found
