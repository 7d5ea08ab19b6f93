"""Read the parts of glTF files: the JSON, the binary data, and the images.

trimesh reads glTF files too, but makes zeros of data that are sparse or compressed, and believes what a file says of
its sizes.  `gltf_geometry` reads the triangles from these parts, `gltf_materials` the materials.  Where a part is cut
off, missing, or not of the kind that it should be, all raise BrokenFileError.

References: Khronos Group, "glTF 2.0 Specification", sec. 3.6 (buffers), 3.8.4 (images), 4.4 (GLB).
"""

import base64
import json
import os
import re
import struct
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import unquote

from raytracer.util.errors import format_value
from raytracer.util.safe_open import MAX_BYTES, BrokenFileError, name_read_errors, open_regular, read_regular

_MAGIC = 0x46546C67
_JSON_CHUNK, _BINARY_CHUNK = 0x4E4F534A, 0x004E4942

_SIGNATURES = {b"\x89PNG": ".png", b"\xff\xd8": ".jpg", b"RIFF": ".webp"}

# The scheme of a URI; also a drive of Windows, which no glTF file may name.
_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*:")

Json = Mapping[str, Any]


class Gltf(NamedTuple):
    """A glTF file: its JSON, and the binary chunk of a .glb."""

    header: dict[str, Any]
    binary: bytes | None


def parse(data: bytes) -> Gltf:
    """Parse a .gltf or .glb file to its parts."""
    if len(data) < 12 or struct.unpack_from("<I", data)[0] != _MAGIC:
        return Gltf(_header(data), None)
    chunks: dict[int, bytes] = {}
    start = 12
    while start + 8 <= len(data):
        length, kind = struct.unpack_from("<II", data, start)
        start += 8
        if start + length > len(data):
            raise BrokenFileError("ends early")
        chunks.setdefault(kind, data[start : start + length])
        start += length
    if _JSON_CHUNK not in chunks:
        raise BrokenFileError("ends early")
    return Gltf(_header(chunks[_JSON_CHUNK]), chunks.get(_BINARY_CHUNK))


def _header(data: bytes) -> dict[str, Any]:
    try:
        header = json.loads(data.decode("utf-8-sig"))
    except RecursionError:
        raise BrokenFileError("holds JSON that is nested too deeply") from None
    except ValueError as error:
        raise BrokenFileError(f"holds no JSON that can be read: {error}") from None
    if not isinstance(header, dict):
        raise BrokenFileError("holds JSON that is no mapping")
    return header


# ---- Entries of the JSON


def mapping(value: Any, what: str) -> Json:
    """Check that a value is a mapping."""
    if not isinstance(value, Mapping):
        raise BrokenFileError(f"has {what} that is no mapping")
    return value


def list_entry(holder: Json, key: str) -> list[Any]:
    """Get the list under a key; empty if there is none."""
    value = holder.get(key, [])
    if not isinstance(value, list):
        raise BrokenFileError(f"has {key} that are no list")
    return value


def item(header: Json, key: str, number: Any) -> Json:
    """Get item `number` of one of the file's lists."""
    items = header.get(key)
    if (
        not isinstance(items, list)
        or isinstance(number, bool)
        or not isinstance(number, int)
        or not 0 <= number < len(items)
        or not isinstance(items[number], dict)
    ):
        raise BrokenFileError(f"names item {format_value(number)} of its {key}, which is not there")
    entry: Json = items[number]
    return entry


