"""Importers of lens files of other programs, one module a format."""

import dataclasses
import re
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

from raytracer.optics.lens_system.importers import pbrt, zemax
from raytracer.optics.lens_system.importers.draft import NO_CHOICES, Choices, Draft
from raytracer.optics.lens_system.importers.zemax import parse_glasses
from raytracer.optics.lens_system.lens import FileInterpretation, Lens
from raytracer.optics.lens_system.prescription import LensSpec
from raytracer.optics.to_yaml import spec_to_plain, to_yaml
from raytracer.util.errors import SceneError
from raytracer.util.safe_open import open_regular

MAX_BYTES = 16 * 2**20

_CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f]")

_READERS: Mapping[str, Callable[[str, str, Choices], Draft]] = {".dat": pbrt.draft, ".zmx": zemax.draft}

SUFFIXES = tuple(_READERS)
"""Suffixes of the files that `import_lens` reads, in lower case."""


class Imported(NamedTuple):
    """The lens of another program's file.

    spec : the lens, checked.
    reading : how the file was interpreted, if it is ambiguous.
    """

    spec: LensSpec
    reading: FileInterpretation | None

    def lens(self) -> Lens:
        """Make the lens, with the interpretation of its file."""
        return dataclasses.replace(self.spec.lens(), reading=self.reading)


def import_lens(path: Path, choices: Choices = NO_CHOICES) -> Imported:
    """Import a lens file of pbrt (`.dat`) or Zemax (`.zmx`).

    choices : the user's settings of the import.

    Raises
    ------
    SceneError : the file cannot be read, is ambiguous, or holds what is not supported; it names file and line.
    """
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise SceneError(
            f"is no lens of another program: files that end in {' or '.join(SUFFIXES)} are", file=str(path)
        )
    # Control characters have no meaning in a lens, and its name is printed on terminals.
    draft = reader(_CONTROL.sub(" ", _read_text(path)), str(path), choices)
    return Imported(draft.spec(), draft.reading)


def as_yaml(spec: LensSpec) -> str:
    """Write a lens as a lens file, from which an equal one is read."""
    return to_yaml(spec_to_plain(spec))


def _read_text(path: Path) -> str:
    """Read a file's text: UTF-16 if it has its byte order mark or zeros, UTF-8, or else Latin-1."""
    try:
        with open_regular(path, sys.maxsize) as stream:
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


__all__ = ["SUFFIXES", "Choices", "Imported", "as_yaml", "import_lens", "parse_glasses"]
