"""From a scene file to a checked scene; whatever is wrong is one sentence that names file, line and key."""

import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from raytracer.assets import LOADERS, file_of, names_within
from raytracer.document import Node, Place, first_error, node_of, override, parse, parse_path, read
from raytracer.dump import plain_value
from raytracer.errors import InputError, SceneError, shortened, shown
from raytracer.reach import AllowFiles, Reach, reach_of, unreadable
from raytracer.scene.files import Named, named_files
from raytracer.scene.spec import SceneSpec, check_material
from raytracer.spec import INLINE_MATERIAL, sentence

CONTEXT = {INLINE_MATERIAL: check_material}
"""Context of the check of a scene, and of its parts by themselves."""


def load(
    path: str | os.PathLike[str], overrides: Mapping[str, Any] | None = None, *, allow_files: AllowFiles = ()
) -> SceneSpec:
    """The checked scene of a YAML file.

    Parameters
    ----------
    path: The scene file; names of files in it are relative to its folder.
    overrides: Values by dotted path (`camera.f_number`, `objects[3].radius`, `objects.ball.radius`) that stand in
        place of the file's.
    allow_files: Folders in which the scene may name files, besides its own (docs/scenes.md, Rules); overrides may
        name any.

    Raises
    ------
    SceneError: the file cannot be read, or what it or an override says is wrong, or it names a file where it may not.
    """
    file = os.fspath(path)
    return build(read(file), file, overrides, base=Path(file).parent, allow_files=allow_files)


def build(
    text: str,
    file: str,
    overrides: Mapping[str, Any] | None = None,
    base: Path | None = None,
    *,
    allow_files: AllowFiles = (),
) -> SceneSpec:
    """The checked scene of a YAML text; `file` is what errors call it. See `load`."""
    root = parse(text, file)
    if root is None or (root.entries is None and root.value is None and root.items is None):
        raise SceneError("is empty; a scene needs at least camera and film", file=file)
    for key, value in (overrides or {}).items():
        root = set_value(root, key, value)
    folder = base or Path()
    return _built(root.plain(), root, file, folder, reach_of(folder, allow_files))


def build_plain(values: Mapping[str, Any], base: Path | None = None) -> SceneSpec:
    """The checked scene of plain values, such as `dump.plain` gives, or of values that hold checked parts.

    Parameters
    ----------
    values: What a scene file holds, by its keys; parts may be objects of `raytracer.camera`, `raytracer.object` etc.
    base: The folder that file names in it are relative to; the working directory by default.

    Raises
    ------
    SceneError: what it says is wrong; it names the key.
    """
    return _built(pythonic(values), None, None, base or Path.cwd(), None)


def _built(
    values: Mapping[str, Any], root: Node | None, file: str | None, base: Path, reach: Reach | None
) -> SceneSpec:
    scene = validated(values, root, file)
    scene._base = base
    scene._file = file
    scene._root = root
    scene._reach = reach
    check_files(scene, type(scene).model_fields)
    return bound(scene)


def bound(scene: SceneSpec, read_file: Callable[[str, Path], Any] | None = None) -> SceneSpec:
    """The scene with a camera that knows what those of its files hold which its numbers depend on.

    read_file : gives what a file holds as a kind of `assets.LOADERS`; by default it is read.

    Raises
    ------
    SceneError: such a file cannot be read, or what it holds and the camera's keys do not go together.
    """
    camera, assets = scene.camera, {}
    bound = [key for key in camera.binds if getattr(camera, key) is not None]
    if not bound:
        return scene
    for key in bound:
        kind, path = camera.loads[key], scene.base / getattr(camera, key)
        try:
            assets[key] = LOADERS[kind](path) if read_file is None else read_file(kind, path)
        except InputError as error:
            raise scene.error(str(error), "camera", key) from None
    try:
        return scene.model_copy(update={"camera": camera.bound(assets)})
    except ValidationError as error:
        (found,) = error.errors(include_url=False)
        raise scene.error(sentence(found), "camera", *found["loc"]) from None


