"""Read the materials of glTF files, as a scene would write them.

trimesh reads glTF files too, but drops what it cannot read of materials without a word, and rounds colours to bytes.
Materials are small and declarative, and are read from the file's JSON here; `gltf_geometry` reads the triangles.

References: Khronos Group, "glTF 2.0 Specification", sec. 3.9 (materials), 3.8.2 (textures); the extensions
KHR_materials_emissive_strength, KHR_materials_ior, KHR_materials_transmission, KHR_texture_transform, EXT_texture_webp.
"""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from raytracer.film.formats.base.pillow import is_transparent
from raytracer.scene.assets.gltf import Gltf, Json, image_bytes, is_number, item, list_entry, mapping, parse
from raytracer.util.errors import format_value
from raytracer.util.safe_open import BrokenFileError, name_read_errors, read_regular

_WRAPS = {"33071": "clamp", "33648": "mirror"}

MAX_IMAGES = 4096
"""Most images of a file, which is read once for each that is used."""


def read_materials(path: Path, name: str) -> tuple[dict[str, Any], ...]:
    """Read the materials of a glTF file and, last, glTF's default, each as a mapping that a scene could hold.

    Images are named by `name`, which is what the scene calls the file, and their number in it: `name#number`.
    Occlusion, vertex colours and further extensions are left out: a path tracer makes the first by itself.

    Raises
    ------
    InputError : the file cannot be read, or a material in it is not as glTF says.
    """
    with name_read_errors(path):
        gltf = parse(read_regular(path))
        materials = list_entry(gltf.header, "materials")
        if len(list_entry(gltf.header, "images")) > MAX_IMAGES:
            raise BrokenFileError(f"has more than {MAX_IMAGES:,} images")
        reader = _Materials(gltf, path.parent, name)
        return tuple(reader.material(each, number) for number, each in enumerate([*materials, {}]))


class _Materials:
    """Reader of the materials of one file."""

    def __init__(self, gltf: Gltf, folder: Path, file: str) -> None:
        self._gltf = gltf
        self._folder = folder
        self._file = file
        self._name = ""
        self._transparent: dict[int, bool] = {}

    def material(self, material: Any, number: int) -> dict[str, Any]:
        """Convert material `number` to a principled one, in a cutout if its alpha has holes."""
        self._name = f"material {number}"
        material = self._mapping(material, "")
        extensions = self._entry(material, "extensions")
        metallic_roughness = self._entry(material, "pbrMetallicRoughness")

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
        result["ior"] = self._number(self._entry(extensions, "KHR_materials_ior"), "ior", 1.5)
        clear = self._entry(extensions, "KHR_materials_transmission")
        if transmission := self._number(clear, "transmissionFactor", 0.0):
            result["transmission"] = self._textured(clear.get("transmissionTexture"), transmission, "r")

        # Its emission.
        emissive = self._numbers(material, "emissiveFactor", (0.0, 0.0, 0.0))
        strength = self._entry(extensions, "KHR_materials_emissive_strength")
        if any(emissive):
            factor = self._number(strength, "emissiveStrength", 1.0)
            result["emission"] = self._textured(material.get("emissiveTexture"), [factor * value for value in emissive])

        # Its normal map, and its holes.
        if "normalTexture" in material:
            normal_texture = self._entry(material, "normalTexture")
            scale = self._number(normal_texture, "scale", 1.0)
            result["normal_map"] = self._image(normal_texture)
            if scale != 1.0:
                result["normal_scale"] = scale
        mode = material.get("alphaMode", "OPAQUE")
        if mode == "OPAQUE":
            return result
        if mode not in ("MASK", "BLEND"):
            raise BrokenFileError(f"has {self._name} with the alphaMode {format_value(mode)}")
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
        """Make a factor, or the texture that it multiplies."""
        if texture is None or not any(factor if isinstance(factor, Sequence) else (factor,)):
            return factor
        result = self._image(self._mapping(texture, "a texture"))
        if channel is not None:
            result["channel"] = channel
        if any(value != 1.0 for value in (factor if isinstance(factor, Sequence) else (factor,))):
            result["factor"] = factor
        return result

    def _has_alpha(self, texture: Any) -> bool:
        """Return True if a texture's image has alpha, or cannot be read, which is reported when it is used."""
        if texture is None:
            return False
        try:
            number = int(self._image(texture)["file"].rpartition("#")[2])
            if number not in self._transparent:
                self._transparent[number] = is_transparent(image_bytes(self._gltf, self._folder, number))
            return self._transparent[number]
        except BrokenFileError:
            return True

    def _image(self, reference: Json) -> dict[str, Any]:
        """Make the image texture that a material refers to."""
        transform = self._entry(self._entry(reference, "extensions"), "KHR_texture_transform")
        if transform.get("texCoord", reference.get("texCoord", 0)) != 0:
            raise BrokenFileError(f"has {self._name} with a second set of texture coordinates, which is not supported")
        texture = item(self._gltf.header, "textures", reference.get("index"))
        webp = self._entry(self._entry(texture, "extensions"), "EXT_texture_webp")
        source = webp.get("source", texture.get("source"))
        if source is None:
            raise BrokenFileError(f"has {self._name} with a texture of a format that is not supported")
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
        """Convert KHR_texture_transform, whose v runs down, to coordinates whose v runs up."""
        offset = self._numbers(transform, "offset", (0.0, 0.0))
        scale = self._numbers(transform, "scale", (1.0, 1.0))
        angle = self._number(transform, "rotation", 0.0)
        return {
            "scale": scale,
            "rotation": math.degrees(angle),
            "offset": [offset[0] + scale[1] * math.sin(angle), 1.0 - offset[1] - scale[1] * math.cos(angle)],
        }

    def _mapping(self, value: Any, what: str) -> Json:
        return mapping(value, f"{self._name} with {what or 'a value'}")

    def _entry(self, holder: Json, key: str) -> Json:
        return self._mapping(holder.get(key, {}), key)

    def _number(self, holder: Json, key: str, default: float) -> float:
        value = holder.get(key, default)
        if not is_number(value):
            raise BrokenFileError(f"has {self._name} with a {key} that is no number")
        return float(value)

    def _numbers(self, holder: Json, key: str, default: tuple[float, ...]) -> list[float]:
        value = holder.get(key, default)
        if not isinstance(value, list | tuple) or len(value) != len(default):
            raise BrokenFileError(f"has {self._name} with a {key} that is not {len(default)} numbers")
        return [self._number({key: entry}, key, 0.0) for entry in value]
