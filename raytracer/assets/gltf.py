"""Materials and images of glTF files, as a scene would write them.

trimesh reads the geometry; of the materials it drops what it cannot read without a word, and rounds colours to bytes.
They are small and declarative, so they are read from the file's JSON here.

References: Khronos Group, "glTF 2.0 Specification", sec. 3.9 (materials), 3.8.2 (textures), 4.4 (GLB); the extensions
KHR_materials_emissive_strength, KHR_materials_ior, KHR_materials_transmission, KHR_texture_transform, EXT_texture_webp.
"""

import base64
import binascii
import contextlib
import io
import json
import math
import struct
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple
from urllib.parse import unquote

from raytracer.errors import InputError, shown

_MAGIC = 0x46546C67
_JSON_CHUNK, _BINARY_CHUNK = 0x4E4F534A, 0x004E4942

_SIGNATURES = {b"\x89PNG": ".png", b"\xff\xd8": ".jpg", b"RIFF": ".webp"}

_WRAPS = {10497: "repeat", 33071: "clamp", 33648: "mirror"}

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
    except ValueError as error:
        raise BrokenGltfError(f"holds no JSON that can be read: {error}") from None
    if not isinstance(found, dict):
        raise BrokenGltfError("holds JSON that is no mapping")
    return found


def with_numbered_materials(gltf: Gltf) -> bytes:
    """The file with each material reduced to its number as name, and without images: what trimesh is to read.

    A primitive without a material gets the number behind the last, which stands for glTF's default.
    """
    header = json.loads(json.dumps(gltf.header))
    count = len(header.get("materials", ()))
    header["materials"] = [{"name": str(number)} for number in range(count + 1)]
    for key in ("images", "textures", "samplers"):
        header.pop(key, None)
    for buffer in header.get("buffers", ()):
        # trimesh takes an address for a name.
        if not str(buffer.get("uri", "data:")).startswith("data:"):
            buffer["uri"] = unquote(str(buffer["uri"]))
    for mesh in header.get("meshes", ()):
        for primitive in mesh["primitives"]:
            primitive.setdefault("material", count)
    text = json.dumps(header).encode()
    if gltf.binary is None:
        return text
    chunks = b"".join(
        struct.pack("<II", len(chunk), kind) + chunk
        for kind, chunk in ((_JSON_CHUNK, text + b" " * (-len(text) % 4)), (_BINARY_CHUNK, gltf.binary))
    )
    return struct.pack("<III", _MAGIC, 2, 12 + len(chunks)) + chunks


# ---- Images


def read_image_bytes(path: Path, number: int) -> tuple[bytes, str]:
    """Image `number` of a glTF file, as encoded in it or beside it, and the suffix of its format.

    Raises
    ------
    InputError : the file or the image is missing or broken.
    """
    with _named(path):
        data = _image_bytes(parse(path.read_bytes()), path.parent, number)
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
    image = _item(gltf.header, "images", number)
    if "uri" in image:
        return _uri_bytes(str(image["uri"]), folder, f"image {number}")
    view = _item(gltf.header, "bufferViews", image.get("bufferView"))
    buffer = _item(gltf.header, "buffers", view.get("buffer"))
    if "uri" in buffer:
        data = _uri_bytes(str(buffer["uri"]), folder, f"buffer {view['buffer']}")
    elif gltf.binary is not None:
        data = gltf.binary
    else:
        raise BrokenGltfError(f"has a buffer without data (number {view['buffer']}, counted from 0)")
    start = int(view.get("byteOffset", 0))
    end = start + int(view.get("byteLength", 0))
    if end > len(data):
        raise BrokenGltfError(f"ends early, before the end of image {number}")
    return data[start:end]


def _uri_bytes(uri: str, folder: Path, what: str) -> bytes:
    """What an address holds: base64 text, or a file beside the glTF file."""
    if uri.startswith("data:"):
        try:
            return base64.b64decode(uri.partition("base64,")[2], validate=True)
        except binascii.Error:
            raise BrokenGltfError(f"has broken base64 text as {what}") from None
    path = folder / unquote(uri)
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise BrokenGltfError(f"names {shown(unquote(uri))} as {what}, and there is no such file") from None
    except (OSError, ValueError):
        raise BrokenGltfError(f"names {shown(unquote(uri))} as {what}, which cannot be read") from None


def companions(path: Path) -> tuple[Path, ...]:
    """The files that a glTF file names and that are there: buffers, and images beside it.

    Nothing is said of a file that is broken or missing; whoever reads it will.
    """
    try:
        header = _header_of(path)
    except (OSError, BrokenGltfError):
        return ()
    found: dict[Path, None] = {}
    for key in ("buffers", "images"):
        items = header.get(key, [])
        for item in items if isinstance(items, list) else ():
            uri = item.get("uri") if isinstance(item, dict) else None
            if not isinstance(uri, str) or uri.startswith("data:"):
                continue
            # trimesh seeks what is not there beside the file.
            for name in (unquote(uri), PurePosixPath(unquote(uri)).name):
                with contextlib.suppress(OSError, ValueError):
                    if (path.parent / name).is_file():
                        found.setdefault(path.parent / name)
    return tuple(found)


def _header_of(path: Path) -> dict[str, Any]:
    """The JSON of a glTF file, without reading its binary chunk."""
    with path.open("rb") as file:
        start = file.read(20)
        if len(start) == 20 and struct.unpack_from("<I", start)[0] == _MAGIC:
            length, kind = struct.unpack_from("<II", start, 12)
            if kind == _JSON_CHUNK:
                return _header(file.read(length))
        return parse(start + file.read()).header


