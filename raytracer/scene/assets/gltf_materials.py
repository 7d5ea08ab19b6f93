"""Materials and images of glTF files, as a scene would write them.

trimesh reads glTF files too, but drops what it cannot read of materials without a word, rounds colours to bytes, makes
zeros of data that are sparse or compressed, and believes what a file says of its sizes.  Materials are small and
declarative, and are read from the file's JSON here; `gltf_geometry` reads the triangles.

References: Khronos Group, "glTF 2.0 Specification", sec. 3.9 (materials), 3.8.2 (textures), 4.4 (GLB); the extensions
KHR_materials_emissive_strength, KHR_materials_ior, KHR_materials_transmission, KHR_texture_transform, EXT_texture_webp.
"""

import base64
import contextlib
import json
import math
import os
import re
import struct
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import unquote

from raytracer.errors import InputError, shown
from raytracer.film.decoding import BrokenImageError, is_transparent
from raytracer.untrusted import MAX_BYTES, contents, opened

_MAGIC = 0x46546C67
_JSON_CHUNK, _BINARY_CHUNK = 0x4E4F534A, 0x004E4942

_SIGNATURES = {b"\x89PNG": ".png", b"\xff\xd8": ".jpg", b"RIFF": ".webp"}

# Of an address on the net; of a drive of Windows, too, which no glTF file is to name.
_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*:")

_WRAPS = {"33071": "clamp", "33648": "mirror"}

MAX_IMAGES = 4096
"""Of a file; the file is read once for each that is used."""

Json = Mapping[str, Any]


class BrokenGltfError(ValueError):
    """A glTF file whose materials cannot be read; its text completes the sentence "FILE: ..."."""


class Gltf(NamedTuple):
    """A glTF file: its JSON, and the binary chunk of a .glb."""

    header: dict[str, Any]
    binary: bytes | None


def parse(data: bytes) -> Gltf:
    """The parts of a .gltf or .glb file.

    Raises
    ------
    BrokenGltfError : the file is cut off, or its JSON is none.
    """
    if len(data) < 12 or struct.unpack_from("<I", data)[0] != _MAGIC:
        return Gltf(_header(data), None)
    chunks: dict[int, bytes] = {}
    start = 12
    while start + 8 <= len(data):
        length, kind = struct.unpack_from("<II", data, start)
        start += 8
        if start + length > len(data):
            raise BrokenGltfError("ends early")
        chunks.setdefault(kind, data[start : start + length])
        start += length
    if _JSON_CHUNK not in chunks:
        raise BrokenGltfError("ends early")
    return Gltf(_header(chunks[_JSON_CHUNK]), chunks.get(_BINARY_CHUNK))


def _header(data: bytes) -> dict[str, Any]:
    try:
        found = json.loads(data.decode("utf-8-sig"))
    except RecursionError:
        raise BrokenGltfError("holds JSON that is nested too deeply") from None
    except ValueError as error:
        raise BrokenGltfError(f"holds no JSON that can be read: {error}") from None
    if not isinstance(found, dict):
        raise BrokenGltfError("holds JSON that is no mapping")
    return found


# ---- What parts of a file say of others


def mapping(value: Any, what: str) -> Json:
    """`value`, which must be a mapping.

    Raises
    ------
    BrokenGltfError : it is none.
    """
    if not isinstance(value, Mapping):
        raise BrokenGltfError(f"has {what} that is no mapping")
    return value


def listed(holder: Json, key: str) -> list[Any]:
    """The list under a key, empty where there is none.

    Raises
    ------
    BrokenGltfError : it is no list.
    """
    value = holder.get(key, [])
    if not isinstance(value, list):
        raise BrokenGltfError(f"has {key} that are no list")
    return value


def item(header: Json, key: str, number: Any) -> Json:
    """Item `number` of one of the file's lists.

    Raises
    ------
    BrokenGltfError : it is not there, or no mapping.
    """
    items = header.get(key)
    if (
        not isinstance(items, list)
        or isinstance(number, bool)
        or not isinstance(number, int)
        or not 0 <= number < len(items)
        or not isinstance(items[number], dict)
    ):
        raise BrokenGltfError(f"names item {shown(number)} of its {key}, which is not there")
    found: Json = items[number]
    return found


