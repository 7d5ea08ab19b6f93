"""The files that the pictures of scenes are written to, as `-o`, `--format` and the names of the scenes say."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from raytracer.util.errors import InputError

FOLDER = Path("outputs")
"""Folder of the pictures that no option names a place for."""


def name_pictures(scenes: Sequence[str], words: Sequence[str], suffix: str | None) -> dict[str, list[Path]]:
    """Name the files of each scene's picture.

    words : values of `-o`: files; folders, which exist or end in a slash; or `-` for standard output.
    suffix : value of `--format`, for what `-o` gives no name.

    Raises InputError: one file is to hold several pictures, or is named and has a format besides.
    """
    named = {scene: [_name(scene, word, suffix) for word in words or [f"{FOLDER}/"]] for scene in scenes}
    if len(named) < len(scenes):
        raise InputError(f"{_first_repeated(scenes)} is given twice")
    _check_different(named)
    return named


def _name(scene: str, word: str, suffix: str | None) -> Path:
    """Name the file of one scene's picture by one value of `-o`."""
    if word == "-":
        return Path(word if suffix is None else f"-.{_plain(suffix)}")
    if word.endswith(("/", os.sep)) or Path(word).is_dir():
        stem = "stdin" if scene == "-" else Path(scene).stem
        return Path(word) / f"{stem}.{_plain(suffix or 'png')}"
    if suffix is not None:
        raise InputError(f"--format {suffix}: {word} names the format itself")
    return Path(word)


def _plain(suffix: str) -> str:
    return suffix.removeprefix(".")


def _first_repeated(names: Sequence[str]) -> str:
    return next(name for place, name in enumerate(names) if name in names[:place])


def _check_different(named: Mapping[str, Sequence[Path]]) -> None:
    """Make sure that no two scenes are written to the same file."""
    owners: dict[Path, str] = {}
    for scene, paths in named.items():
        for path in paths:
            owner = owners.setdefault(path, scene)
            if owner != scene:
                raise InputError(f"{owner} and {scene} would both be written to {path}; a folder, FOLDER/, takes many")
