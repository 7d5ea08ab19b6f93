"""The files that rendering a scene reads: those that it names, and those that these name in turn."""

import os
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from raytracer.scene.assets import companion_files, file_of
from raytracer.scene.file_references import FileReference, file_references
from raytracer.scene.spec import SceneSpec
from raytracer.schema.yaml_nodes import KeyPath


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


def input_files(spec: SceneSpec) -> tuple[InputFile, ...]:
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


def file_stamps(spec: SceneSpec) -> dict[Path, FileStamp]:
    """Collect the stamps of the files that rendering a scene reads, as far as they exist."""
    stamps: dict[Path, FileStamp] = {}
    for file in input_files(spec):
        with suppress(OSError):
            status = file.path.stat()
            stamps[file.path] = status.st_size, status.st_mtime_ns
    return stamps


def image_fragment(named: FileReference) -> str:
    """Return the part of a name that selects an image of a glTF file: `#2`; empty if there is none."""
    whole = Path(named.name)
    return "" if file_of(whole) == whole else f"#{named.name.rpartition('#')[2]}"
