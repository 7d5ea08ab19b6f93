"""Meshes, materials and images in glTF files.

The first byte says what the others are: a file as it is; JSON for a .glb file of sound chunks; or changes to a document
that stays JSON, packed in either way.
"""

import contextlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

import raytracer.scene.assets.gltf_geometry  # noqa: F401
from raytracer.scene.assets import companion_files, read_image
from raytracer.scene.assets.gltf_materials import read_materials
from raytracer.util.errors import InputError
from tests.fuzz.targets import _meshes
from tests.fuzz.targets._parts import CORNERS, TRIANGLES, altered, glb, uri

MAX_LENGTH = 2048
DICTIONARY = (
    b'"accessors"', b'"bufferViews"', b'"byteStride"', b'"byteOffset"', b'"byteLength"', b'"count"', b'"sparse"',
    b'"uri"', b'"children"', b'"matrix"', b'"mode"', b'"normalized":true', b'"componentType"', b'"TEXCOORD_0"',
    b"[", b"]", b"{", b"}", b"1e999", b"NaN", b"99999999999", b"null", b"data:;base64,",
)  # fmt: skip

_GLTF, _GLB, _JSON, _ALTERED, _ALTERED_GLB, _ALTERED_MATERIALS = range(6)

_PIXEL = bytes.fromhex(
    "89504e470d0a1a0a0000000d49484452000000010000000108060000001f15c4890000000d49444154789c6360606060000000050001a5f64540"
    "0000000049454e44ae426082"
)
_DATA = CORNERS.tobytes() + CORNERS[:, :2].tobytes() + TRIANGLES.tobytes() + np.array([1, 3], "<u2").tobytes() + _PIXEL
_END = 48 + 32 + 12 + 4


def _document(address: str | None) -> dict[str, Any]:
    view = [(0, 48), (48, 32), (80, 12), (92, 4), (_END, len(_PIXEL))]
    accessor = [(0, 5126, 4, "VEC3"), (1, 5126, 4, "VEC2"), (2, 5123, 6, "SCALAR")]
    texture = {
        "index": 0,
        "extensions": {"KHR_texture_transform": {"offset": [0.5, 0], "rotation": 1, "scale": [2, 2]}},
    }
    sparse = {"count": 2, "indices": {"bufferView": 3, "componentType": 5123}, "values": {"bufferView": 0}}
    return {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [
            {"children": [1, 2], "translation": [1, 2, 3], "rotation": [0, 0, 1, 0], "scale": [1, 2, -1]},
            {"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]},
            {"mesh": 1},
        ],
        "meshes": [
            {
                "primitives": [
                    {"attributes": {"POSITION": 0, "NORMAL": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}
                ]
            },
            {"primitives": [{"attributes": {"POSITION": 3}, "mode": 5}, {"attributes": {"POSITION": 0}, "mode": 6}]},
        ],
        "accessors": [
            *({"bufferView": v, "componentType": c, "count": n, "type": t} for v, c, n, t in accessor),
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "sparse": sparse},
        ],
        "bufferViews": [{"buffer": 0, "byteOffset": start, "byteLength": length} for start, length in view],
        "buffers": [{"byteLength": len(_DATA), **({} if address is None else {"uri": address})}],
        "materials": [
            {
                "pbrMetallicRoughness": {"baseColorFactor": [1, 0.5, 0.25, 1], "baseColorTexture": texture},
                "normalTexture": {"index": 0, "scale": 2},
                "emissiveFactor": [1, 0, 0],
                "alphaMode": "MASK",
                "extensions": {"KHR_materials_ior": {"ior": 1.4}},
            }
        ],
        "textures": [{"source": 0, "sampler": 0}],
        "samplers": [{"wrapS": 33071}],
        "images": [{"bufferView": 4}],
    }


def seeds() -> Iterator[bytes]:
    whole = json.dumps(_document(uri(_DATA)), separators=(",", ":")).encode()
    inner = json.dumps(_document(None), separators=(",", ":")).encode()
    yield bytes([_GLTF]) + whole
    yield bytes([_GLB]) + glb(inner, _DATA)
    yield bytes([_JSON]) + inner
    for kind in (_ALTERED, _ALTERED_GLB, _ALTERED_MATERIALS):
        yield bytes([kind])
        yield bytes([kind, 0, 0, 3, 8])


def run(data: bytes, folder: Path) -> None:
    kind, data = data[0] % 6 if data else 0, data[1:]
    path = folder / ("a.gltf" if kind in (_GLTF, _ALTERED) else "a.glb")
    if kind == _JSON:
        data = glb(data, _DATA)
    elif kind == _ALTERED:
        data = json.dumps(altered(_document(uri(_DATA)), data)).encode()
    elif kind in (_ALTERED_GLB, _ALTERED_MATERIALS):
        data = glb(json.dumps(altered(_document(None), data)).encode(), _DATA)
    if kind != _ALTERED_MATERIALS:
        _meshes.load(path, data)
        return
    path.write_bytes(data)
    for found in companion_files("mesh", path):
        assert found.is_file()
    with contextlib.suppress(InputError):
        read_materials(path, "a.glb")
    image = read_image(f"{path}#0")
    assert image.texels.size > 0
