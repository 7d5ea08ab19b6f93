"""The checked scene that a scene file holds: `rt.Scene`."""

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Required, TypeAlias, TypedDict, Unpack

from pydantic import BeforeValidator, FailFast, Field, PrivateAttr, ValidationError, WrapValidator, model_validator

from raytracer.optics.to_yaml import spec_to_plain, to_yaml
from raytracer.report.wording import count
from raytracer.scene.files import file_references, replace_file_names
from raytracer.scene.kind_unions import Camera, Environment, Light, Material, Medium, Shape, Texture
from raytracer.scene.overrides import apply_overrides
from raytracer.scene.reference_checks import check_references
from raytracer.scene.render_settings import Film, Render
from raytracer.scene.validation import build_scene, to_builtins
from raytracer.schema.fields import Name
from raytracer.schema.spec import Spec, field_error, first_errors
from raytracer.schema.validation_errors import error_at, error_sentence
from raytracer.schema.yaml_nodes import KeyPath, Node, locate
from raytracer.util.atomic_write import check_file, write_bytes
from raytracer.util.errors import InputError, SceneError
from raytracer.util.path_sandbox import PathSandbox

_SUFFIXES = (".yaml", ".yml")


_FIRST_ERRORS = (FailFast(), WrapValidator(first_errors))
# Lists of YAML become tuples, since specs are immutable.
_TUPLE = BeforeValidator(lambda value: tuple(value) if isinstance(value, list) else value)

if TYPE_CHECKING:

    class _SceneKeys(TypedDict, total=False):
        """The keys of a scene as arguments of `rt.Scene`, whose parts may be mappings."""

        camera: Required[Camera | Mapping[str, Any]]
        film: Required[Film | Mapping[str, Any]]
        render: Render | Mapping[str, Any]
        environment: Environment | Mapping[str, Any] | None
        textures: Mapping[str, Texture | Mapping[str, Any]]
        materials: Mapping[str, Material | Mapping[str, Any]]
        media: Mapping[str, Medium | Mapping[str, Any]]
        medium: str | None
        groups: Mapping[str, Sequence[Shape | Mapping[str, Any]]]
        objects: Sequence[Shape | Mapping[str, Any]]
        lights: Sequence[Light | Mapping[str, Any]]

    _FromCode: TypeAlias = Spec
else:

    class _Checking(type(Spec)):
        def __call__(cls, **values: Any) -> Any:
            return build_scene(cls, to_builtins(values), None, None, Path.cwd(), None)

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
    groups: dict[Name, Annotated[tuple[Shape, ...], *_FIRST_ERRORS, _TUPLE]] = Field(
        default_factory=dict,
        description="Objects that are only where an `instance` or a `scatter` places them, by the names of groups",
    )
    objects: Annotated[tuple[Shape, ...], *_FIRST_ERRORS] = Field(default=(), description="The objects")
    lights: Annotated[tuple[Light, ...], *_FIRST_ERRORS] = Field(
        default=(), description="Lights besides emitting objects"
    )

    if TYPE_CHECKING:

        def __init__(self, **values: Unpack[_SceneKeys]) -> None: ...

    _base: Path = PrivateAttr(default=Path())
    _file: str | None = PrivateAttr(default=None)
    _root: Node | None = PrivateAttr(default=None)
    _sandbox: PathSandbox | None = PrivateAttr(default=None)

    @property
    def base(self) -> Path:
        """Folder that file names in the scene are relative to."""
        return self._base

    @property
    def file(self) -> str | None:
        """File that the scene was loaded from, as it was named; None for one that was built in code."""
        return self._file

    def sandbox_at(self, *keys: str | int) -> PathSandbox | None:
        """Return the folders that hold the files which a path of the scene may name; None for anywhere."""
        is_user_requested = self._root is not None and locate(self._root, keys, typed=False)[0].is_user_requested
        # A name that the user gave, and no file, may lead anywhere.
        return None if is_user_requested else self._sandbox

    def picture(self) -> tuple[int, int]:
        """Compute width and height of the whole picture (px), all views of a camera with many side by side."""
        return self.camera.picture(self.film.width, self.film.height)

    def __repr__(self) -> str:
        seen = f"{self.camera.type}, {self.film.width} x {self.film.height} pixels"
        return f"<rt.Scene {self.file or 'made in code'}: {seen}, {count(len(self.objects), 'object')}>"

    __str__ = __repr__

    def __eq__(self, other: object) -> bool:
        """Return True if both hold the same, and name the same files."""
        if not isinstance(other, SceneSpec):
            return NotImplemented
        return self is other or self._absolute() == other._absolute()

    __hash__ = None  # type: ignore[assignment]

    def _absolute(self) -> dict[str, Any]:
        """Convert to plain values with absolute file names, numbered by the names in the scene."""
        named = file_references(self)
        numbers = {name: number for number, name in enumerate(dict.fromkeys(item.name for item in named))}
        absolute = {keys: f"{numbers[name]} {os.path.realpath(self.base / name)}" for keys, name, _ in named}
        return replace_file_names(spec_to_plain(self), absolute)

    def replace(self, overrides: Mapping[str, Any]) -> "SceneSpec":
        """Replace values at dotted paths, `scene.replace({"camera.f_number": 2})`; see `rt.load`.

        Raises
        ------
        InputError : a path leads to what is not there, or a value does not suit.
        """
        return apply_overrides(self, overrides)

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
        write_bytes(target, to_yaml(replace_file_names(spec_to_plain(self), self._names_from(target.parent))).encode())

    def _names_from(self, folder: Path) -> dict[KeyPath, str]:
        """Return the names of its files relative to another folder; two names of one file stay two."""
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
            for keys, name, _ in file_references(self)
        }

    def error(self, message: str, *keys: str | int) -> SceneError:
        """Make an error about the value at a path, such as `"objects", 3, "file"`: it names file and line."""
        return error_at(message, keys, self._root, self._file, typed=False)

    @contextmanager
    def errors_at(self, *keys: str | int) -> Iterator[None]:
        """Turn a ValueError about the value at a path, or a ValidationError of keys below, into such an error."""
        try:
            yield
        except ValidationError as error:
            detail = error.errors(include_url=False)[0]
            raise self.error(error_sentence(detail), *keys, *detail["loc"]) from None
        except ValueError as error:
            raise self.error(str(error), *keys) from None

    def all_objects(self) -> list[tuple[KeyPath, Any]]:
        """List every object of the scene and of its groups, with its path in the scene."""
        placed: list[tuple[KeyPath, Any]] = [(("objects", i), item) for i, item in enumerate(self.objects)]
        return placed + [
            (("groups", name, i), item) for name, items in self.groups.items() for i, item in enumerate(items)
        ]

    @model_validator(mode="after")
    def _noise_has_an_exposure(self) -> "SceneSpec":
        camera = self.camera
        if camera.simulated_sensor() is not None and camera.iso_speed() is None and camera.exposure is None:
            field_error(
                ("camera", "sensor", "noise"),
                "noise needs to know how much light there is: give camera.iso, or camera.exposure: auto",
            )
        return self

    @model_validator(mode="after")
    def _filters_within_views(self) -> "SceneSpec":
        reach, margin = self.film.filter.support(), self.camera.film_margin(self.film.width, self.film.height)
        if reach > margin:
            field_error(("film", "filter"), f"reaches {reach:g} pixels far, beyond views of so few: {margin:g} at most")
        return self

    @model_validator(mode="after")
    def _references_exist(self) -> "SceneSpec":
        check_references(self)
        return self
