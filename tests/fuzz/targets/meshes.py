"""Meshes of all formats, and materials and images in glTF files."""

import contextlib
import json
import struct

import numpy as np

import raytracer.scene.assets.gltf_geometry
import raytracer.scene.assets.obj
import raytracer.scene.assets.ply
import raytracer.scene.assets.stl  # noqa: F401
from raytracer.scene.assets import companion_files, read_image, read_mesh
from raytracer.scene.assets.gltf_materials import read_materials
from raytracer.util.errors import InputError
from tests.fuzz.harness import target
from tests.fuzz.targets._parts import altered, glb, uri

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.5]], "<f4")
TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]], "<u2")


def check(path):
    mesh = read_mesh(path)
    count = len(mesh.vertices)
    assert (mesh.vertices.shape, mesh.vertices.dtype) == ((count, 3), np.float64)
    assert (mesh.faces.shape, mesh.faces.dtype) == ((len(mesh.faces), 3), np.uint32)
    assert np.isfinite(mesh.vertices).all()
    assert 0 <= mesh.faces.max() < count
    if mesh.normals is not None:
        lengths = np.linalg.norm(mesh.normals, axis=1)
        assert mesh.normals.shape == (count, 3)
        assert ((np.abs(lengths - 1.0) < 1e-12) | (lengths == 0.0)).all()
    if mesh.uv is not None:
        assert mesh.uv.shape == (count, 2)
        assert np.isfinite(mesh.uv).all()
    if mesh.kinds is not None:
        assert mesh.kinds.shape == (len(mesh.faces),)
        assert mesh.kinds.min() >= 0


# ---- Wavefront

_SQUARE = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0.5\n"
_OBJ = [
    _SQUARE + b"f 1 2 3\nf 1 3 4\n",
    _SQUARE + b"vt 0 0\nvt 1 0\nvn 0 0 1\nf 1/1/1 2/2/1 3/1/1 4/2/1\n",
    _SQUARE + b"vn 0 0 1\nf 1//1 2//1 3//1\nf -4 -3 -2 -1\n",
    _SQUARE + b"vt 0 0\nusemtl a\nf 1/1 2/1 3/1\nusemtl b\nf 1 3 4\n# end\n",
    b"o one\n" + _SQUARE + b"g part\nf 1 2 \\\n3 4\nv 2 2 2 1 1 1\nf 1 2 5\n",
]
_OBJ_WORDS = "v ~vt ~vn ~f ~/~//~-1~usemtl ~mtllib ~o ~g ~\\\n~nan~1e999"

target("mesh_obj", seeds=_OBJ, file="a.obj", max_length=1024, words=_OBJ_WORDS)(check)

# ---- Stanford: text, bytes in both orders, faces of one size and of several


def _ply():
    places = "property float x\nproperty float y\nproperty float z\n"
    more = places + "".join(f"property float {name}\n" for name in ("nx", "ny", "nz", "s", "t"))

    def file(kind, properties, body, name="vertex_indices"):
        head = f"ply\nformat {kind} 1.0\nelement vertex 4\n{properties}element face 2\n"
        return f"{head}property list uchar int {name}\nend_header\n".encode() + body

    text = b"0 0 0\n1 0 0\n1 1 0\n0 1 0.5\n"
    yield file("ascii", places, text + b"3 0 1 2\n3 0 2 3\n")
    yield file("ascii", places, text + b"3 0 1 2\n4 0 1 2 3\n", "vertex_index")
    for kind, order in (("binary_little_endian", "<"), ("binary_big_endian", ">")):
        corners = CORNERS.astype(f"{order}f4").tobytes()
        table = np.hstack([CORNERS, CORNERS, CORNERS[:, :2]]).astype(f"{order}f4").tobytes()
        one, two, quad = (struct.pack(f"{order}B{len(f)}i", len(f), *f) for f in ((0, 1, 2), (0, 2, 3), (0, 1, 2, 3)))
        yield file(kind, places, corners + one + two)
        yield file(kind, places, corners + quad + one)
        yield file(kind, more, table + one + two)
        yield file(kind, more, table + two + quad)


_PLY_WORDS = (
    "element ~vertex ~face ~property ~list ~uchar ~int ~uint ~float ~double ~vertex_indices~vertex_index~ascii~nx~s\n~"
    "binary_little_endian~binary_big_endian~end_header\n~comment ~999999999999~-1~red~texnumber~t\n"
)
target("mesh_ply", seeds=_ply, file="a.ply", max_length=1024, words=_PLY_WORDS)(check)

# ---- Stereolithography; the first byte says whether the count of facets is put right

_RIGHT = b"\x01"
_HEADER, _FACET = 84, 50


def _stl():
    facets = b"".join(struct.pack("<12fH", 0, 0, 1, *CORNERS[face].reshape(-1), 0) for face in TRIANGLES)
    yield _RIGHT + bytes(_HEADER) + facets
    yield b"\x00" + bytes(_HEADER - 4) + struct.pack("<I", 2) + facets
    corners = "".join("vertex {} {} {}\n".format(*corner) for corner in CORNERS[:3])
    facet = f"facet normal 0 0 1\nouter loop\n{corners}endloop\nendfacet\n"
    yield f"\x00solid a\n{facet}{facet}endsolid a\n".encode()
    yield f"\x00solid a\n{facet}endsolid a\nsolid b\n{facet}endsolid b\n".encode()


