"""Lenses that other programs have written: read as ours, and written as files of ours."""

import dataclasses
import re
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

from raytracer.dump import plain, yaml_text
from raytracer.errors import SceneError
from raytracer.lenses.importing import pbrt, zemax
from raytracer.lenses.importing.draft import AS_IT_IS, Choices, Draft
from raytracer.lenses.importing.zemax import checked_glasses
from raytracer.lenses.lens import Lens, Reading
from raytracer.lenses.prescription import LensSpec
from raytracer.untrusted import opened

MAX_BYTES = 16 * 2**20

_CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f]")

_READERS: Mapping[str, Callable[[str, str, Choices], Draft]] = {".dat": pbrt.draft, ".zmx": zemax.draft}

SUFFIXES = tuple(_READERS)
"""Suffixes of the files that `imported` reads, in lower case."""


class Imported(NamedTuple):
    """The lens of another program's file, and how that was read, where it leaves open what it means."""

    spec: LensSpec
    reading: Reading | None

    def lens(self) -> Lens:
        """Make the lens, which knows how it was read."""
        return dataclasses.replace(self.spec.lens(), reading=self.reading)


def imported(path: Path, choices: Choices = AS_IT_IS) -> Imported:
    """The lens of a file of pbrt (`.dat`) or Zemax (`.zmx`).

    choices : what the user says of it.

    Raises
    ------
    SceneError : it cannot be read, may mean two lenses, or holds what is not supported; it names file and line.
    """
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise SceneError(
            f"is no lens of another program: files that end in {' or '.join(SUFFIXES)} are", file=str(path)
        )
    # What a terminal would act upon has no meaning in a lens, whose name is printed.
    draft = reader(_CONTROL.sub(" ", _text(path)), str(path), choices)
    return Imported(draft.spec(), draft.reading)


def as_yaml(spec: LensSpec) -> str:
    """The lens as the text of a lens file, from which an equal one is read."""
    return yaml_text(plain(spec))


def _text(path: Path) -> str:
    """A file's text: UTF-16 if it begins as that does, or has zeros, UTF-8, or else Latin-1."""
    try:
        with opened(path, sys.maxsize) as stream:
            data = stream.read(MAX_BYTES + 1)
    except FileNotFoundError:
        raise SceneError("no such file", file=str(path)) from None
    except IsADirectoryError:
        raise SceneError("is a folder, not a lens file", file=str(path)) from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise SceneError(f"cannot be read: {reason.lower()}", file=str(path)) from None
    if len(data) > MAX_BYTES:
        raise SceneError(f"is larger than {MAX_BYTES // 2**20} MB, the limit for a lens file", file=str(path))
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data.decode("utf-16", errors="replace")
    if b"\0" in data:
        return data.decode("utf-16-le" if data[1:2] == b"\0" else "utf-16-be", errors="replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


__all__ = ["SUFFIXES", "Choices", "Imported", "as_yaml", "checked_glasses", "imported"]
