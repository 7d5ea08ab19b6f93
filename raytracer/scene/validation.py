"""Build a checked scene from plain values."""

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from pydantic import ValidationError

from raytracer.optics.to_yaml import value_to_plain
from raytracer.scene.assets import LOADERS
from raytracer.scene.files import check_files
from raytracer.scene.kind_unions import VALIDATION_CONTEXT
from raytracer.schema.validation_errors import first_error
from raytracer.schema.yaml_nodes import Node, SourceLocation, node_of
from raytracer.util.errors import InputError
from raytracer.util.path_sandbox import PathSandbox

if TYPE_CHECKING:
    from raytracer.scene.spec import SceneSpec

S = TypeVar("S", bound="SceneSpec")


def validate_scene(cls: type[S], values: Any, root: Node | None, file: str | None) -> S:
    """Validate the values of a scene; errors tell their location in `root` of `file`.

    Raises
    ------
    SceneError: a value is wrong.
    """
    try:
        return cls.model_validate(values, context=VALIDATION_CONTEXT)
    except ValidationError as error:
        raise first_error(error, root or node_of(value_to_plain(values), SourceLocation(0)), file) from None


def build_scene(
    cls: type[S],
    values: Mapping[str, Any],
    root: Node | None,
    file: str | None,
    base: Path,
    sandbox: PathSandbox | None,
) -> S:
    """Build the checked scene of plain values.

    cls : `SceneSpec`.
    values : the keys of a scene file; parts may be checked specs already.
    root, file : the tree that the values were written in, and its file, for errors; None for values from code.
    base : the folder that file names are relative to.
    sandbox : the folders that files may lie in; None for anywhere.

    Raises
    ------
    SceneError: the values are wrong, or name a file that is missing, broken or out of bounds.
    """
    scene = validate_scene(cls, values, root, file)
    scene._base = base
    scene._file = file
    scene._root = root
    scene._sandbox = sandbox
    check_files(scene, type(scene).model_fields)
    return bind_camera_files(scene)


def bind_camera_files(scene: S, read_file: Callable[[str, Path], Any] | None = None) -> S:
    """Give a scene's camera the contents of the files that its parameters depend on, such as its lens.

    read_file : reads a file as an asset kind of `assets.LOADERS`; by default from disk.

    Raises
    ------
    SceneError: such a file cannot be read, or does not go together with the camera's keys.
    """
    camera, assets = scene.camera, {}
    bound = camera.bound_files()
    if not bound:
        return scene
    for keys, (name, kind) in bound.items():
        path = scene.base / name
        try:
            assets[".".join(map(str, keys))] = LOADERS[kind](path) if read_file is None else read_file(kind, path)
        except InputError as error:
            raise scene.error(str(error), "camera", *keys) from None
    with scene.errors_at("camera"):
        return scene.model_copy(update={"camera": camera.bind_assets(assets)})


def to_builtins(value: Any) -> Any:
    """Convert arrays and NumPy's numbers to lists and numbers, and paths to strings, at any depth."""
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, Mapping):
        return {key: to_builtins(item) for key, item in value.items()}
    return [to_builtins(item) for item in value] if isinstance(value, list | tuple) else value
