"""What a scene file may hold, and the checks across its parts."""

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

from pydantic import (
    BeforeValidator,
    FailFast,
    Field,
    PrivateAttr,
    TypeAdapter,
    model_validator,
)

from raytracer.document import Node, error_at, locate, path_text
from raytracer.dump import plain, yaml_text
from raytracer.errors import InputError, SceneError, shown, suggestion
from raytracer.film.output import check_file, write_bytes
from raytracer.film.tone import ToneCurveField, ToneCurveSpec
from raytracer.film.white_balance import WhiteBalanceField
from raytracer.kinds import CAMERAS, ENVIRONMENTS, FILTERS, LIGHTS, MATERIALS, MEDIA, SHAPES, TEXTURES
from raytracer.reach import Reach
from raytracer.scene.files import named_files, with_names
from raytracer.spec import INLINE_MATERIAL, Count, Name, PositiveNumber, Spec, at
from raytracer.textures.interface import is_name, textures_of

MAX_PIXELS = 2**28
_INT32_MAX = 2**31 - 1
_UINT32_MAX = 2**32 - 1

_SUFFIXES = (".yaml", ".yml")

_Keys: TypeAlias = tuple[str | int, ...]


if TYPE_CHECKING:
    from raytracer.cameras.placement import PlacedSpec
    from raytracer.environments.interface import EnvironmentSpec
    from raytracer.filters.interface import FilterSpec
    from raytracer.lights.interface import LightSpec
    from raytracer.materials.interface import MaterialSpec
    from raytracer.media.interface import MediumSpec
    from raytracer.shapes.interface import ShapeSpec
    from raytracer.textures.interface import TextureSpec

    Camera: TypeAlias = PlacedSpec
    Environment: TypeAlias = EnvironmentSpec
    Filter: TypeAlias = FilterSpec
    Light: TypeAlias = LightSpec
    Material: TypeAlias = MaterialSpec
    Medium: TypeAlias = MediumSpec
    Shape: TypeAlias = ShapeSpec
    Texture: TypeAlias = TextureSpec
else:
    Camera = CAMERAS.union()
    Environment = ENVIRONMENTS.union()
    Filter = FILTERS.union_or_name()
    Light = LIGHTS.union()
    Material = MATERIALS.union()
    Medium = MEDIA.union()
    Shape = SHAPES.union()
    Texture = TEXTURES.union()


def _tuple(value: Any) -> Any:
    """YAML's lists are fields' tuples, which cannot change either."""
    return tuple(value) if isinstance(value, list) else value


class Film(Spec):
    """The image: its size, how samples become pixels, and how these are shown."""

    width: Annotated[int, Count(1, MAX_PIXELS)] = Field(description="Pixels across")
    height: Annotated[int, Count(1, MAX_PIXELS)] = Field(description="Pixels down")
    filter: Filter = Field(
        default_factory=FILTERS.specs()["box"],
        description="Reconstruction filter: a name, or a mapping with its parameters",
    )
    white_balance: WhiteBalanceField | None = Field(
        default=None,
        description="Light that is to look white: a colour temperature from 2000 to 25000 K, `auto`, which makes the "
        "mean of the picture grey, or gains of red, green and blue; by default colours stay as they are",
    )
    tone_curve: ToneCurveField = Field(
        default=ToneCurveSpec(),
        description="How .png and .jpg files show linear values: `linear`, clipped at 1, `filmic`, or "
        "{type: filmic, white: 4}; linear files are left as they are",
    )

    @model_validator(mode="after")
    def _not_too_large(self) -> "Film":
        pixels = self.width * self.height
        if pixels > MAX_PIXELS:
            raise ValueError(
                f"is too large: {self.width} x {self.height} is {pixels:,} pixels, at most {MAX_PIXELS:,} are possible"
            )
        return self


