"""Read the triangles of glTF files, each transformed by its node.

Every number that one part of a file states of another is checked before anything is read: a file of a few bytes
can name the same data, or the same node, any number of times, and promise what it does not have.

Reference: Khronos Group, "glTF 2.0 Specification", sec. 3.5 (scenes and nodes), 3.6 (buffers, views, accessors), 3.7
(meshes); KHR_mesh_quantization.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.scene.assets.gltf import (
    Gltf,
    Json,
    buffer_view,
    integer_entry,
    is_number,
    item,
    list_entry,
    mapping,
    parse,
)
from raytracer.scene.assets.raw_mesh import RawMesh
from raytracer.util.errors import format_value
from raytracer.util.safe_open import BrokenFileError

MAX_REPEATED = 2**24
"""Most vertices and triangles, each, of a file whose nodes or primitives share data; others have what they hold."""

MAX_PIECES = 2**16
"""Most primitives, each counted as often as nodes place it, unless the file has more nodes and accessors."""

_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}

_TRIANGLES, _STRIP, _FAN = 4, 5, 6

_COMPRESSIONS = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression")

Array = NDArray[Any]


def read_gltf(file: BinaryIO) -> RawMesh:
    """Read the triangles of the scene of an open file, with its materials' numbers if it has materials.

    Skins and morphs are left as they are at rest; points and lines are left out.  What has no normals or texture
    coordinates, where others have some, has zeros, and what has no material the count of materials as its kind.

    Raises
    ------
    BrokenFileError : the file breaks the specification, holds compressed meshes, or no triangles, or too many.
    """
    gltf = parse(file.read())
    for name in list_entry(gltf.header, "extensionsRequired"):
        if name in _COMPRESSIONS:
            raise BrokenFileError(f"needs the extension {name}, which is not supported")
    reader = _Reader(gltf, Path(file.name).parent)
    most_pieces = max(MAX_PIECES, len(list_entry(gltf.header, "nodes")) + len(list_entry(gltf.header, "accessors")))
    placed: list[tuple[_Piece, Array]] = []
    vertices = faces = 0
    for mesh, pose in _placed(gltf.header):
        for piece in reader.mesh(mesh):
            vertices, faces = vertices + len(piece.vertices), faces + len(piece.faces)
            most = max(MAX_REPEATED, reader.size)
            if len(placed) >= most_pieces or max(vertices, faces) > most:
                raise BrokenFileError(
                    f"repeats its meshes to more than {most_pieces:,} parts or {most:,} vertices or triangles"
                )
            placed.append((piece, pose))
    if not faces:
        raise BrokenFileError("has no faces")
    pieces = [_moved(piece, pose) for piece, pose in placed]
    offsets = np.cumsum([0, *(len(piece.vertices) for piece in pieces)])
    return RawMesh(
        np.concatenate([piece.vertices for piece in pieces]),
        np.concatenate([piece.faces + offset for piece, offset in zip(pieces, offsets, strict=False)]),
        _filled([piece.normals for piece in pieces], pieces, 3),
        _filled([piece.uv for piece in pieces], pieces, 2),
        np.concatenate([np.full(len(piece.faces), piece.kind, np.int32) for piece in pieces])
        if gltf.header.get("materials")
        else None,
    )


class _Piece(NamedTuple):
    """A primitive of a mesh, as `RawMesh` but of one material."""

    vertices: Array
    faces: Array
    normals: Array | None
    uv: Array | None
    kind: int


def _filled(columns: list[Array | None], pieces: list[_Piece], width: int) -> Array | None:
    """Concatenate the rows of one attribute, with zeros where a piece has none; None if no piece has it."""
    if all(rows is None for rows in columns):
        return None
    sizes = (len(piece.vertices) for piece in pieces)
    return np.concatenate(
        [np.zeros((size, width)) if rows is None else rows for rows, size in zip(columns, sizes, strict=True)]
    )


def _moved(piece: _Piece, pose: Array) -> _Piece:
    linear = pose[:3, :3]
    orientation = np.linalg.det(linear)

    # A mirroring node turns triangles inside out; normals go by the cofactors, which need no inverse.
    faces = piece.faces if orientation >= 0 else piece.faces[:, ::-1]
    normals = piece.normals
    if normals is not None:
        normals = normals @ np.cross(linear[[1, 2, 0]], linear[[2, 0, 1]]).T * np.sign(orientation)
    return piece._replace(vertices=piece.vertices @ linear.T + pose[:3, 3], faces=faces, normals=normals)


# ---- Nodes


def _placed(header: Json) -> Iterator[tuple[int, Array]]:
    """Walk through the meshes of the file's scene, by number, with the matrices (4, 4) of their nodes."""
    if "scenes" in header:
        scene = item(header, "scenes", header.get("scene", 0))
    else:
        # Without scenes, those nodes that are no other's child.
        nodes = [mapping(node, "a node") for node in list_entry(header, "nodes")]
        below = {child for node in nodes for child in list_entry(node, "children") if isinstance(child, int)}
        scene = {"nodes": [number for number in range(len(nodes)) if number not in below]}
    waiting = [(number, np.eye(4)) for number in reversed(list_entry(scene, "nodes"))]
    seen: set[int] = set()
    while waiting:
        number, above = waiting.pop()
        node = item(header, "nodes", number)
        if number in seen:
            raise BrokenFileError(f"has node {number} in more than one place of its tree")
        seen.add(number)
        pose = _pose(node, above, number)
        waiting += [(child, pose) for child in reversed(list_entry(node, "children"))]
        if "mesh" in node:
            yield node["mesh"], pose


