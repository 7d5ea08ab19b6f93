"""Everything that a picture depends on: the scene, the files that it names, the settings and the program.

`digest` tells whether that is what it was; `bundle` takes a scene and its files elsewhere.
"""

import hashlib
import importlib.metadata
import json
import os
import threading
from collections import OrderedDict
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple

import raytracer
from raytracer.assets import companions, file_of
from raytracer.document import path_text
from raytracer.dump import plain, plain_value, yaml_text
from raytracer.errors import InputError, shown
from raytracer.film.output import write_bytes
from raytracer.kernel_files import source_hash
from raytracer.scene.files import Keys, Named, named_files, with_names
from raytracer.scene.load import build
from raytracer.scene.spec import SceneSpec

# What computes, and what reads the files that scenes name.
_LIBRARIES = ("embreex", "llvmlite", "numba", "numpy", "scipy", "meshio", "OpenEXR", "Pillow", "trimesh")

_SECTIONS_KEPT = 64


class InputFile(NamedTuple):
    """A file that rendering a scene reads.

    keys, where the scene names it, or the file that names it; name, as it stands in the scene, or the path from there;
    path; kind, what it is read as (`assets.LOADERS`), or `companion`, for what another file names.
    """

    keys: Keys
    name: str
    path: Path
    kind: str


def files_of(spec: SceneSpec) -> tuple[InputFile, ...]:
    """The files that rendering a scene reads, in the order of the scene, and behind each those that it names.

    A name that stands in several places of the scene is told each time.
    """
    result: list[InputFile] = []
    for named in named_files(spec):
        path = file_of(spec.base / named.name)
        result.append(InputFile(named.keys, named.name, path, named.kind))
        result += [
            InputFile(named.keys, os.path.relpath(companion, spec.base), companion, "companion")
            for companion in companions(named.kind, path)
        ]
    return tuple(result)


Stamp = tuple[int, int]
"""Size of a file in bytes, and when it was last written in ns: where they are alike, so is what it holds."""


def stamps(spec: SceneSpec) -> dict[Path, Stamp]:
    """Those of the files that rendering a scene reads, as far as they are there."""
    found: dict[Path, Stamp] = {}
    for file in files_of(spec):
        with suppress(OSError):
            status = file.path.stat()
            found[file.path] = status.st_size, status.st_mtime_ns
    return found


# ---- Digest


class _Contents:
    """Hashes of files by path, size and times of change, so that each file is read once."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._known: dict[Path, tuple[tuple[int, ...], str]] = {}

    def __call__(self, path: Path) -> str:
        status = path.stat()
        # The time of the last change of its entry is nobody's to set, as that of the content is.
        stamp = status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino
        with self._lock:
            known = self._known.get(path)
        if known is None or known[0] != stamp:
            with path.open("rb") as file:
                known = stamp, hashlib.file_digest(file, "sha256").hexdigest()
            with self._lock:
                self._known[path] = known
        return known[1]


_contents = _Contents()


class _Section(NamedTuple):
    """A part of a scene, by the objects that it is made of: what it says besides the names of files, and these."""

    parts: tuple[Any, ...]
    text: str
    named: tuple[Named, ...]


class _Sections:
    """The parts of scenes that were looked at last: those of a sweep's points are the same but for one."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._known: OrderedDict[tuple[Any, ...], _Section] = OrderedDict()

    def of(self, key: str, value: Any) -> _Section:
        parts = tuple(value.values()) if isinstance(value, Mapping) else value if isinstance(value, tuple) else (value,)
        names = tuple(value) if isinstance(value, Mapping) else ()
        # What is held here keeps its identity.
        known_by = (key, names, *map(id, parts))
        with self._lock:
            section = self._known.get(known_by)
            if section is not None:
                self._known.move_to_end(known_by)
                return section
        named = named_files(value, (key,))
        values = with_names({key: plain_value(value)}, {item.keys: "" for item in named})
        section = _Section(parts, json.dumps(values, sort_keys=True), named)
        with self._lock:
            self._known[known_by] = section
            while len(self._known) > _SECTIONS_KEPT:
                self._known.popitem(last=False)
        return section


_sections = _Sections()


def libraries() -> dict[str, str]:
    """Versions by name of the libraries that the bits of a picture depend on; `none` where one is not installed."""
    return {name: _version(name) for name in _LIBRARIES}


def _version(name: str) -> str:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return "none"


@cache
def program() -> str:
    """Hash of the program: its sources, and the versions of what computes and reads files."""
    return source_hash(Path(raytracer.__file__).parent, *map(" ".join, libraries().items()))