class Render(Spec):
    """How much work goes into the image, and how it is sampled."""

    spp: Annotated[int, Count(1, _INT32_MAX)] = Field(default=64, description="Samples per pixel")
    max_depth: Annotated[int, Count(1, _INT32_MAX)] = Field(
        default=50, description="Path segments: 1 is what the camera ray hits, 2 adds one bounce"
    )
    sampler: Literal["sobol", "independent", "stratified"] = Field(
        default="sobol",
        description="Where the random numbers come from: Owen-scrambled Sobol points, a generator, or jittered strata",
    )
    accuracy: Literal["exact", "robust", "fast"] = Field(
        default="exact",
        description="`exact` solves each hit again in float64, `robust` has Embree watertight, "
        "`fast` takes its hits as they are",
    )
    light_sampling: Literal["mis", "lights", "paths"] = Field(
        default="mis",
        description="How light is found: `mis` aims at lights and follows paths, and weights both, `lights` leaves to "
        "paths only what cannot be aimed at, `paths` aims at nothing",
    )
    seed: Annotated[int, Count(0, _UINT32_MAX)] = Field(
        default=0, description="Seed: the same scene, seed and spp give the same image"
    )
    rr_depth: Annotated[int, Count(0, _INT32_MAX)] = Field(
        default=5, description="Path segments before Russian roulette may end a path"
    )
    clamp: PositiveNumber | None = Field(
        default=None,
        description="Largest radiance that a sample may have in any channel: brighter ones are made as dark as that, "
        "which takes away fireflies, and light; off by default",
    )


_DEEPEST_MATERIAL = 64
_MOST_PARTS = 10_000
"""Materials that one may be made of: a few names, each of two of the one before, would soon make it billions."""

# Groups in groups, which are walked down by calls; scenes have a handful.
_DEEPEST_GROUP = 64


if TYPE_CHECKING:
    _FromCode: TypeAlias = Spec
else:

    class _Checking(type(Spec)):
        def __call__(cls, **values: Any) -> Any:
            from raytracer.scene.load import build_plain

            return build_plain(values)

    class _FromCode(Spec, metaclass=_Checking):
        """A mapping that goes through a file's checks when it is made in code, with their errors."""


