"""Variants of a scene, each without one effect or with one setting changed: what `rt cost` measures side by side.

What a scene simulates is read off its packed form, where an absent effect is None, and off the families of kinds: a
new kind of material, texture, light, medium or camera has its variant without a line here.  A variant keeps the
picture's brightness where an effect is not about brightness: a lens without its opening lets in as much light as
before, a shutter without its ramps is open for as long.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Literal, NamedTuple, get_args, get_origin

import numpy as np
from numpy.typing import NDArray

from raytracer.cameras.moving import camera_at
from raytracer.errors import InputError, suggestion
from raytracer.geometry import Site
from raytracer.integrator import Scene
from raytracer.kinds import LIGHTS, MATERIALS, MEDIA
from raytracer.lights.background import Background
from raytracer.lights.emitters import Emitters
from raytracer.lights.interface import Lights
from raytracer.materials.interface import MaterialSpec, SelectorSpec, reflectance, row
from raytracer.materials.lambertian import Lambertian
from raytracer.media.interface import NONE
from raytracer.optics import REC709_LUMINANCE
from raytracer.sampling import SAMPLERS
from raytracer.scene.effects import Effect, effects_of
from raytracer.scene.lights import lights_of
from raytracer.scene.materials import parts
from raytracer.scene.objects import Assets
from raytracer.scene.pack import Packed, Recast, material_of, pack
from raytracer.scene.spec import Render, SceneSpec
from raytracer.shutter import ShutterSpec
from raytracer.spec import Triple
from raytracer.textures.interface import Book, Texturable, TextureSpec, textures_of

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
        yield _number("roulette=off", what, depth=depth, roulette=depth)
    elif depth > 1:
        first = min(Render().rr_depth, depth - 1)
        yield _number("roulette=on", f"paths may end by chance after {first} segments", depth=depth, roulette=first)
    for limit in _DEPTHS:
        if limit < depth:
            what = f"paths have at most {limit} segments in place of {depth}"
            yield _number(f"max_depth={limit}", what, depth=limit, roulette=roulette)


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


def _number(name: str, what: str, *, depth: int, roulette: int) -> Variant:
    respec = _with_render(max_depth=depth, rr_depth=roulette)
    return Variant(
        name,
        "setting",
        what,
        respec,
        lambda scene: scene._replace(depth=depth, roulette=roulette),
        same_mean=name.startswith("roulette"),
    )


# ---- Effects

# Effects that are a part of the packed scene, which is None where they are absent: where it lies, and what is without.
_PACKED: Mapping[str, tuple[tuple[str, ...], str]] = {
    "defocus": (("camera", "lens"), "everything is sharp: the opening is a point, which lets in as much light"),
    "aperture_shape": (("camera", "lens", "shape"), "the opening is a round one of the same area"),
    "vignetting": (("camera", "lens", "rim"), "no rim before the lens keeps light out"),
    "media": (("media",), "all of space is clear"),
    "relief": (("relief",), "surfaces are shaded as smooth as they are"),
}

_DEVELOPED = "it is done to the finished picture, whatever its samples took"

# Effects that nothing can take the place of.
_KEPT: Mapping[str, str] = {
    "exposure": _DEVELOPED,
    "sensor_noise": _DEVELOPED,
    "white_balance": _DEVELOPED,
    "tone_curve": _DEVELOPED,
    "projection": "another projection shows another picture",
    "instances": "without them there would be other objects",
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
        if name in _PACKED:
            path, what = _PACKED[name]
            return Variant(name, "effect", what, repack=lambda scene: _cleared(scene, path))
        if name in _SPECS:
            what, respec = _SPECS[name]
            if name == "motion_blur" and respec(self._spec) == _held(self._spec):
                return "the shaking camera is all that moves: see camera_shake"
            return Variant(name, "effect", what, respec, packs_anew=True)
        if name == "environment_sampling":
            what = "paths find the environment by themselves, and nothing aims at it"
            return Variant(name, "effect", what, repack=_unaimed, same_mean=True)
        # An effect that the packed scene has a place for.
        if name in Scene._fields and name not in _KEPT:
            return Variant(name, "effect", f"{name} is left out", repack=lambda scene: _cleared(scene, (name,)))
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
        return Variant(name, "effect", what, packs_anew=True, recast=_Plain(kind))

    def _texture(self, name: str, kind: str) -> Variant:
        what = f"in place of {kind} textures there are their means"
        return Variant(name, "effect", what, packs_anew=True, recast=_Means(kind))

    def _light(self, name: str, kind: str) -> Variant:
        module = LIGHTS.specs()[kind].__module__
        return Variant(
            name,
            "effect",
            f"no {kind} light shines",
            lambda spec: spec.model_copy(update={"lights": tuple(item for item in spec.lights if item.type != kind)}),
            # The light that is a part of the environment.
            lambda scene: _unlit(scene, module),
            packs_anew=any(item.type == kind for item in self._spec.lights),
        )

    def _medium(self, name: str, kind: str) -> Variant | str:
        if len(self._scene.media.tables) == 1:
            return "it is the only kind of medium: see media"
        module = MEDIA.specs()[kind].__module__
        what = f"space is clear where {kind} media were"
        return Variant(name, "effect", what, repack=lambda scene: _cleared_of(scene, module))


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


# ---- The packed scene


def _cleared(node: Any, path: Sequence[str]) -> Any:
    """A packed NamedTuple with None at a path of fields; of a camera that moves, in the one that it holds."""
    name, *rest = path
    if name not in node._fields:
        return node._replace(camera=_cleared(node.camera, path))
    return node._replace(**{name: _cleared(getattr(node, name), rest) if rest else None})


def _with_tables(scene: Scene, tables: Sequence[Any], **values: Any) -> Scene:
    """The scene with these tables of lights; without any, rays meet the environment as where there are no lights."""
    return scene._replace(lights=scene.lights._replace(tables=tuple(tables), **values) if tables else None)


def _unaimed(scene: Scene) -> Scene:
    """The scene whose environment is met by paths alone."""
    tables = [table for table in scene.lights.tables if not isinstance(table, Background)]
    return _with_tables(scene, tables, unaimed=scene.environment)


def _unlit(scene: Scene, module: str) -> Scene:
    """The scene without the lights of the kind in a module."""
    if scene.lights is None:
        return scene
    return _with_tables(scene, [table for table in scene.lights.tables if type(table).__module__ != module])


def _cleared_of(scene: Scene, module: str) -> Scene:
    """The scene without the media of the kind in a module."""
    media = scene.media
    left = [number for number, table in enumerate(media.tables) if type(table).__module__ != module]
    numbers = np.full(len(media.tables), NONE, np.int32)
    numbers[left] = np.arange(len(left))

    def renamed(references: NDArray[np.int32]) -> NDArray[np.int32]:
        rows, kinds = np.divmod(np.maximum(references, 0), len(media.tables))
        there = np.where(numbers[kinds] == NONE, NONE, rows * len(left) + numbers[kinds])
        return np.where(references < 0, references, there).astype(np.int32)

    return scene._replace(
        media=media._replace(
            tables=tuple(media.tables[number] for number in left),
            inside=renamed(media.inside),
            outside=renamed(media.outside),
            camera=int(renamed(np.array(media.camera, np.int32))),
        )
    )


# ---- The checked scene


def _held(spec: SceneSpec) -> SceneSpec:
    """The scene whose camera is held still."""
    return spec.model_copy(update={"camera": spec.camera.model_copy(update={"shake": None})})


def _frozen(spec: SceneSpec) -> SceneSpec:
    """The scene as it is in the middle of the time in which the shutter is open, and for all of that time."""
    span = spec.camera.opening()
    time = 0.5 * (span.open + span.close)
    still = camera_at(spec.camera, time).model_copy(update={"motion": None, "shake": None})
    return spec.model_copy(
        update={
            "camera": still,
            "objects": tuple(item.at_rest(time) for item in spec.objects),
            "groups": {name: tuple(item.at_rest(time) for item in items) for name, items in spec.groups.items()},
        }
    )


def _with_shutter(spec: SceneSpec, shutter: ShutterSpec) -> SceneSpec:
    return spec.model_copy(update={"camera": spec.camera.model_copy(update={"shutter": shutter, "time": None})})


def _opened_at_once(spec: SceneSpec) -> SceneSpec:
    """The scene with a shutter that opens and closes at once, exposing for as long, about the same mean time."""
    timing, shutter = spec.camera.timing(), spec.camera.shutter
    assert isinstance(shutter, ShutterSpec)
    times, transmissions = np.array(timing.profile).T
    width, (a, b) = np.diff(times), (transmissions[:-1], transmissions[1:])
    # The integral of the linear transmission times time, over that of transmission.
    moment = (width * (a * (2.0 * times[:-1] + times[1:]) + b * (times[:-1] + 2.0 * times[1:])) / 6.0).sum()
    seconds = timing.seconds()
    begin = timing.opens + float(moment) / seconds - 0.5 * seconds
    update = {"open": begin, "close": None, "duration": seconds, "opening": "instant", "ramp": None}
    return _with_shutter(spec, shutter.model_copy(update=update))


def _exposed_at_once(spec: SceneSpec) -> SceneSpec:
    """The scene with all of the film exposed when its middle was."""
    timing, shutter = spec.camera.timing(), spec.camera.shutter
    assert isinstance(shutter, ShutterSpec)
    later = 0.5 * timing.readout
    close = None if shutter.close is None else shutter.close + later
    update = {"open": timing.opens + later, "close": close, "readout": 0.0}
    return _with_shutter(spec, shutter.model_copy(update=update))


# Effects that leave the packed scene when they leave the checked one: what is without them, and the scene that is.
_SPECS: Mapping[str, tuple[str, Callable[[SceneSpec], SceneSpec]]] = {
    "motion_blur": ("nothing moves: all is as in the middle of the exposure", _frozen),
    "shutter_curve": ("the shutter opens and closes at once, and exposes for as long", _opened_at_once),
    "rolling_shutter": ("all of the film is exposed when its middle was", _exposed_at_once),
    "camera_shake": ("the camera is held still", _held),
    "environment": (
        "rays that meet nothing see black",
        lambda spec: spec.model_copy(update={"environment": None}),
    ),
}


# ---- Materials


_ANYWHERE = Site((0.0, 0.0, 0.0), 0.0, 0.0, 0.0)


def _mean(book: Book, field: Texturable, value: str | TextureSpec) -> Any:
    """The plain value of a field that comes nearest to a texture: its mean, or nothing where it is a relief."""
    if field.plain is None:
        return None
    mean = np.clip(book.mean(value, data=field.data), field.bounds.low, field.bounds.high)
    return tuple(mean.tolist()) if isinstance(field.plain, Triple) else float(mean @ np.array(REC709_LUMINANCE))


def _plain(material: MaterialSpec, book: Book, kind: str | None = None) -> MaterialSpec:
    """A material with means in place of its textures, or of those of a kind."""
    means = {
        use.key: _mean(book, use.field, use.value)
        for use in textures_of(material)
        if kind in (None, book.texture(use.value, data=use.field.data).type)
    }
    return material.with_means(means) if means else material


class _Changed:
    """A change of materials, those in others first; each is made once."""

    def __init__(self) -> None:
        self._made: dict[MaterialSpec, MaterialSpec] = {}

    def __call__(self, material: MaterialSpec, book: Book) -> MaterialSpec:
        if material not in self._made:
            self._made[material] = self._of(material, book)
        return self._made[material]

    def _of(self, material: MaterialSpec, book: Book) -> MaterialSpec:
        changed = self.change(material, book)
        if changed is not material:
            return self(changed, book)
        if not isinstance(material, SelectorSpec):
            return material
        return material.with_children([self(child, book) for child in material.children().values()])

    def change(self, material: MaterialSpec, book: Book) -> MaterialSpec:
        """What takes the place of one material, whatever is in it."""
        raise NotImplementedError


class _Means(_Changed):
    """Means in place of the textures of a kind."""

    def __init__(self, kind: str) -> None:
        super().__init__()
        self._kind = kind

    def change(self, material: MaterialSpec, book: Book) -> MaterialSpec:
        return _plain(material, book, self._kind)


class _Plain(_Changed):
    """Something plain in place of the materials of a kind: what a selector mostly shows, else a matte surface."""

    def __init__(self, kind: str) -> None:
        super().__init__()
        self._kind = kind

    def change(self, material: MaterialSpec, book: Book) -> MaterialSpec:
        if material.type != self._kind:
            return material
        if isinstance(material, SelectorSpec):
            return material.nearest_child(book) or material
        even = _plain(material, book)
        albedo = reflectance(row(type(even).pack([even], Book()), 0, None, _ANYWHERE))
        # The relief is an effect of its own.
        relief = {key: getattr(material, key) for key in MaterialSpec.model_fields if key != "type"}
        return Lambertian(albedo=tuple(np.clip(albedo, 0.0, 1.0).tolist())).model_copy(update=relief)
