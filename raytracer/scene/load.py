"""From a scene file to a checked scene; whatever is wrong is one sentence that names file, line and key."""

import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from raytracer.errors import InputError, SceneError, shortened, shown
from raytracer.materials.interface import MaterialSpec
from raytracer.scene.document import Node, Place, node_of, override, parse, parse_path, read
from raytracer.scene.spec import SceneSpec, check_material, error_at
from raytracer.spec import INLINE_MATERIAL, Spec, sentence
from raytracer.textures.interface import textures_of


def load(path: str | os.PathLike[str], overrides: Mapping[str, Any] | None = None) -> SceneSpec:
    """The checked scene of a YAML file.

    Parameters
    ----------
    path: The scene file; names of files in it are relative to its folder.
    overrides: Values by dotted path (`camera.f_number`, `objects[3].radius`, `objects.ball.radius`) that stand in
        place of the file's.

    Raises
    ------
    SceneError: the file cannot be read, or what it or an override says is wrong.
    """
    file = os.fspath(path)
    return build(read(file), file, overrides, base=Path(file).parent)


def build(text: str, file: str, overrides: Mapping[str, Any] | None = None, base: Path | None = None) -> SceneSpec:
    """The checked scene of a YAML text; `file` is what errors call it. See `load`."""
    root = parse(text, file)
    if root is None or (root.entries is None and root.value is None and root.items is None):
        raise SceneError("is empty; a scene needs at least camera and film", file=file)
    for key, value in (overrides or {}).items():
        root = _override(root, key, value)
    try:
        scene = SceneSpec.model_validate(root.plain(), context={INLINE_MATERIAL: check_material})
    except ValidationError as error:
        raise _first(error, root, file) from None
    scene._base = base or Path()
    scene._file = file
    scene._root = root
    _check_files(scene)
    return scene


def _inline(material: Any, keys: tuple[str | int, ...]) -> Iterator[tuple[Spec | str | None, tuple[str | int, ...]]]:
    """A material and those that it holds inline, each with where it stands."""
    yield material, keys
    if isinstance(material, MaterialSpec):
        for below, child in material.children().items():
            yield from _inline(child, (*keys, *below))


def _check_files(scene: SceneSpec) -> None:
    """Refuse a scene that names a file which is not there: better now than after minutes of reading others."""
    places: list[tuple[Spec | str | None, tuple[str | int, ...]]] = [
        (scene.camera, ("camera",)),
        (scene.environment, ("environment",)),
        *((texture, ("textures", name)) for name, texture in scene.textures.items()),
        *(part for name, material in scene.materials.items() for part in _inline(material, ("materials", name))),
        *((medium, ("media", name)) for name, medium in scene.media.items()),
        *((item, keys) for keys, item in scene.all_objects()),
        *(part for keys, item in scene.all_objects() for part in _inline(item.material, (*keys, "material"))),
        *((light, ("lights", i)) for i, light in enumerate(scene.lights)),
    ]
    places += [
        (use.value, (*keys, use.key)) for spec, keys in places if isinstance(spec, Spec) for use in textures_of(spec)
    ]
    for spec, keys in places:
        for place, (name, _) in (spec.files() if isinstance(spec, Spec) else {}).items():
            path = scene.base / name
            if path.is_dir():
                raise scene.error(f"{shown(name)} is a folder, not a file", *keys, *place)
            if not path.exists():
                where = "" if Path(name).is_absolute() else f" in {scene.base.resolve()}, the scene's folder"
                raise scene.error(f"there is no file {shown(name)}{where}", *keys, *place)


def parse_overrides(definitions: Iterable[str]) -> dict[str, Any]:
    """The values of `-D` options, each `key.path=value` with the value in YAML.

    Raises
    ------
    InputError: an option without `=`, with a path that is none, given twice, or with a value that is not YAML.
    """
    result: dict[str, Any] = {}
    for definition in definitions:
        key, equals, text = definition.partition("=")
        option = f"-D {definition}"
        if not equals:
            raise InputError(f"{option}: must be key.path=value, such as camera.vfov=40")
        _path(key, option)
        if key in result:
            raise InputError(f"{option}: {key} is given twice")
        root = parse(text, "", option=option)
        result[key] = root.plain() if root is not None else None
    return result


def _path(key: str, option: str) -> tuple[str, ...]:
    try:
        return parse_path(key)
    except ValueError as error:
        raise InputError(f"{option}: {error}") from None


def _override(root: Node, key: str, value: Any) -> Node:
    option = f"-D {key}={shortened(_as_yaml(value))}"
    try:
        return override(root, _path(key, option), node_of(value, Place(0, option)))
    except ValueError as error:
        raise SceneError(str(error), source=option) from None


def _as_yaml(value: Any) -> str:
    """A value as the command line would give it."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {_as_yaml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_as_yaml(item) for item in value) + "]"
    if isinstance(value, str):
        return value
    return "null" if value is None else shown(value)


def _first(error: ValidationError, root: Node, file: str) -> SceneError:
    """The error that stands first in the document."""
    found = [error_at(sentence(item), item["loc"], root, file) for item in error.errors(include_url=False)]
    return min(found, key=lambda item: (item.source is None, item.line or 0))