def digest(spec: SceneSpec, **settings: Any) -> str:
    """Hash (64 hex digits) of everything that the picture of a scene depends on.

    The checked scene, so that `vfov: 20` and `vfov: 20.0 deg` are alike; what its files hold, whatever they are called
    and wherever they are; the settings; the program.  Comments, and the order of keys, do not count; whether a key is
    set to its default or left out does, for materials inherit what is left out.

    Parameters
    ----------
    settings : what else the caller renders with: numbers, texts, lists and mappings of such; None is not given.

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
        files.append([named.keys, number, _held_by(spec, named) if number == len(ordinals) - 1 else None])
    state = {
        "program": program(),
        "scene": [section.text for section in sections],
        "files": files,
        "settings": {key: plain_value(value) for key, value in settings.items() if value is not None},
    }
    return hashlib.sha256(json.dumps(state, sort_keys=True).encode()).hexdigest()


def described(spec: SceneSpec) -> dict[str, Any]:
    """A scene as plain values (`dump.plain`), but for how many samples its picture gets."""
    scene = plain(spec)
    return {**scene, "render": {key: value for key, value in plain_value(spec.render).items() if key != "spp"}}


def contents(spec: SceneSpec) -> dict[str, str]:
    """Hashes (64 hex digits) of what a scene's files hold, and those that they name, by where the scene names them.

    Raises
    ------
    SceneError : a file cannot be read.
    """
    held = {named.keys: json.dumps(_held_by(spec, named)) for named in named_files(spec)}
    return {path_text(keys): hashlib.sha256(text.encode()).hexdigest() for keys, text in held.items()}


def _held_by(spec: SceneSpec, named: Named) -> list[Any]:
    """How a file is read, and what it and the files that it names hold."""
    path = file_of(spec.base / named.name)
    try:
        below = [[os.path.relpath(item, path.parent), _contents(item)] for item in companions(named.kind, path)]
        return [named.kind, path.suffix.lower(), _part(named), _contents(path), below]
    except OSError as error:
        reason = error.strerror or str(error)
        raise spec.error(f"{shown(named.name)} cannot be read: {reason}", *named.keys) from None


def _part(named: Named) -> str:
    """What a name says behind the file's own: which image of a glTF file."""
    whole = Path(named.name)
    return "" if file_of(whole) == whole else f"#{named.name.rpartition('#')[2]}"


# ---- Bundle


class Bundle(NamedTuple):
    """A scene with its files, for another machine: YAML text, what errors call it, and contents by name within."""

    text: str
    name: str
    files: dict[str, bytes]


def bundle(spec: SceneSpec) -> Bundle:
    """The scene and all that it reads.

    Files with one name in the scene have one name in the bundle, and others have others: which objects share a file
    decides what is stored once, and so about rounding.

    Raises
    ------
    SceneError : a file cannot be read, or names another by an absolute path.
    """
    names: dict[Keys, str] = {}
    inside: dict[str, str] = {}
    files: dict[str, bytes] = {}
    for named in named_files(spec):
        if named.name not in inside:
            folder = PurePosixPath("files", str(len(inside)))
            inside[named.name] = _gather(spec, named, folder, files)
        names[named.keys] = inside[named.name]
    text = yaml_text(with_names(plain(spec), names))
    return Bundle(text, spec.file or "the scene", files)


def _gather(spec: SceneSpec, named: Named, folder: PurePosixPath, files: dict[str, bytes]) -> str:
    """Put a file and those that it names into a folder of a bundle; the file's name there."""
    path = file_of(spec.base / named.name)
    members = [path, *companions(named.kind, path)]
    if not all(member.is_relative_to(path.parent) for member in members):
        raise spec.error(f"{shown(named.name)} names a file by its absolute path, which is nowhere else", *named.keys)
    places = [Path(os.path.abspath(member)) for member in members]
    root = os.path.commonpath([place.parent for place in places])
    inside = [str(folder / place.relative_to(root).as_posix()) for place in places]
    for place, name in zip(places, inside, strict=True):
        try:
            files[name] = place.read_bytes()
        except OSError as error:
            reason = error.strerror or str(error)
            raise spec.error(f"{shown(named.name)} cannot be read: {reason}", *named.keys) from None
    return inside[0] + _part(named)


def unbundle(packed: Bundle, folder: str | os.PathLike[str]) -> SceneSpec:
    """The scene of a bundle, with its files written into `folder`, and none elsewhere.

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
            raise InputError(f"a bundle names the file {shown(name)}, which would lie outside of its folder")
        target.parent.mkdir(parents=True, exist_ok=True)
        write_bytes(target, data)
    return build(packed.text, packed.name, base=root)
