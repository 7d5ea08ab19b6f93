"""Bundle a scene with its files, for another machine."""

import os
from pathlib import Path, PurePosixPath
from typing import NamedTuple

from raytracer.optics.to_yaml import spec_to_plain, to_yaml
from raytracer.scene.assets import companion_files
from raytracer.scene.assets.images import file_of
from raytracer.scene.files import FileReference, file_references, image_fragment, replace_file_names, unreadable
from raytracer.scene.load import build
from raytracer.scene.spec import SceneSpec
from raytracer.schema.yaml_nodes import KeyPath
from raytracer.util.atomic_write import write_bytes
from raytracer.util.errors import InputError, format_value


class Bundle(NamedTuple):
    """A scene with its files, for another machine.

    text : the scene in YAML.
    name : of the scene in errors.
    files : contents by name within the bundle.
    """

    text: str
    name: str
    files: dict[str, bytes]


def bundle(spec: SceneSpec) -> Bundle:
    """Collect a scene and all files that it reads.

    Files with one name in the scene have one name in the bundle, and others have others: which objects share a file
    decides what is stored once, and so about rounding.

    Raises
    ------
    SceneError : a file cannot be read, or names another by an absolute path.
    """
    names: dict[KeyPath, str] = {}
    inside: dict[str, str] = {}
    files: dict[str, bytes] = {}
    for named in file_references(spec):
        if named.name not in inside:
            folder = PurePosixPath("files", str(len(inside)))
            inside[named.name] = _gather(spec, named, folder, files)
        names[named.keys] = inside[named.name]
    text = to_yaml(replace_file_names(spec_to_plain(spec), names))
    return Bundle(text, spec.file or "the scene", files)


def _gather(spec: SceneSpec, named: FileReference, folder: PurePosixPath, files: dict[str, bytes]) -> str:
    """Put a file and those that it names into a folder of a bundle, and return its name there."""
    path = file_of(spec.base / named.name)
    members = [path, *companion_files(named.kind, path)]
    if not all(member.is_relative_to(path.parent) for member in members):
        raise spec.error(
            f"{format_value(named.name)} names a file by its absolute path, which is nowhere else", *named.keys
        )
    places = [Path(os.path.abspath(member)) for member in members]
    root = os.path.commonpath([place.parent for place in places])
    inside = [str(folder / place.relative_to(root).as_posix()) for place in places]
    for place, name in zip(places, inside, strict=True):
        try:
            files[name] = place.read_bytes()
        except OSError as error:
            raise unreadable(spec, named, error) from None
    return inside[0] + image_fragment(named)


def unbundle(packed: Bundle, folder: str | os.PathLike[str]) -> SceneSpec:
    """Write the files of a bundle into `folder`, and nowhere else, and build its scene.

    Raises
    ------
    InputError : a file's name leads out of the folder, or the scene is wrong.
    OutputError : a file cannot be written.
    """
    root = Path(folder)
    for name, data in packed.files.items():
        pure = PurePosixPath(name)
        target = root / pure
        if pure.is_absolute() or ".." in pure.parts or not target.resolve().is_relative_to(root.resolve()):
            raise InputError(f"a bundle names the file {format_value(name)}, which would lie outside of its folder")
        target.parent.mkdir(parents=True, exist_ok=True)
        write_bytes(target, data)
    return build(packed.text, packed.name, base=root)
