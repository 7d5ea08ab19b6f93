"""Check that the files which a scene names exist, and lie where it may name them."""

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from raytracer.scene.assets import file_of, referenced_files
from raytracer.scene.file_references import FileReference, file_references
from raytracer.util.errors import format_value
from raytracer.util.path_sandbox import PathSandbox, make_sandbox, unreadable_reason

if TYPE_CHECKING:
    from raytracer.scene.spec import SceneSpec


def check_files(scene: "SceneSpec", keys: Iterable[str]) -> None:
    """Reject a scene that names, under these keys, a file that it may not name, or that does not exist.

    All files are checked before any is read.  A file out of bounds is rejected whether it exists or not.

    Raises
    ------
    SceneError: a file is out of bounds, missing, a folder, a pipe or a device; or names such a one.
    """
    for key in keys:
        for named in file_references(getattr(scene, key), (key,)):
            _check_file(scene, named)


def _check_file(scene: "SceneSpec", named: FileReference) -> None:
    path = file_of(scene.base / named.name)
    sandbox = scene.sandbox_at(*named.keys)
    if sandbox is not None and not sandbox.allows(file_of(Path(named.name))):
        raise scene.error(sandbox.refusal_message(named.name), *named.keys)
    if reason := unreadable_reason(path):
        raise scene.error(f"{format_value(named.name)} {reason}", *named.keys)
    if not os.path.exists(path):
        folder = "the scene's folder" if scene.file is not None else "which names of files are relative to"
        where = "" if Path(named.name).is_absolute() else f" in {scene.base.resolve()}, {folder}"
        raise scene.error(f"there is no file {format_value(named.name)}{where}{_remedy(path)}", *named.keys)

    # The user who asks for a file does not thereby ask for the files that it names.
    within = make_sandbox(path.parent) if sandbox is None else sandbox
    for below in referenced_files(named.kind, path):
        if not within.allows(Path.cwd() / below):
            name = os.path.relpath(below, path.parent)
            raise scene.error(
                f"{format_value(named.name)} names a file that it may not: {within.refusal_message(name)}", *named.keys
            )
        if reason := unreadable_reason(below):
            raise scene.error(
                f"{format_value(named.name)} names {format_value(below.name)}, which {reason}", *named.keys
            )


def _remedy(path: Path) -> str:
    """Say how to make a missing file, if the repository's scenes have a script for it."""
    folder = path.parent
    is_made = folder.name == "generated" and (folder.parent / "generate").is_dir()
    return ": `make scenes` makes it" if is_made else ""


def check_names_allowed(value: Any, sandbox: PathSandbox) -> None:
    """Reject values that a file gives for keys of a scene, if one is the name of a file that is out of bounds.

    Nothing else that a scene holds looks like a path out of its folder.

    Raises
    ------
    ValueError: there is such a name.
    """
    if isinstance(value, Mapping):
        for item in value.values():
            check_names_allowed(item, sandbox)
    elif isinstance(value, list | tuple):
        for item in value:
            check_names_allowed(item, sandbox)
    elif isinstance(value, str) and not sandbox.allows(file_of(Path(value))):
        raise ValueError(sandbox.refusal_message(value))