def is_number(value: Any) -> bool:
    """Whether a value is a finite number, as JSON has them, that a float can hold."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max


def whole_number(holder: Json, key: str, default: int | None = None) -> int:
    """The number under a key, a whole one and not negative; `default` where there is none, if one may be missing.

    Raises
    ------
    BrokenGltfError : it is missing, or something else.
    """
    value = holder.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise BrokenGltfError(f"has a {key} that is no whole number: {shown(value)}")
    return value


def buffer_view(gltf: Gltf, folder: Path, number: Any, read: dict[str | None, bytes]) -> tuple[Json, memoryview]:
    """View `number` of a file in `folder`, and the bytes that it shows.

    read : buffers that were read before, by what they are of, to which this one is added.

    Raises
    ------
    BrokenGltfError : the view or its buffer is missing, or does not hold what it says.
    """
    view = item(gltf.header, "bufferViews", number)
    which = view.get("buffer")
    uri = item(gltf.header, "buffers", which).get("uri")
    key = _file_key(uri, folder)
    if key not in read:
        if uri is None and gltf.binary is None:
            raise BrokenGltfError(f"has a buffer without data (number {which}, counted from 0)")
        data = gltf.binary if uri is None else _uri_bytes(uri, folder, f"buffer {which}")
        if sum(map(len, read.values())) + len(data or b"") > MAX_BYTES:
            raise BrokenGltfError(f"has buffers of more than {MAX_BYTES:,} bytes")
        read[key] = data or b""
    start = whole_number(view, "byteOffset", 0)
    end = start + whole_number(view, "byteLength")
    if end > len(read[key]):
        raise BrokenGltfError(f"ends early, before the end of view {number} of buffer {which}")
    return view, memoryview(read[key])[start:end]


# ---- Images


def read_image_bytes(path: Path, number: int) -> tuple[bytes, str]:
    """Image `number` of a glTF file, as encoded in it or beside it, and the suffix of its format.

    Raises
    ------
    InputError : the file or the image is missing or broken.
    """
    with _named(path):
        data = _image_bytes(parse(contents(path)), path.parent, number)
        for start, suffix in _SIGNATURES.items():
            if data.startswith(start):
                return data, suffix
        raise BrokenGltfError(f"has an image of a format that is not supported (number {number}, counted from 0)")


@contextlib.contextmanager
def _named(path: Path) -> Iterator[None]:
    """Tell errors about a file with its name."""
    try:
        yield
    except BrokenGltfError as error:
        raise InputError(f"{path}: {error}") from error
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error


def _image_bytes(gltf: Gltf, folder: Path, number: int) -> bytes:
    image = item(gltf.header, "images", number)
    if "uri" in image:
        return _uri_bytes(image["uri"], folder, f"image {number}")
    return bytes(buffer_view(gltf, folder, image.get("bufferView"), {})[1])


def _uri_bytes(uri: Any, folder: Path, what: str) -> bytes:
    """What an address holds: base64 text, or a file."""
    if isinstance(uri, str) and uri.startswith("data:"):
        try:
            return base64.b64decode(uri.partition("base64,")[2], validate=True)
        except ValueError:
            raise BrokenGltfError(f"has broken base64 text as {what}") from None
    path = _addressed(uri, folder)
    if path is None:
        raise BrokenGltfError(f"names {shown(uri)} as {what}, and only files are read")
    try:
        return contents(path)
    except FileNotFoundError:
        raise BrokenGltfError(f"names {shown(unquote(uri))} as {what}, and there is no such file") from None
    except (OSError, ValueError):
        raise BrokenGltfError(f"names {shown(unquote(uri))} as {what}, which cannot be read") from None


def _addressed(uri: Any, folder: Path) -> Path | None:
    """The file that an address means, relative to `folder`; None for an address on the net, or none at all."""
    return None if not isinstance(uri, str) or _SCHEME.match(uri) else folder / unquote(uri)


def _file_key(uri: Any, folder: Path) -> str | None:
    """What buffers that hold the same have in common: the file, however it is spelt, or the text of the data."""
    path = _addressed(uri, folder)
    try:
        return None if uri is None else str(uri) if path is None else os.path.realpath(path)
    except ValueError:
        return str(path)


def named(path: Path) -> tuple[Path, ...]:
    """All files that reading a glTF file may open besides, buffers and images, be they there or not.

    Nothing is said of a file that is broken or missing; whoever reads it will.
    """
    try:
        header = _header_of(path)
    except (OSError, BrokenGltfError):
        return ()
    items = [entry for key in ("buffers", "images") if isinstance(header.get(key), list) for entry in header[key]]
    found = (_addressed(entry.get("uri"), path.parent) for entry in items if isinstance(entry, dict))
    return tuple(dict.fromkeys(file for file in found if file is not None))


def companions(path: Path) -> tuple[Path, ...]:
    """Those of the files `named` that are there."""
    found = []
    for file in named(path):
        with contextlib.suppress(OSError, ValueError):
            if file.is_file():
                found.append(file)
    return tuple(found)


def _header_of(path: Path) -> dict[str, Any]:
    """The JSON of a glTF file, without reading its binary chunk."""
    with opened(path) as file:
        start = file.read(20)
        if len(start) == 20 and struct.unpack_from("<I", start)[0] == _MAGIC:
            length, kind = struct.unpack_from("<II", start, 12)
            if kind == _JSON_CHUNK:
                return _header(file.read(min(length, os.fstat(file.fileno()).st_size)))
        return parse(start + file.read()).header


# ---- Materials


def read_materials(path: Path, name: str) -> tuple[dict[str, Any], ...]:
    """The materials of a glTF file and, last, glTF's default, each as a mapping that a scene could hold.

    Images are named by `name`, which is what the scene calls the file, and their number in it: `name#number`.
    Occlusion, vertex colours and further extensions are left out: a path tracer makes the first by itself.

    Raises
    ------
    InputError : the file cannot be read, or a material in it is not as glTF says.
    """
    with _named(path):
        gltf = parse(contents(path))
        materials = listed(gltf.header, "materials")
        if len(listed(gltf.header, "images")) > MAX_IMAGES:
            raise BrokenGltfError(f"has more than {MAX_IMAGES:,} images")
        reader = _Materials(gltf, path.parent, name)
        return tuple(reader.material(each, number) for number, each in enumerate([*materials, {}]))


class _Materials:
    """Reads the materials of one file."""

    def __init__(self, gltf: Gltf, folder: Path, file: str) -> None:
        self._gltf = gltf
        self._folder = folder
        self._file = file
        self._name = ""
        self._transparent: dict[int, bool] = {}

    def material(self, material: Any, number: int) -> dict[str, Any]:
        """Material `number`: principled, with holes if its alpha means any."""
        self._name = f"material {number}"
        material = self._mapping(material, "")
        extensions = self._mapping(material.get("extensions", {}), "extensions")
        metallic_roughness = self._mapping(material.get("pbrMetallicRoughness", {}), "pbrMetallicRoughness")

        # What the surface is made of.
        *base, alpha = self._numbers(metallic_roughness, "baseColorFactor", (1.0, 1.0, 1.0, 1.0))
        coating = metallic_roughness.get("metallicRoughnessTexture")
        result: dict[str, Any] = {
            "type": "principled",
            "base_color": self._textured(metallic_roughness.get("baseColorTexture"), base),
            "metallic": self._textured(coating, self._number(metallic_roughness, "metallicFactor", 1.0), "b"),
            "roughness": self._textured(coating, self._number(metallic_roughness, "roughnessFactor", 1.0), "g"),
            "two_sided": bool(material.get("doubleSided", False)),
        }
        optics = self._mapping(extensions.get("KHR_materials_ior", {}), "KHR_materials_ior")
        result["ior"] = self._number(optics, "ior", 1.5)
        clear = self._mapping(extensions.get("KHR_materials_transmission", {}), "KHR_materials_transmission")
        if transmission := self._number(clear, "transmissionFactor", 0.0):
            result["transmission"] = self._textured(clear.get("transmissionTexture"), transmission, "r")

        # What it gives.
        emissive = self._numbers(material, "emissiveFactor", (0.0, 0.0, 0.0))
        strength = self._mapping(
            extensions.get("KHR_materials_emissive_strength", {}), "KHR_materials_emissive_strength"
        )
        if any(emissive):
            factor = self._number(strength, "emissiveStrength", 1.0)
            result["emission"] = self._textured(material.get("emissiveTexture"), [factor * value for value in emissive])

        # Its relief, and its holes.
        if "normalTexture" in material:
            relief = self._mapping(material["normalTexture"], "normalTexture")
            scale = self._number(relief, "scale", 1.0)
            result["normal_map"] = self._image(relief)
            if scale != 1.0:
                result["normal_scale"] = scale
        mode = material.get("alphaMode", "OPAQUE")
        if mode == "OPAQUE":
            return result
        if mode not in ("MASK", "BLEND"):
            raise BrokenGltfError(f"has {self._name} with the alphaMode {shown(mode)}")
        texture = metallic_roughness.get("baseColorTexture")
        cut: dict[str, Any] = {
            "type": "cutout",
            "material": result,
            "opacity": self._textured(texture if self._has_alpha(texture) else None, alpha, "a"),
        }
        if mode == "MASK":
            cut["threshold"] = self._number(material, "alphaCutoff", 0.5)
        return cut

    def _textured(self, texture: Any, factor: Any, channel: str | None = None) -> Any:
        """A factor, or the texture that it multiplies."""
        if texture is None or not any(factor if isinstance(factor, Sequence) else (factor,)):
            return factor
        result = self._image(self._mapping(texture, "a texture"))
        if channel is not None:
            result["channel"] = channel
        if any(value != 1.0 for value in (factor if isinstance(factor, Sequence) else (factor,))):
            result["factor"] = factor
        return result

    def _has_alpha(self, texture: Any) -> bool:
        """Whether a texture's image tells how opaque it is; what cannot be read is left for later to complain about."""
        if texture is None:
            return False
        try:
            number = int(self._image(texture)["file"].rpartition("#")[2])
            if number not in self._transparent:
                self._transparent[number] = is_transparent(_image_bytes(self._gltf, self._folder, number))
            return self._transparent[number]
        except (BrokenGltfError, BrokenImageError):
            return True

    def _image(self, reference: Json) -> dict[str, Any]:
        """The image texture that a material refers to."""
        extensions = self._mapping(reference.get("extensions", {}), "extensions")
        transform = self._mapping(extensions.get("KHR_texture_transform", {}), "KHR_texture_transform")
        if transform.get("texCoord", reference.get("texCoord", 0)) != 0:
            raise BrokenGltfError(f"has {self._name} with a second set of texture coordinates, which is not supported")
        texture = item(self._gltf.header, "textures", reference.get("index"))
        webp = self._mapping(texture.get("extensions", {}), "extensions").get("EXT_texture_webp", {})
        source = self._mapping(webp, "EXT_texture_webp").get("source", texture.get("source"))
        if source is None:
            raise BrokenGltfError(f"has {self._name} with a texture of a format that is not supported")
        item(self._gltf.header, "images", source)
        result: dict[str, Any] = {"type": "image", "file": f"{self._file}#{source}"}
        if "sampler" in texture:
            sampler = item(self._gltf.header, "samplers", texture["sampler"])
            wrap = [_WRAPS.get(str(sampler.get(key)), "repeat") for key in ("wrapS", "wrapT")]
            if wrap != ["repeat", "repeat"]:
                result["wrap"] = wrap[0] if wrap[0] == wrap[1] else wrap
        if transform:
            result.update(self._transform(transform))
        return result

    def _transform(self, transform: Json) -> dict[str, Any]:
        """KHR_texture_transform, whose v runs down, for coordinates whose v runs up."""
        offset = self._numbers(transform, "offset", (0.0, 0.0))
        scale = self._numbers(transform, "scale", (1.0, 1.0))
        angle = self._number(transform, "rotation", 0.0)
        return {
            "scale": scale,
            "rotation": math.degrees(angle),
            "offset": [
                offset[0] + scale[1] * math.sin(angle),
                1.0 - offset[1] - scale[1] * math.cos(angle),
            ],
        }

    def _mapping(self, value: Any, what: str) -> Json:
        return mapping(value, f"{self._name} with {what or 'a value'}")

    def _number(self, holder: Json, key: str, default: float) -> float:
        value = holder.get(key, default)
        if not is_number(value):
            raise BrokenGltfError(f"has {self._name} with a {key} that is no number")
        return float(value)

    def _numbers(self, holder: Json, key: str, default: tuple[float, ...]) -> list[float]:
        value = holder.get(key, default)
        if not isinstance(value, list | tuple) or len(value) != len(default):
            raise BrokenGltfError(f"has {self._name} with a {key} that is not {len(default)} numbers")
        return [self._number({key: entry}, key, 0.0) for entry in value]
