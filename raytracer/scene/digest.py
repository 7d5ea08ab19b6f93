"""Digest everything that a picture depends on: the scene, the files that it names, the settings and the program."""

import hashlib
import importlib.metadata
import json
import os
import threading
from collections import OrderedDict
from collections.abc import Mapping
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import raytracer
from raytracer.core.compiler.kernel_files import source_hash
from raytracer.optics.to_yaml import spec_to_plain, value_to_plain
from raytracer.scene.assets import companion_files
from raytracer.scene.assets.images import file_of
from raytracer.scene.files import FileReference, file_references, image_fragment, replace_file_names, unreadable
from raytracer.scene.spec import SceneSpec
from raytracer.schema.yaml_nodes import path_text

# What computes, and what reads the files that scenes name.
_LIBRARIES = ("embreex", "llvmlite", "numba", "numpy", "scipy", "OpenEXR", "Pillow")

_SECTIONS_KEPT, _FILES_KEPT = 64, 4096


def _hash_content(path: Path) -> str:
    """Hash what a file holds; read once unless it changes."""
    status = path.stat()
    # A program can set the time of the content's last change, but not that of the directory entry's.
    return _hash_file(path, (status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino))


@lru_cache(_FILES_KEPT)
def _hash_file(path: Path, stamp: tuple[int, ...]) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


class _Section(NamedTuple):
    """One key of a scene, ready to be hashed.

    parts : the specs that it is made of.
    text : its values but for the names of files, as JSON.
    named : the files that it names.
    """

    parts: tuple[Any, ...]
    text: str
    named: tuple[FileReference, ...]


class _Sections:
    """Cache of the sections of recent scenes: the points of a sweep share all of them but one."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._known: OrderedDict[tuple[Any, ...], _Section] = OrderedDict()

    def of(self, key: str, value: Any) -> _Section:
        parts = tuple(value.values()) if isinstance(value, Mapping) else value if isinstance(value, tuple) else (value,)
        names = tuple(value) if isinstance(value, Mapping) else ()
        # Objects in the cache stay alive, so their ids stay theirs.
        known_by = (key, names, *map(id, parts))
        with self._lock:
            section = self._known.get(known_by)
            if section is not None:
                self._known.move_to_end(known_by)
                return section
        named = file_references(value, (key,))
        values = replace_file_names({key: value_to_plain(value)}, {item.keys: "" for item in named})
        section = _Section(parts, json.dumps(values, sort_keys=True), named)
        with self._lock:
            self._known[known_by] = section
            while len(self._known) > _SECTIONS_KEPT:
                self._known.popitem(last=False)
        return section


_sections = _Sections()


def libraries() -> dict[str, str]:
    """Return the versions of the libraries that the bits of a picture depend on; `none` for a missing one."""
    return {name: _version(name) for name in _LIBRARIES}


def _version(name: str) -> str:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return "none"


@cache
def program_hash() -> str:
    """Hash the program: its sources, and the versions of libraries that compute or read files."""
    return source_hash(Path(raytracer.__file__).parent, versions=[*map(" ".join, libraries().items())])


def digest(spec: SceneSpec, **settings: Any) -> str:
    """Hash everything that the picture of a scene depends on (64 hex digits).

    The checked scene, so that `vfov: 20` and `vfov: 20.0 deg` are alike; what its files hold, whatever they are called
    and wherever they are; the settings; the program.  Comments, and the order of keys, do not count; whether a key is
    set to its default or left out does, for materials inherit what is left out.

    settings : further settings of the render: numbers, strings, lists and mappings of such; None is not given.

    Raises
    ------
    SceneError : a file of the scene cannot be read.
    TypeError : a setting is something else.
    """
    given = [key for key in type(spec).model_fields if key in spec.model_fields_set]
    sections = [_sections.of(key, getattr(spec, key)) for key in given]
    ordinals: dict[str, int] = {}
    files: list[Any] = []
    for named in (item for section in sections for item in section.named):
        # Which places share a file decides what is stored once, and so about rounding.
        number = ordinals.setdefault(named.name, len(ordinals))
        files.append([named.keys, number, _file_state(spec, named) if number == len(ordinals) - 1 else None])
    state = {
        "program": program_hash(),
        "scene": [section.text for section in sections],
        "files": files,
        "settings": {key: value_to_plain(value) for key, value in settings.items() if value is not None},
    }
    return hashlib.sha256(json.dumps(state, sort_keys=True).encode()).hexdigest()


def picture_values(spec: SceneSpec) -> dict[str, Any]:
    """Convert a scene to plain values (`to_yaml.spec_to_plain`), without the number of samples."""
    scene = spec_to_plain(spec)
    return {**scene, "render": {key: value for key, value in value_to_plain(spec.render).items() if key != "spp"}}


def file_hashes(spec: SceneSpec) -> dict[str, str]:
    """Hash the contents of a scene's files and of those that they name (64 hex digits each), by path in the scene.

    Raises
    ------
    SceneError : a file cannot be read.
    """
    states = {named.keys: json.dumps(_file_state(spec, named)) for named in file_references(spec)}
    return {path_text(keys): hashlib.sha256(text.encode()).hexdigest() for keys, text in states.items()}


def _file_state(spec: SceneSpec, named: FileReference) -> list[Any]:
    """Collect the asset kind of a file, and the hashes of it and of the files that it names."""
    path = file_of(spec.base / named.name)
    try:
        below = [
            [os.path.relpath(item, path.parent), _hash_content(item)] for item in companion_files(named.kind, path)
        ]
        return [named.kind, path.suffix.lower(), image_fragment(named), _hash_content(path), below]
    except OSError as error:
        raise unreadable(spec, named, error) from None