def _pose(node: Json, above: Array, number: int) -> Array:
    if "matrix" in node:
        return np.asarray(above @ _numbers(node, "matrix", 16, number).reshape(4, 4).T)
    if not any(key in node for key in ("translation", "rotation", "scale")):
        return above
    pose = np.eye(4)
    if "rotation" in node:
        x, y, z, w = _numbers(node, "rotation", 4, number)
        length = x * x + y * y + z * z + w * w
        if not length > 0.0:
            raise BrokenFileError(f"has node {number} with a rotation that is none")
        pose[:3, :3] -= (2.0 / length) * np.array(
            [
                [y * y + z * z, z * w - x * y, -x * z - y * w],
                [-x * y - z * w, x * x + z * z, x * w - y * z],
                [y * w - x * z, -y * z - x * w, x * x + y * y],
            ]
        )
    if "scale" in node:
        pose[:3, :3] *= _numbers(node, "scale", 3, number)
    if "translation" in node:
        pose[:3, 3] = _numbers(node, "translation", 3, number)
    return np.asarray(above @ pose)


def _numbers(node: Json, key: str, count: int, number: int) -> Array:
    values = list_entry(node, key)
    if len(values) != count or not all(map(is_number, values)):
        raise BrokenFileError(f"has node {number} with a {key} that is not {count} finite numbers")
    return np.array([float(value) for value in values])


# ---- Meshes


