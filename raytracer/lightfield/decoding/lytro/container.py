"""Lytro's container (.lfp, .lfr, data.C.0): sections of bytes by name, and a JSON object that says what they are.

A file begins with a header of 16 bytes: 89 4C 46 50 0D 0A 1A 0A ("LFP"), a version and a length of 0.  Sections follow,
each from a multiple of 16 bytes on: eight bytes as above with the letter M (the contents, JSON) or C (anything) in
place of P, a version, the length of the data, big-endian like all of these, and 80 bytes with the name, which is the
SHA-1 of the data; then the data, and zeros.

References: N. Patel, lfptools, README ("Tools for working with Lytro files"); J. Kucera (miloush), "The File Format",
http://optics.miloush.net/lytro/TheFileFormat.aspx; D. Dansereau, LFToolbox, LFReadLFP.
"""

import json
import math
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from raytracer.util.errors import InputError
from raytracer.util.safe_open import BrokenFileError, name_read_errors, open_regular

MAGIC = b"\x89LFP\r\n\x1a\n"
"""First bytes of a container."""

SUFFIXES = (".lfp", ".lfr")
"""Suffixes of containers of photographs."""

ALIGNMENT = 16
"""Sections begin at multiples of so many bytes."""

_SECTION_BEGIN, _SECTION_MIDDLE = b"\x89LF", b"\r\n\x1a\n"
_CONTENTS = "M"
"""Letter of the section that holds the contents."""

_HEADER = struct.Struct(">8sII")
_NAME_BYTES = 80

_MOST_SECTIONS = 1 << 16
"""Most sections of a file: those of cameras have up to some hundred."""

MOST_JSON = 1 << 22
"""Most bytes of metadata: a photograph's are 10 KB, the contents of a calibration package 200 KB."""


class Section(NamedTuple):
    """A section of a container.

    letter : M of the contents, C of others.
    start, size (bytes) : where its data lies.
    """

    letter: str
    start: int
    size: int


class Container:
    """An open container, to use in a `with` block: its sections are read one by one.

    path : of the file.
    sections : by name; the first of a name counts.
    contents : JSON object of the section that says what the others are.

    Raises
    ------
    InputError : the file cannot be read, is no container, is cut off, or has no contents.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        with name_read_errors(self.path):
            self._file = open_regular(self.path)
            try:
                self._size = self._file.seek(0, 2)
                listed = list(_list_sections(self._file, self._size))
                self.sections = dict(reversed(listed))
                named = next((name for name, section in listed if section.letter == _CONTENTS), None)
                if named is None:
                    raise BrokenFileError("is a container without contents")
                self.contents = self._parse(named)
            except BaseException:
                self._file.close()
                raise

    def __enter__(self) -> "Container":
        return self

    def __exit__(self, *exception: object) -> None:
        self._file.close()

    def read(self, name: str) -> bytes:
        """Read the data of a section; an InputError says that there is none of this name."""
        section = self.sections.get(name)
        if section is None:
            raise InputError(f"{self.path}: has no section {name!r:.100}, which its contents name")
        with name_read_errors(self.path):
            self._file.seek(section.start)
            return self._file.read(section.size)

    def read_json(self, name: str) -> dict[str, Any]:
        """Read the JSON object in a section; an InputError says that it holds none."""
        with name_read_errors(self.path):
            return self._parse(name)

    def _parse(self, name: str) -> dict[str, Any]:
        section = self.sections.get(name)
        if section is not None and section.size > MOST_JSON:
            raise BrokenFileError(f"has metadata of {section.size:,} bytes, and at most {MOST_JSON:,} are read")
        return parse_json(self.read(name))


def is_container(path: str | Path) -> bool:
    """Tell if a file is named as a container, or begins as one; False where it cannot be read."""
    if Path(path).suffix.lower() in SUFFIXES:
        return True
    try:
        with open_regular(Path(path)) as file:
            return file.read(len(MAGIC)) == MAGIC
    except OSError:
        return False


def parse_json(data: bytes) -> dict[str, Any]:
    """Parse the JSON object with which bytes begin; what follows it, as in some of the cameras' files, is left out.

    Raises
    ------
    BrokenFileError : there is no object, or a number that is none, or too large for one.
    """
    decoder = json.JSONDecoder(parse_constant=_refuse, parse_float=_parse_finite)
    try:
        values, _ = decoder.raw_decode(data.decode("utf-8-sig").lstrip())
    except (ValueError, RecursionError) as error:
        raise BrokenFileError("holds metadata that are no JSON") from error
    if not isinstance(values, dict):
        raise BrokenFileError("holds metadata that are no JSON object")
    return values


def _refuse(constant: str) -> float:
    raise ValueError(f"{constant} is no number")


def _parse_finite(text: str) -> float:
    # Of 1e999, which JSON allows, Python makes an infinity, which JSON has no word for.
    number = float(text)
    return number if math.isfinite(number) else _refuse(text)


def _list_sections(file: BinaryIO, size: int) -> Iterator[tuple[str, Section]]:
    """Yield name and place of each section, of which only headers are read."""
    file.seek(0)
    head = file.read(_HEADER.size)
    if not head.startswith(MAGIC):
        raise BrokenFileError("is no container of Lytro's (.lfp, .lfr)")
    if len(head) < _HEADER.size:
        raise BrokenFileError("is cut off")
    at = _HEADER.size + _HEADER.unpack(head)[2]
    for number in range(1, _MOST_SECTIONS + 1):
        at = _next_section(file, at)
        file.seek(at)
        head = file.read(_HEADER.size + _NAME_BYTES)
        if not head.strip(b"\0"):
            return
        if len(head) < _HEADER.size + _NAME_BYTES:
            raise BrokenFileError(f"is cut off in its section {number}")
        begin, _, length = _HEADER.unpack_from(head)
        if begin[:3] != _SECTION_BEGIN or begin[4:] != _SECTION_MIDDLE:
            raise BrokenFileError(f"is damaged: no section begins at byte {at:,}")
        start = at + len(head)
        if length > size - start:
            raise BrokenFileError(
                f"is cut off: its section {number} claims {length:,} bytes, and {size - start:,} are left"
            )
        name = head[_HEADER.size :].split(b"\0")[0].decode("ascii", "replace")
        yield name, Section(chr(begin[3]), start, length)
        at = start + length
    raise BrokenFileError(f"has more than {_MOST_SECTIONS:,} sections")


def _next_section(file: BinaryIO, end: int) -> int:
    """Find where the next section begins: at once, or at the next multiple of 16 bytes."""
    file.seek(end)
    if file.read(len(_SECTION_BEGIN)) == _SECTION_BEGIN:
        return end
    return ALIGNMENT * math.ceil(end / ALIGNMENT)