def is_number(value: Any) -> bool:
    """Return True if a value of JSON is a finite number that a float can hold."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max


def integer_entry(holder: Json, key: str, default: int | None = None) -> int:
    """Get the integer from 0 on under a key; `default` if the key is missing and has one."""
    value = holder.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise BrokenFileError(f"has a {key} that is no integer from 0 on: {format_value(value)}")
    return value


def buffer_view(gltf: Gltf, folder: Path, number: Any, read: dict[str | None, bytes]) -> tuple[Json, memoryview]:
    """Get view `number` of a file in `folder`, and its bytes.

    read : buffers that were read before, by `_file_key`, to which this one is added.
    """
    view = item(gltf.header, "bufferViews", number)
    which = view.get("buffer")
    uri = item(gltf.header, "buffers", which).get("uri")
    key = _file_key(uri, folder)
    if key not in read:
        if uri is None and gltf.binary is None:
            raise BrokenFileError(f"has a buffer without data (number {which}, counted from 0)")
        data = gltf.binary if uri is None else _uri_bytes(uri, folder, f"buffer {which}")
        if sum(map(len, read.values())) + len(data or b"") > MAX_BYTES:
            raise BrokenFileError(f"has buffers of more than {MAX_BYTES:,} bytes")
        read[key] = data or b""
    start = integer_entry(view, "byteOffset", 0)
    end = start + integer_entry(view, "byteLength")
    if end > len(read[key]):
        raise BrokenFileError(f"ends early, before the end of view {number} of buffer {which}")
    return view, memoryview(read[key])[start:end]


# ---- Images


def read_image_bytes(path: Path, number: int) -> tuple[bytes, str]:
    """Read image `number` of a glTF file, as encoded in it or beside it, and the suffix of its format.

    Raises
    ------
    InputError : the file or the image is missing or broken.
    """
    with name_read_errors(path):
        data = image_bytes(parse(read_regular(path)), path.parent, number)
        for start, suffix in _SIGNATURES.items():
            if data.startswith(start):
                return data, suffix
        raise BrokenFileError(f"has an image of a format that is not supported (number {number}, counted from 0)")


def image_bytes(gltf: Gltf, folder: Path, number: int) -> bytes:
    """Read the encoded bytes of image `number` of a file in `folder`."""
    image = item(gltf.header, "images", number)
    if "uri" in image:
        return _uri_bytes(image["uri"], folder, f"image {number}")
    return bytes(buffer_view(gltf, folder, image.get("bufferView"), {})[1])


def _uri_bytes(uri: Any, folder: Path, what: str) -> bytes:
    """Read the data of a URI: base64 text, or a file."""
    if isinstance(uri, str) and uri.startswith("data:"):
        try:
            return base64.b64decode(uri.partition("base64,")[2], validate=True)
        except ValueError:
            raise BrokenFileError(f"has broken base64 text as {what}") from None
    path = _addressed(uri, folder)
    if path is None:
        raise BrokenFileError(f"names {format_value(uri)} as {what}, and only files are read")
    try:
        return read_regular(path)
    except FileNotFoundError:
        raise BrokenFileError(f"names {format_value(unquote(uri))} as {what}, and there is no such file") from None
    except (OSError, ValueError):
        raise BrokenFileError(f"names {format_value(unquote(uri))} as {what}, which cannot be read") from None


def _addressed(uri: Any, folder: Path) -> Path | None:
    """Return the file that a URI means, relative to `folder`; None for a URI with a scheme, or none at all."""
    return None if not isinstance(uri, str) or _SCHEME.match(uri) else folder / unquote(uri)


def _file_key(uri: Any, folder: Path) -> str | None:
    """Make a key that buffers of the same data share: the resolved file, or the URI of the data."""
    path = _addressed(uri, folder)
    try:
        return None if uri is None else str(uri) if path is None else os.path.realpath(path)
    except ValueError:
        return str(path)


def referenced_files(path: Path) -> tuple[Path, ...]:
    """List all files that reading a glTF file may open besides, buffers and images, whether they exist or not.

    A broken or missing glTF file names none; reading it will raise an error.
    """
    try:
        header = _header_of(path)
    except (OSError, BrokenFileError):
        return ()
    items = [entry for key in ("buffers", "images") if isinstance(header.get(key), list) for entry in header[key]]
    paths = (_addressed(entry.get("uri"), path.parent) for entry in items if isinstance(entry, dict))
    return tuple(dict.fromkeys(file for file in paths if file is not None))


def _header_of(path: Path) -> dict[str, Any]:
    """Read the JSON of a glTF file, without its binary chunk."""
    with open_regular(path) as file:
        start = file.read(20)
        if len(start) == 20 and struct.unpack_from("<I", start)[0] == _MAGIC:
            length, kind = struct.unpack_from("<II", start, 12)
            if kind == _JSON_CHUNK:
                return _header(file.read(min(length, os.fstat(file.fileno()).st_size)))
        return parse(start + file.read()).header