class _Reader:
    """Reader of the meshes of one file, each once."""

    def __init__(self, gltf: Gltf, folder: Path) -> None:
        self._gltf = gltf
        self._folder = folder
        self._buffers: dict[str | None, bytes] = {}
        self._meshes: dict[int, list[_Piece]] = {}
        self._accessors: dict[tuple[int, str], Array] = {}
        self._numbers = 0

    @property
    def size(self) -> int:
        """Total size of the buffers that were read (bytes)."""
        return sum(map(len, self._buffers.values()))

    def mesh(self, number: Any) -> list[_Piece]:
        """Read the primitives of a mesh that consist of triangles."""
        mesh = item(self._gltf.header, "meshes", number)
        if number not in self._meshes:
            pieces = (self._piece(mapping(each, "a primitive"), number) for each in list_entry(mesh, "primitives"))
            self._meshes[number] = [piece for piece in pieces if piece is not None]
        return self._meshes[number]

    def _piece(self, primitive: Json, mesh: int) -> _Piece | None:
        mode = primitive.get("mode", _TRIANGLES)
        attributes = mapping(primitive.get("attributes", {}), "attributes")
        if mode not in (_TRIANGLES, _STRIP, _FAN) or "POSITION" not in attributes:
            return None
        vertices = self._accessor(attributes["POSITION"], "VEC3")
        normals, uv = (
            self._accessor(attributes[name], kind) if name in attributes else None
            for name, kind in (("NORMAL", "VEC3"), ("TEXCOORD_0", "VEC2"))
        )
        if any(rows is not None and len(rows) != len(vertices) for rows in (normals, uv)):
            raise BrokenFileError(f"has mesh {mesh} with more, or fewer, normals or coordinates than vertices")
        if "indices" in primitive:
            corners = self._accessor(primitive["indices"], "SCALAR")[:, 0]
            if corners.dtype.kind != "i" or (corners.size and not 0 <= corners.min() <= corners.max() < len(vertices)):
                raise BrokenFileError(f"has mesh {mesh} with faces of vertices that are not there")
        else:
            corners = np.arange(len(vertices))
        if not corners.size:
            return None
        materials = len(list_entry(self._gltf.header, "materials"))
        material = integer_entry(primitive, "material", materials)
        if material > materials:
            raise BrokenFileError(f"has mesh {mesh} of material {format_value(material)}, which is not there")
        # In glTF v runs down.
        turned = None if uv is None else uv * (1.0, -1.0) + (0.0, 1.0)
        return _Piece(vertices, _faces(corners, mode, mesh), normals, turned, material)

    def _accessor(self, number: Any, kind: str) -> Array:
        """Read the rows (count, width) of an accessor of a type: float64, or int64 of scalar integers."""
        accessor = item(self._gltf.header, "accessors", number)
        if (number, kind) not in self._accessors:
            self._accessors[number, kind] = self._read(accessor, number, kind)
        return self._accessors[number, kind]

    def _read(self, accessor: Json, number: int, kind: str) -> Array:
        dtype = _dtype(accessor)
        if accessor.get("type") != kind or dtype is None:
            raise BrokenFileError(f"has accessor {number}, which is not the {kind} that it is used as")
        count, width = integer_entry(accessor, "count"), _WIDTHS[kind]
        if "bufferView" in accessor:
            rows = self._rows(accessor, number, count, width, dtype)
        elif "sparse" in accessor:
            # Zeros, but for the sparse values.
            rows = np.broadcast_to(np.zeros((), dtype), (count, width))
        else:
            raise BrokenFileError(f"has accessor {number} without data")
        self._numbers += rows.size
        if self._numbers > max(MAX_REPEATED, self.size):
            raise BrokenFileError("has too many accessors of the same data")
        values = rows.astype(np.float64 if dtype.kind == "f" or kind != "SCALAR" else np.int64)
        if "sparse" in accessor:
            sparse = mapping(accessor["sparse"], "a sparse accessor")
            changed = integer_entry(sparse, "count")
            where, what = (mapping(sparse.get(key), f"sparse {key}") for key in ("indices", "values"))
            index_type = _dtype(where)
            if index_type is None or index_type.kind != "u" or not 0 < changed <= count:
                raise BrokenFileError(f"has accessor {number} with sparse indices that are none")
            places = self._rows(where, number, changed, 1, index_type)[:, 0].astype(np.int64)
            if places.max() >= count:
                raise BrokenFileError(f"has accessor {number} with a sparse index beyond its end")
            values[places] = self._rows(what, number, changed, width, dtype)
        if accessor.get("normalized") is True and dtype.kind != "f":
            values = np.maximum(values / np.iinfo(dtype).max, -1.0)
        return values

    def _rows(self, place: Json, number: int, count: int, width: int, dtype: np.dtype[Any]) -> Array:
        """Get rows (count, width) of a view, without a copy."""
        view, data = buffer_view(self._gltf, self._folder, place.get("bufferView"), self._buffers)
        size = width * dtype.itemsize
        start, stride = integer_entry(place, "byteOffset", 0), integer_entry(view, "byteStride", size)
        if stride < size:
            raise BrokenFileError(f"has accessor {number} with a byteStride of {stride} for elements of {size} bytes")
        if count and start + (count - 1) * stride + size > len(data):
            raise BrokenFileError(f"has accessor {number}, which goes beyond its data")
        return np.ndarray((count, width), dtype, data, start if count else 0, (stride, dtype.itemsize))


def _dtype(place: Json) -> np.dtype[Any] | None:
    code = place.get("componentType")
    return np.dtype(_COMPONENTS[code]) if isinstance(code, int) and code in _COMPONENTS else None


def _faces(corners: Array, mode: int, mesh: int) -> Array:
    """Make triangles (m, 3) of corners (n,) in the order of triangles, a strip or a fan."""
    if mode == _TRIANGLES:
        if len(corners) % 3:
            raise BrokenFileError(f"has mesh {mesh} with {len(corners)} corners, which are no triangles")
        return corners.reshape(-1, 3)
    if len(corners) < 3:
        raise BrokenFileError(f"has mesh {mesh} with {len(corners)} corners, which are no triangles")
    if mode == _FAN:
        return np.stack([corners[1:-1], corners[2:], np.broadcast_to(corners[0], len(corners) - 2)], axis=1)
    strip = np.stack([corners[:-2], corners[1:-1], corners[2:]], axis=1)
    strip[1::2] = strip[1::2, [1, 0, 2]]
    return strip