class SceneSpec(_FromCode):
    """A scene: what a scene file holds, checked.

    It is loaded from a file, `rt.load("scene.yaml")`, or built in code, `rt.Scene(camera=..., film=...)`, with the keys
    of a file as arguments.  File names in it are relative to the folder of the file, or to the working directory.

    Raises
    ------
    InputError : what it is given is wrong.
    """

    camera: Camera = Field(description="The camera")
    film: Film = Field(description="The image: its size and filter")
    render: Render = Field(default=Render(), description="How much work goes into the image, and how it is sampled")
    environment: Environment | None = Field(
        default=None, description="What rays that hit nothing see; black where it is not given"
    )
    textures: dict[Name, Texture] = Field(
        default_factory=dict, description="Textures by the names that materials call them by"
    )
    materials: dict[Name, Material] = Field(
        default_factory=dict, description="Materials by the names that objects call them by"
    )
    media: dict[Name, Medium] = Field(
        default_factory=dict, description="Media, which fill space, by the names that objects call them by"
    )
    medium: Name | None = Field(
        default=None, description="Name of the medium that fills the whole scene, outside of objects; none by default"
    )
    groups: dict[Name, Annotated[tuple[Shape, ...], FailFast(), BeforeValidator(_tuple)]] = Field(
        default_factory=dict,
        description="Objects that are only where an `instance` or a `scatter` places them, by the names of groups",
    )
    # Of a million wrong objects, each with its error, the first is told.
    objects: Annotated[tuple[Shape, ...], FailFast()] = Field(default=(), description="The objects")
    lights: Annotated[tuple[Light, ...], FailFast()] = Field(default=(), description="Lights besides emitting objects")

    if TYPE_CHECKING:

        def __init__(
            self,
            *,
            camera: Camera | Mapping[str, Any],
            film: Film | Mapping[str, Any],
            render: Render | Mapping[str, Any] = ...,
            environment: Environment | Mapping[str, Any] | None = ...,
            textures: Mapping[str, Texture | Mapping[str, Any]] = ...,
            materials: Mapping[str, Material | Mapping[str, Any]] = ...,
            media: Mapping[str, Medium | Mapping[str, Any]] = ...,
            medium: str | None = ...,
            groups: Mapping[str, Sequence[Shape | Mapping[str, Any]]] = ...,
            objects: Sequence[Shape | Mapping[str, Any]] = ...,
            lights: Sequence[Light | Mapping[str, Any]] = ...,
        ) -> None: ...

    _base: Path = PrivateAttr(default=Path())
    _file: str | None = PrivateAttr(default=None)
    _root: Node | None = PrivateAttr(default=None)
    _reach: Reach | None = PrivateAttr(default=None)

    @property
    def base(self) -> Path:
        """The folder that file names in the scene are relative to."""
        return self._base

    @property
    def file(self) -> str | None:
        """The file that the scene was loaded from, as it was named; None for one that was built in code."""
        return self._file

    def reach_at(self, *keys: str | int) -> Reach | None:
        """Where the files lie that the scene may name at a path; None for anywhere, if no file gave the name."""
        asked = self._root is not None and locate(self._root, keys, typed=False)[0].asked
        return None if asked else self._reach

    def picture(self) -> tuple[int, int]:
        """Width and height of the whole picture (px): of a camera with many views, all of them side by side."""
        return self.camera.picture(self.film.width, self.film.height)

    def __repr__(self) -> str:
        count = len(self.objects)
        seen = f"{self.camera.type}, {self.film.width} x {self.film.height} pixels"
        return f"<rt.Scene {self.file or 'made in code'}: {seen}, {count} object{'' if count == 1 else 's'}>"

    __str__ = __repr__

    def __eq__(self, other: object) -> bool:
        """Whether both say the same, and name the same files."""
        if not isinstance(other, SceneSpec):
            return NotImplemented
        return self is other or self._absolute() == other._absolute()

    __hash__ = None  # type: ignore[assignment]

    def _absolute(self) -> dict[str, Any]:
        """Plain values with the absolute names of files, numbered by what the scene calls them."""
        named = named_files(self)
        numbers = {name: number for number, name in enumerate(dict.fromkeys(item.name for item in named))}
        absolute = {keys: f"{numbers[name]} {os.path.realpath(self.base / name)}" for keys, name, _ in named}
        return with_names(plain(self), absolute)

    def replace(self, overrides: Mapping[str, Any]) -> "SceneSpec":
        """The scene with other values at dotted paths, `scene.replace({"camera.f_number": 2})`; see `rt.load`.

        Raises
        ------
        InputError : a path leads to what is not there, or a value does not suit.
        """
        from raytracer.scene.edit import overridden

        return overridden(self, overrides)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the scene as a YAML file, from which `rt.load` reads an equal one.

        Names of files are made relative to the folder of `path`, which is made if it is missing.  Comments are lost,
        and aliases written out.

        Raises
        ------
        InputError : the name ends in neither .yaml nor .yml, or is no file's.
        OutputError : the file cannot be written.
        """
        target = Path(path)
        if target.suffix.lower() not in _SUFFIXES:
            raise InputError(f"{target}: a scene file ends in {' or '.join(_SUFFIXES)}")
        check_file(target)
        write_bytes(target, yaml_text(with_names(plain(self), self._names_from(target.parent))).encode())

    def _names_from(self, folder: Path) -> dict[_Keys, str]:
        """The names of its files as seen from another folder; two names of one file stay two."""
        base, start = os.path.realpath(self.base), os.path.realpath(folder)
        if base == start:
            return {}
        try:
            way = Path(os.path.relpath(base, start))
        except ValueError:
            # Of another drive.
            way = Path(base)
        return {
            keys: name if Path(name).is_absolute() else f"{way.as_posix()}/{name}"
            for keys, name, _ in named_files(self)
        }

    def error(self, message: str, *keys: str | int) -> SceneError:
        """An error about what the scene holds at a path, such as `"objects", 3, "file"`: it names file and line."""
        return error_at(message, keys, self._root, self._file, typed=False)

    def all_objects(self) -> list[tuple[_Keys, Any]]:
        """Every object, of the scene and of its groups, and its path in the scene."""
        placed: list[tuple[_Keys, Any]] = [(("objects", i), item) for i, item in enumerate(self.objects)]
        return placed + [
            (("groups", name, i), item) for name, items in self.groups.items() for i, item in enumerate(items)
        ]

    def _check_focus(self) -> None:
        """Refuse a camera that is focused on what there is not."""
        name = getattr(self.camera, "focus_on", None)
        known = [item.name for item in self.objects if item.name is not None]
        if name is None or name in known:
            return
        inside = (item.name for items in self.groups.values() for item in items)
        if name in self.groups or name in inside:
            what = "a group" if name in self.groups else "in a group"
            sentence = f"{name!r} is {what}, which may be in many places: name an object that places it"
            at(("camera", "focus_on"), sentence)
        close = suggestion(name, known, "named objects")
        at(("camera", "focus_on"), f"unknown object {shown(name)}; {close}")

    def _check_medium(self, name: str | None, *keys: str | int) -> None:
        """Refuse the name of a medium that there is not."""
        if name is not None and name not in self.media:
            at(keys, f"unknown medium {shown(name)}; {suggestion(name, self.media, 'media')}")

    def _check_textures(self, spec: Spec, *keys: str | int) -> None:
        """Refuse names of textures that there are not."""
        for use in textures_of(spec):
            if isinstance(use.value, str) and use.value not in self.textures:
                close = suggestion(use.value, self.textures, "textures")
                at((*keys, use.key), f"unknown texture {shown(use.value)}; {close}")

    def _check_parts(self, material: Any, *keys: str | int) -> None:
        """Refuse a material with a part that there is not, or whose textures there are not."""
        self._check_textures(material, *keys)
        for key, child in material.children().items():
            if not isinstance(child, str):
                self._check_parts(child, *keys, *key)
            elif child not in self.materials:
                close = suggestion(child, self.materials, "materials")
                at((*keys, *key), f"unknown material {shown(child)}; {close}")

    def _check_loops(self) -> None:
        """Refuse a material that is a part of itself, or is made of too many when all names are followed."""
        parts = {name: tuple(_named_parts(material)) for name, material in self.materials.items()}
        sizes: dict[str, int] = {}

        def follow(chain: tuple[str, ...]) -> int:
            """How many materials the last of a chain of names is made of, itself included."""
            name = chain[-1]
            if name not in sizes:
                size = 1
                for keys, child in parts[name]:
                    place = ("materials", name, *keys)
                    if child in chain:
                        loop = (*chain[chain.index(child) :], child)
                        first = next(keys for keys, below in parts[child] if below == loop[1])
                        at(
                            ("materials", child, *first),
                            f"makes the material {loop[0]!r} a part of itself: {' -> '.join(loop)}",
                        )
                    if len(chain) >= _DEEPEST_MATERIAL:
                        at(place, f"makes materials of materials more than {_DEEPEST_MATERIAL} levels deep")
                    size += follow((*chain, child))
                    if size > _MOST_PARTS:
                        at(place, f"makes one material of more than {_MOST_PARTS:,}, each counted where it is named")
                sizes[name] = size
            return sizes[name]

        for name in self.materials:
            follow((name,))

    @model_validator(mode="after")
    def _noise_has_an_exposure(self) -> "SceneSpec":
        camera = self.camera
        if camera.simulated_sensor() is not None and camera.speed() is None and camera.exposure is None:
            at(
                ("camera", "sensor", "noise"),
                "noise needs to know how much light there is: give camera.iso, or camera.exposure: auto",
            )
        return self

    @model_validator(mode="after")
    def _filters_within_views(self) -> "SceneSpec":
        reach, margin = self.film.filter.reach(), self.camera.margin(self.film.width, self.film.height)
        if reach > margin:
            at(("film", "filter"), f"reaches {reach:g} pixels far, beyond views of so few: {margin:g} at most")
        return self

    @model_validator(mode="after")
    def _names_agree(self) -> "SceneSpec":
        for name in self.textures:
            if not is_name(name):
                at(("textures", name), "a texture's name must not begin as a number does, or would be taken for one")
        for name, material in self.materials.items():
            self._check_parts(material, "materials", name)
        self._check_loops()
        self._check_medium(self.medium, "medium")
        self._check_medium(self.camera.medium, "camera", "medium")
        for name, items in self.groups.items():
            if not items:
                at(("groups", name), "must hold at least one object")
        seen: dict[str, _Keys] = {}
        for keys, item in self.all_objects():
            # Every material that an object calls for exists.
            material = item.material
            if isinstance(material, str) and material not in self.materials:
                at(
                    (*keys, "material"),
                    f"unknown material {shown(material)}; {suggestion(material, self.materials, 'materials')}",
                )

            self._check_medium(item.medium, *keys, "medium")
            self._check_medium(item.outside_medium, *keys, "outside_medium")

            if isinstance(material, Spec):
                self._check_parts(material, *keys, "material")

            # A name means one object.
            if item.name is not None:
                if item.name in seen:
                    at((*keys, "name"), f"{item.name!r} is already the name of {path_text(seen[item.name])}")
                if item.name in self.groups:
                    at((*keys, "name"), f"{item.name!r} is already the name of a group")
                seen[item.name] = keys
        self._check_instances()
        self._check_focus()
        return self

    def _check_instances(self) -> None:
        """Refuse instances of what there is not, and of what they are a part of."""
        named = {item.name: item for item in self.objects if item.name is not None}
        places = {name: [_placed_by(item) for item in items if _placed_by(item)] for name, items in self.groups.items()}
        places |= {name: [_placed_by(item)] if _placed_by(item) else [] for name, item in named.items()}
        for keys, item in self.all_objects():
            if (placed := _placed_by(item)) and placed not in places:
                hint = suggestion(placed, places, "groups and named objects")
                at((*keys, "of"), f"unknown group or object {shown(placed)}; {hint}")

        # Walk down from each name; what was found to end is not walked again.
        depths: dict[str, int] = {}
        for name in places:
            if chain := _ring(name, places, depths):
                keys = next(
                    keys
                    for keys, item in self.all_objects()
                    if getattr(item, "of", None) == chain[1] and chain[0] in (keys[1], item.name)
                )
                if chain[0] != chain[-1]:
                    at((*keys, "of"), f"places groups in groups more than {_DEEPEST_GROUP} levels deep")
                at((*keys, "of"), f"places {chain[0]!r} in itself: {' -> '.join(chain)}")


def _placed_by(item: Spec) -> str:
    """The name of what an object places; empty if it is one that places none."""
    return str(item.__dict__.get("of", ""))


def _ring(name: str, places: Mapping[str, Sequence[str]], depths: dict[str, int]) -> list[str]:
    """A chain of names, each of which places the next, from one to itself, or too deep; empty if `name` has none.

    depths : levels below and with the names that were walked before, to which this one's are added.
    """
    path: list[tuple[str, Iterator[str]]] = [(name, iter(places[name]))]
    while path:
        following = next(path[-1][1], None)
        if following is None:
            ended, _ = path.pop()
            depths[ended] = 1 + max((depths[below] for below in places[ended]), default=0)
            continue
        names = [passed for passed, _ in path]
        if following in names:
            return [*names[names.index(following) :], following]
        if len(path) + depths.get(following, 1) > _DEEPEST_GROUP:
            return [*names, following]
        if following not in depths:
            path.append((following, iter(places[following])))
    return []


def _named_parts(material: Any) -> Iterator[tuple[_Keys, str]]:
    """The materials that one names, directly or in those that it holds inline, by the path to their keys."""
    for key, child in material.children().items():
        if isinstance(child, str):
            yield key, child
        else:
            yield from (((*key, *below), name) for below, name in _named_parts(child))


_MATERIAL: TypeAdapter[Spec] = TypeAdapter(Material)


def check_material(value: Mapping[str, Any]) -> Spec:
    """The material that an object or another material holds inline, checked as those under `materials` are."""
    return _MATERIAL.validate_python(value, context={INLINE_MATERIAL: check_material})
