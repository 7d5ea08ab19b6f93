"""Load a scene file to a checked scene; whatever is wrong is one sentence that names file, line and key."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from raytracer.scene.overrides import set_value
from raytracer.scene.spec import SceneSpec
from raytracer.scene.validation import build_scene, to_builtins
from raytracer.schema.yaml_parser import STANDARD_INPUT, parse, read
from raytracer.util.errors import SceneError
from raytracer.util.path_sandbox import AllowFiles, make_sandbox


def load(
    path: str | os.PathLike[str], overrides: Mapping[str, Any] | None = None, *, allow_files: AllowFiles = ()
) -> SceneSpec:
    """Load the checked scene of a YAML file.

    Parameters
    ----------
    path: The scene file; names of files in it are relative to its folder.  `-` is standard input, whose names are
        relative to the working directory.
    overrides: Values by dotted path (`camera.f_number`, `objects[3].radius`, `objects.ball.radius`) that stand in
        place of the file's.
    allow_files: Folders in which the scene may name files, besides its own (docs/reference/scenes/rules.md);
        overrides may name any.

    Raises
    ------
    SceneError: the file cannot be read, or what it or an override says is wrong, or it names a file where it may not.
    """
    file = os.fspath(path)
    name = "standard input" if file == STANDARD_INPUT else file
    return build(read(file), name, overrides, base=Path(file).parent, allow_files=allow_files)


def build(
    text: str,
    file: str,
    overrides: Mapping[str, Any] | None = None,
    base: Path | None = None,
    *,
    allow_files: AllowFiles = (),
) -> SceneSpec:
    """Build the checked scene of a YAML text, which errors call `file`. See `load`."""
    root = parse(text, file)
    if root is None or (root.entries is None and root.value is None and root.items is None):
        raise SceneError("is empty; a scene needs at least camera and film", file=file)
    for key, value in (overrides or {}).items():
        root = set_value(root, key, value)
    folder = base or Path()
    return build_scene(SceneSpec, root.plain(), root, file, folder, make_sandbox(folder, allow_files))


def build_plain(values: Mapping[str, Any], base: Path | None = None) -> SceneSpec:
    """Build the checked scene of plain values, such as `to_yaml.spec_to_plain` gives, or of checked parts.

    Parameters
    ----------
    values: What a scene file holds, by its keys; parts may be objects of `raytracer.camera`, `raytracer.object` etc.
    base: The folder that file names in it are relative to; the working directory by default.

    Raises
    ------
    SceneError: a value is wrong; the error names the key.
    """
    return build_scene(SceneSpec, to_builtins(values), None, None, base or Path.cwd(), None)
