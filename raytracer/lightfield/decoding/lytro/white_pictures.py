"""White pictures that a Lytro camera brings along: found in folders and archives, and chosen by zoom and focus.

The first camera (F01) keeps them in packages `data.C.0`, `data.C.1`, ..., which are containers; the Illum in
`caldata-SERIAL.tar`.  Either way they are pairs of files, `MOD_0000.RAW` with the pixels and `MOD_0000.TXT` with JSON,
which may be unpacked in a folder as well.

References: D. Dansereau, LFToolbox, LFUtilUnpackLytroArchive and LFUtilProcessWhiteImages (packages, names, the choice
by serial number, zoom and focus, and that the F01's pictures are there twice, of which one is dark); C. Hahne,
PlenoptiCam, CaliFinder (the Illum's archive).
"""

import os
import re
import tarfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from raytracer.lightfield.decoding.lytro.container import MOST_JSON, Container, is_container, parse_json
from raytracer.lightfield.decoding.lytro.metadata import PhotoMetadata
from raytracer.lightfield.decoding.lytro.photo import Photo, make_photo, read_white_metadata
from raytracer.util.errors import InputError
from raytracer.util.safe_open import BrokenFileError, name_read_errors, open_regular

_METADATA_NAME = re.compile(r"(?:.*_)?MOD_[^/\\]*\.TXT", re.IGNORECASE)
_PACKAGE_NAME = re.compile(r"data\.C\.\d+", re.IGNORECASE)
_SERIAL = re.compile(r"(?:caldata|sn)-(\w+)", re.IGNORECASE)

_MOST_FILES = 1 << 17
"""Most files of a folder or an archive: cameras have some hundred."""


class _Part(NamedTuple):
    """A file, in a folder or inside another one.

    path : on the disk.
    name : inside it, or the same.
    start, size (bytes) : where it lies.
    """

    path: Path
    name: str
    start: int
    size: int

    def read(self) -> bytes:
        with open_regular(self.path) as file:
            file.seek(self.start)
            return file.read(self.size)


class WhitePicture(NamedTuple):
    """A white picture of a camera, of which the pixels are not read yet.

    name : for messages.
    metadata : of the picture.
    serial : number of the camera; empty if not known.
    """

    name: str
    metadata: PhotoMetadata
    serial: str
    pixels: _Part

    def read(self) -> Photo:
        """Read the picture; an InputError says what is wrong with it."""
        with name_read_errors(Path(self.name)):
            return make_photo(self.name, self.metadata, self.pixels.read())


def holds_white_pictures(path: str | Path) -> bool:
    """Tell if a path may hold a camera's white pictures: a folder, an archive, a package, or the pixels of one."""
    path = Path(path)
    if path.is_dir() or path.suffix.lower() in (".tar", ".raw") or _PACKAGE_NAME.fullmatch(path.name):
        return True
    if not is_container(path):
        return False
    with Container(path) as container:
        return "files" in container.contents


def check_plain_white(path: str | Path, raw: str | Path) -> None:
    """Make sure that a white picture is a plain one, as a raw picture needs that is in no container.

    Raises
    ------
    InputError : it is a folder, an archive or a container.
    """
    if is_container(path) or holds_white_pictures(path):
        raise InputError(
            f"{path}: folders, archives and containers of white pictures go with photographs of a Lytro, .lfp and "
            f".lfr, and {raw} is none"
        )


def find_white_pictures(path: str | Path) -> list[WhitePicture]:
    """Find the white pictures in a folder and those below it, in an archive or a package.

    Raises
    ------
    InputError : the path cannot be read, is damaged, or holds none.
    """
    path = Path(path)
    with name_read_errors(path):
        parts = list(_list_parts(path))
    by_name = {(part.path if part.name != str(part.path) else None, part.name.lower()): part for part in parts}
    found = []
    for (inside, name), part in by_name.items():
        if not _METADATA_NAME.fullmatch(re.split(r"[/\\]", name)[-1]):
            continue
        pixels = by_name.get((inside, name[: -len(".txt")] + ".raw"))
        if pixels is None or part.size > MOST_JSON:
            continue
        label = pixels.name if inside is None else f"{pixels.path}: {pixels.name}"
        with name_read_errors(Path(label)):
            metadata = read_white_metadata(parse_json(part.read()))
        known = _SERIAL.findall(str(part.path))
        found.append(WhitePicture(label, metadata, metadata.serial or (known[-1] if known else ""), pixels))
    if not found:
        raise InputError(f"{path}: holds no white pictures: pairs of files MOD_0000.RAW and MOD_0000.TXT")
    return found