_STL_WORDS = "solid ~endsolid\n~facet normal ~endfacet\n~outer loop\n~endloop\n~vertex ~nan"


@target("mesh_stl", seeds=_stl, max_length=1024, words=_STL_WORDS)
def load_stl(data, folder):
    given, data = data[:1], data[1:]
    if given == _RIGHT and len(data) >= _HEADER:
        count = (len(data) - _HEADER) // _FACET
        data = data[: _HEADER - 4] + struct.pack("<I", count) + data[_HEADER : _HEADER + _FACET * count]
    (folder / "a.stl").write_bytes(data)
    check(folder / "a.stl")


# ---- glTF.  The first byte says what the others are: a file as it is; JSON for a .glb file of sound chunks; or changes
# to a document that stays JSON, packed in either way.

_GLTF, _GLB, _JSON, _ALTERED, _ALTERED_GLB, _ALTERED_MATERIALS = range(6)

_PIXEL = bytes.fromhex(
    "89504e470d0a1a0a0000000d49484452000000010000000108060000001f15c4890000000d49444154789c6360606060000000050001a5f64540"
    "0000000049454e44ae426082"
)
_DATA = CORNERS.tobytes() + CORNERS[:, :2].tobytes() + TRIANGLES.tobytes() + np.array([1, 3], "<u2").tobytes() + _PIXEL

_DOCUMENT = """
{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [
  {"children": [1, 2], "translation": [1, 2, 3], "rotation": [0, 0, 1, 0], "scale": [1, 2, -1]},
  {"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}, {"mesh": 1}],
"meshes": [
  {"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}]},
  {"primitives": [{"attributes": {"POSITION": 3}, "mode": 5}, {"attributes": {"POSITION": 0}, "mode": 6}]}],
"accessors": [
  {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
  {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2"},
  {"bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR"},
  {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "sparse":
    {"count": 2, "indices": {"bufferView": 3, "componentType": 5123}, "values": {"bufferView": 0}}}],
"bufferViews": [], "buffers": [],
"materials": [{"pbrMetallicRoughness": {"baseColorFactor": [1, 0.5, 0.25, 1], "baseColorTexture": {"index": 0,
    "extensions": {"KHR_texture_transform": {"offset": [0.5, 0], "rotation": 1, "scale": [2, 2]}}}},
  "normalTexture": {"index": 0, "scale": 2}, "emissiveFactor": [1, 0, 0], "alphaMode": "MASK",
  "extensions": {"KHR_materials_ior": {"ior": 1.4}}}],
"textures": [{"source": 0, "sampler": 0}], "samplers": [{"wrapS": 33071}], "images": [{"bufferView": 4}]}
"""


def _document(address):
    result = json.loads(_DOCUMENT)
    views = ((0, 48), (48, 32), (80, 12), (92, 4), (96, len(_PIXEL)))
    result["bufferViews"] = [{"buffer": 0, "byteOffset": start, "byteLength": length} for start, length in views]
    result["buffers"] = [{"byteLength": len(_DATA), **({} if address is None else {"uri": address})}]
    return result


def _gltf():
    whole, inner = (json.dumps(_document(address), separators=(",", ":")).encode() for address in (uri(_DATA), None))
    yield bytes([_GLTF]) + whole
    yield bytes([_GLB]) + glb(inner, _DATA)
    yield bytes([_JSON]) + inner
    for kind in (_ALTERED, _ALTERED_GLB, _ALTERED_MATERIALS):
        yield bytes([kind])
        yield bytes([kind, 0, 0, 3, 8])


_GLTF_WORDS = (
    '"accessors"~"bufferViews"~"byteStride"~"byteOffset"~"byteLength"~"count"~"sparse"~"uri"~"children"~"matrix"~"mode"~'
    '"normalized":true~"componentType"~"TEXCOORD_0"~[~]~{~}~1e999~NaN~99999999999~null~data:;base64,'
)


@target("mesh_gltf", seeds=_gltf, max_length=2048, words=_GLTF_WORDS)
def load_gltf(data, folder):
    kind, data = data[0] % 6 if data else 0, data[1:]
    path = folder / ("a.gltf" if kind in (_GLTF, _ALTERED) else "a.glb")
    if kind == _JSON:
        data = glb(data, _DATA)
    elif kind == _ALTERED:
        data = json.dumps(altered(_document(uri(_DATA)), data)).encode()
    elif kind in (_ALTERED_GLB, _ALTERED_MATERIALS):
        data = glb(json.dumps(altered(_document(None), data)).encode(), _DATA)
    path.write_bytes(data)
    if kind != _ALTERED_MATERIALS:
        check(path)
        return
    for found in companion_files("mesh", path):
        assert found.is_file()
    with contextlib.suppress(InputError):
        read_materials(path, "a.glb")
    assert read_image(f"{path}#0").texels.size > 0