def validated(values: Any, root: Node | None, file: str | None) -> SceneSpec:
    """The scene of these values, with errors that tell where they stand in `root` of `file`.

    Raises
    ------
    SceneError: what they say is wrong.
    """
    try:
        return SceneSpec.model_validate(values, context=CONTEXT)
    except ValidationError as error:
        raise first_error(error, root or node_of(plain_value(values), Place(0)), file) from None


def pythonic(value: Any) -> Any:
    """Values in which arrays and NumPy's numbers are lists and numbers, and paths are texts."""
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, Mapping):
        return {key: pythonic(item) for key, item in value.items()}
    return [pythonic(item) for item in value] if isinstance(value, list | tuple) else value


def check_files(scene: SceneSpec, keys: Iterable[str]) -> None:
    """Refuse a scene that names, under these keys, a file which it may not name, or which is not there.

    Better now than after reading others; and what is not in reach is refused whether it is there or not.

    Raises
    ------
    SceneError: a file is out of reach, is not there, or is a folder, a pipe or a device; or names such a one.
    """
    for key in keys:
        for named in named_files(getattr(scene, key), (key,)):
            _check_file(scene, named)


def _check_file(scene: SceneSpec, named: Named) -> None:
    path = file_of(scene.base / named.name)
    reach = scene.reach_at(*named.keys)
    if reach is not None and not reach.holds(file_of(Path(named.name))):
        raise scene.error(reach.refusal(named.name), *named.keys)
    if reason := unreadable(path):
        raise scene.error(f"{shown(named.name)} {reason}", *named.keys)
    if not os.path.exists(path):
        folder = "the scene's folder" if scene.file is not None else "which names of files are relative to"
        where = "" if Path(named.name).is_absolute() else f" in {scene.base.resolve()}, {folder}"
        raise scene.error(f"there is no file {shown(named.name)}{where}{_remedy(path)}", *named.keys)

    # Who asks for a file does not thereby ask for whatever it names.
    within = reach_of(path.parent) if reach is None else reach
    for below in names_within(named.kind, path):
        if not within.holds(Path.cwd() / below):
            name = os.path.relpath(below, path.parent)
            raise scene.error(f"{shown(named.name)} names a file that it may not: {within.refusal(name)}", *named.keys)
        if reason := unreadable(below):
            raise scene.error(f"{shown(named.name)} names {shown(below.name)}, which {reason}", *named.keys)


def _remedy(path: Path) -> str:
    """Say how a file that is not there can be made, if it is one that the repository's scenes have made for them."""
    folder = path.parent
    is_made = folder.name == "generated" and (folder.parent / "generate").is_dir()
    return ": `make scenes` makes it" if is_made else ""


def check_values(value: Any, reach: Reach) -> None:
    """Refuse values that a file gives for keys of a scene, if one of them is the name of a file that is out of reach.

    Nothing that a scene holds looks like one, but names of files.

    Raises
    ------
    ValueError: there is such a name.
    """
    if isinstance(value, Mapping):
        for item in value.values():
            check_values(item, reach)
    elif isinstance(value, list | tuple):
        for item in value:
            check_values(item, reach)
    elif isinstance(value, str) and not reach.holds(file_of(Path(value))):
        raise ValueError(reach.refusal(value))


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


def path_of(key: str, value: Any) -> tuple[str, ...]:
    """The steps of the dotted path of an override.

    Raises
    ------
    InputError: it is no path.
    """
    return _path(key, _option(key, value))


def _option(key: str, value: Any) -> str:
    return f"-D {key}={shortened(as_yaml(value))}"


def _path(key: str, option: str) -> tuple[str, ...]:
    try:
        return parse_path(key)
    except ValueError as error:
        raise InputError(f"{option}: {error}") from None


def set_value(root: Node, key: str, value: Any) -> Node:
    """The tree with the value at a dotted path put in place of what is there; see `document.override`.

    Raises
    ------
    SceneError: the path leads to what is not there.
    InputError: it is no path.
    """
    option = _option(key, value)
    try:
        return override(root, path_of(key, value), node_of(value, Place(0, option, asked=True)))
    except ValueError as error:
        raise SceneError(str(error), source=option) from None


def as_yaml(value: Any) -> str:
    """A value as the command line would give it."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {as_yaml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(as_yaml(item) for item in value) + "]"
    if isinstance(value, str):
        return value
    return "null" if value is None else shown(value)