def choose_white_picture(pictures: list[WhitePicture], photo: PhotoMetadata, path: str | Path) -> WhitePicture:
    """Choose the picture of the same camera with the nearest zoom, and of these the nearest focus.

    Of several the one with the longest exposure is taken: the F01 has dark ones besides.

    Raises
    ------
    InputError : none is of this camera and size.
    """
    same = [one for one in pictures if not (one.serial and photo.serial) or one.serial == photo.serial]
    if not same:
        others = ", ".join(sorted({one.serial for one in pictures})[:4])
        raise InputError(f"{path}: holds white pictures of {others}, and the photograph is of {photo.serial}")
    size = (photo.width, photo.height)
    fitting = [one for one in same if (one.metadata.width, one.metadata.height) == size]
    if not fitting:
        raise InputError(f"{path}: holds no white picture of {photo.width} x {photo.height} pixels")

    def rank(one: WhitePicture) -> tuple[float, float, float, str]:
        lens, wanted = one.metadata.lens, photo.lens
        zoom = abs((lens.zoom_step or 0.0) - (wanted.zoom_step or 0.0))
        focus = abs((lens.focus_step or 0.0) - (wanted.focus_step or 0.0))
        return zoom, focus, -(one.metadata.exposure or 0.0), one.name

    return min(fitting, key=rank)


def _list_parts(path: Path) -> Iterator[_Part]:
    """Yield files in a folder and below it, in archives and packages there, or in one of these."""
    if not path.is_dir():
        if path.suffix.lower() == ".raw":
            for one in (path, *path.parent.glob("*")):
                if one.stem == path.stem and one.suffix.lower() in (".raw", ".txt"):
                    yield _Part(one, str(one), 0, one.stat().st_size)
            return
        yield from _list_archive(path)
        return
    number = 0
    for folder, folders, names in os.walk(path):
        folders.sort()
        for name in sorted(names):
            number += 1
            if number > _MOST_FILES:
                raise BrokenFileError(f"holds more than {_MOST_FILES:,} files")
            one = Path(folder, name)
            if one.suffix.lower() == ".tar" or _PACKAGE_NAME.fullmatch(name):
                yield from _list_archive(one)
            elif one.is_file():
                yield _Part(one, str(one), 0, one.stat().st_size)


def _list_archive(path: Path) -> Iterator[_Part]:
    """Yield the files in an archive, or in a package."""
    if is_container(path):
        with Container(path) as container:
            files = container.contents.get("files")
            for one in files if isinstance(files, list) else ():
                name, reference = (one.get(key) if isinstance(one, dict) else None for key in ("name", "dataRef"))
                # Of a package of many files the sections lie in the others as well.
                if isinstance(name, str) and isinstance(reference, str) and reference in container.sections:
                    section = container.sections[reference]
                    yield _Part(path, name, section.start, section.size)
        return
    size = path.stat().st_size
    try:
        with open_regular(path) as file, tarfile.open(fileobj=file, mode="r:") as archive:
            for number, member in enumerate(archive):
                if number > _MOST_FILES:
                    raise BrokenFileError(f"holds more than {_MOST_FILES:,} files")
                # An archive that is cut off ends with a file that is not whole.
                if member.isreg() and not member.issparse() and 0 <= member.size <= size - member.offset_data:
                    yield _Part(path, member.name, member.offset_data, member.size)
    except (tarfile.TarError, ValueError, OverflowError, EOFError, RecursionError) as error:
        # Headers with the long name of what follows are read one inside the other, however many there are.
        raise BrokenFileError("is no archive (.tar), nor a package (data.C.0) of a camera") from error