def _item(header: Json, key: str, number: Any) -> Json:
    """Item `number` of one of the file's lists."""
    items = header.get(key)
    if (
        not isinstance(items, list)
        or not isinstance(number, int)
        or not 0 <= number < len(items)
        or not isinstance(items[number], dict)
    ):
        raise BrokenGltfError(f"names item {shown(number)} of its {key}, which is not there")
    found: Json = items[number]
    return found


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
        gltf = parse(path.read_bytes())
        materials = gltf.header.get("materials", [])
        if not isinstance(materials, list):
            raise BrokenGltfError("has materials that are no list")
        reader = _Materials(gltf, path.parent, name)
        return tuple(reader.material(item, number) for number, item in enumerate([*materials, {}]))


class _Materials:
    """Reads the materials of one file."""

    def __init__(self, gltf: Gltf, folder: Path, file: str) -> None:
        self._gltf = gltf
        self._folder = folder
        self._file = file
        self._name = ""

    def material(self, item: Any, number: int) -> dict[str, Any]:
        """Material `number`: principled, with holes if its alpha means any."""
        self._name = f"material {number}"
        item = self._mapping(item, "")
        extensions = self._mapping(item.get("extensions", {}), "extensions")
        metallic_roughness = self._mapping(item.get("pbrMetallicRoughness", {}), "pbrMetallicRoughness")

        # What the surface is made of.
        *base, alpha = self._numbers(metallic_roughness, "baseColorFactor", (1.0, 1.0, 1.0, 1.0))
        coating = metallic_roughness.get("metallicRoughnessTexture")
        result: dict[str, Any] = {
            "type": "principled",
            "base_color": self._textured(metallic_roughness.get("baseColorTexture"), base),
            "metallic": self._textured(coating, self._number(metallic_roughness, "metallicFactor", 1.0), "b"),
            "roughness": self._textured(coating, self._number(metallic_roughness, "roughnessFactor", 1.0), "g"),
            "two_sided": bool(item.get("doubleSided", False)),
        }
        optics = self._mapping(extensions.get("KHR_materials_ior", {}), "KHR_materials_ior")
        result["ior"] = self._number(optics, "ior", 1.5)
        clear = self._mapping(extensions.get("KHR_materials_transmission", {}), "KHR_materials_transmission")
        if transmission := self._number(clear, "transmissionFactor", 0.0):
            result["transmission"] = self._textured(clear.get("transmissionTexture"), transmission, "r")

        # What it gives.
        emissive = self._numbers(item, "emissiveFactor", (0.0, 0.0, 0.0))
        strength = self._mapping(
            extensions.get("KHR_materials_emissive_strength", {}), "KHR_materials_emissive_strength"
        )
        if any(emissive):
            factor = self._number(strength, "emissiveStrength", 1.0)
            result["emission"] = self._textured(item.get("emissiveTexture"), [factor * value for value in emissive])

        # Its relief, and its holes.
        if "normalTexture" in item:
            relief = self._mapping(item["normalTexture"], "normalTexture")
            scale = self._number(relief, "scale", 1.0)
            result["normal_map"] = self._image(relief)
            if scale != 1.0:
                result["normal_scale"] = scale
        mode = item.get("alphaMode", "OPAQUE")
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
            cut["threshold"] = self._number(item, "alphaCutoff", 0.5)
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
        import PIL.Image

        if texture is None:
            return False
        try:
            data = _image_bytes(self._gltf, self._folder, int(self._image(texture)["file"].rpartition("#")[2]))
            with PIL.Image.open(io.BytesIO(data)) as image:
                return "A" in image.getbands() or "transparency" in image.info
        except (BrokenGltfError, OSError):
            return True

    def _image(self, reference: Json) -> dict[str, Any]:
        """The image texture that a material refers to."""
        extensions = self._mapping(reference.get("extensions", {}), "extensions")
        transform = self._mapping(extensions.get("KHR_texture_transform", {}), "KHR_texture_transform")
        if transform.get("texCoord", reference.get("texCoord", 0)) != 0:
            raise BrokenGltfError(f"has {self._name} with a second set of texture coordinates, which is not supported")
        texture = _item(self._gltf.header, "textures", reference.get("index"))
        webp = self._mapping(texture.get("extensions", {}), "extensions").get("EXT_texture_webp", {})
        source = self._mapping(webp, "EXT_texture_webp").get("source", texture.get("source"))
        if source is None:
            raise BrokenGltfError(f"has {self._name} with a texture of a format that is not supported")
        result: dict[str, Any] = {"type": "image", "file": f"{self._file}#{source}"}
        if "sampler" in texture:
            sampler = _item(self._gltf.header, "samplers", texture["sampler"])
            wrap = [_WRAPS.get(sampler.get(key, 10497), "repeat") for key in ("wrapS", "wrapT")]
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
        if not isinstance(value, Mapping):
            raise BrokenGltfError(f"has {self._name} with {what or 'a value'} that is no mapping")
        return value

    def _number(self, item: Json, key: str, default: float) -> float:
        value = item.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise BrokenGltfError(f"has {self._name} with a {key} that is no number")
        return float(value)

    def _numbers(self, item: Json, key: str, default: tuple[float, ...]) -> list[float]:
        value = item.get(key, default)
        if not isinstance(value, list | tuple) or len(value) != len(default):
            raise BrokenGltfError(f"has {self._name} with a {key} that is not {len(default)} numbers")
        return [self._number({key: entry}, key, 0.0) for entry in value]
