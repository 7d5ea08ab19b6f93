"""The files that a scene names: where its keys name them, whether it may, and what rendering it reads."""

import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from raytracer.scene.assets import companion_files, referenced_files
from raytracer.scene.assets.images import file_of
from raytracer.schema.spec import Spec
from raytracer.schema.yaml_nodes import KeyPath
from raytracer.util.errors import SceneError, format_value
from raytracer.util.path_sandbox import PathSandbox, make_sandbox, unreadable_reason

if TYPE_CHECKING:
    from raytracer.scene.spec import SceneSpec


class FileReference(NamedTuple):
    """A file that a scene names.

    keys : path of keys to the name.
    name : as it stands in the scene.
    kind : asset kind that it is read as (`assets.LOADERS`).
    """

    keys: KeyPath
    name: str
    kind: str


def file_references(part: Any, keys: KeyPath = ()) -> tuple[FileReference, ...]:
    """List the files that a scene, or a part of it at `keys`, names, in the order of the scene."""
    references: dict[KeyPath, FileReference] = {}
    for place, spec in _specs(part, keys):
        for below, (name, kind) in spec.files().items():
            # A part may list a file that the mapping which holds it lists, too.
            references.setdefault((*place, *below), FileReference((*place, *below), name, kind))
    return tuple(references.values())


def _specs(part: Any, keys: KeyPath) -> Iterator[tuple[KeyPath, Spec]]:
    """Walk through every mapping of a part of a scene, with its path."""
    if isinstance(part, Spec):
        yield keys, part
        for key, value in part.__dict__.items():
            if isinstance(value, Spec | tuple | Mapping):
                yield from _specs(value, (*keys, key))
    elif isinstance(part, tuple):
        for number, value in enumerate(part):
            if isinstance(value, Spec | tuple):
                yield from _specs(value, (*keys, number))
    elif isinstance(part, Mapping):
        for key, value in part.items():
            yield from _specs(value, (*keys, key))


def replace_file_names(plain_scene: dict[str, Any], names: Mapping[KeyPath, str]) -> dict[str, Any]:
    """Replace the names of files at these paths in plain values (`to_yaml.spec_to_plain`), in place."""
    for keys, name in names.items():
        place: Any = plain_scene
        for key in keys[:-1]:
            place = place[key]
        place[keys[-1]] = name
    return plain_scene


# ---- Access


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
        # The repository's scenes have scripts for some files.
        is_made = path.parent.name == "generated" and (path.parent.parent / "generate").is_dir()
        remedy = ": `make scenes` makes it" if is_made else ""
        raise scene.error(f"there is no file {format_value(named.name)}{where}{remedy}", *named.keys)

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


# ---- Files that rendering reads


class InputFile(NamedTuple):
    """A file that rendering a scene reads.

    keys : path in the scene of its name, or of the file that names it.
    name : as it stands in the scene, or the path from the scene's folder.
    path : of the file.
    kind : asset kind that it is read as (`assets.LOADERS`), or `companion` for a file that another one names.
    """

    keys: KeyPath
    name: str
    path: Path
    kind: str


def input_files(spec: "SceneSpec") -> tuple[InputFile, ...]:
    """List the files that rendering a scene reads, in the order of the scene, each followed by those that it names.

    A name that stands in several places of the scene is listed each time.
    """
    result: list[InputFile] = []
    for named in file_references(spec):
        path = file_of(spec.base / named.name)
        result.append(InputFile(named.keys, named.name, path, named.kind))
        result += [
            InputFile(named.keys, os.path.relpath(companion, spec.base), companion, "companion")
            for companion in companion_files(named.kind, path)
        ]
    return tuple(result)


FileStamp = tuple[int, int]
"""Size of a file in bytes, and its time of modification in ns; a file whose stamp is unchanged is unchanged."""


def file_stamps(spec: "SceneSpec") -> dict[Path, FileStamp]:
    """Collect the stamps of the files that rendering a scene reads, as far as they exist."""
    stamps: dict[Path, FileStamp] = {}
    for file in input_files(spec):
        with suppress(OSError):
            status = file.path.stat()
            stamps[file.path] = status.st_size, status.st_mtime_ns
    return stamps


def unreadable(spec: "SceneSpec", named: FileReference, error: OSError) -> SceneError:
    """Make the error of a file that cannot be read."""
    return spec.error(f"{format_value(named.name)} cannot be read: {error.strerror or error}", *named.keys)


def image_fragment(named: FileReference) -> str:
    """Return the part of a name that selects an image of a glTF file: `#2`; empty if there is none."""
    whole = Path(named.name)
    return "" if file_of(whole) == whole else f"#{named.name.rpartition('#')[2]}"
