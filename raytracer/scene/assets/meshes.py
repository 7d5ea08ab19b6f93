"""Read triangle meshes from files, check them and compute their normals."""

import traceback
import warnings
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.lock import compiler_lock
from raytracer.scene.assets.raw_mesh import Integers, RawMesh, weld
from raytracer.util.errors import one_line
from raytracer.util.safe_open import BrokenFileError, check_suffix, name_read_errors, open_regular

_MOST_FACES = 2**31

# Embree takes coordinates as float32.
_LARGEST = float(np.finfo(np.float32).max)

# Texels are numbered by 64-bit integers; a float32 has no fraction from 2^24 on.
_FARTHEST_UV = 2.0**31

# Triangles per block: intermediate results stay in the processor's cache, and take little memory.
_BLOCK = 1 << 14

Vectors = NDArray[np.float64]


class Mesh(NamedTuple):
    """A triangle mesh.

    vertices : float64 (n, 3), finite, as float32 too.
    faces : uint32 (m, 3), indices of vertices, counter-clockwise seen from outside; m >= 1, none of zero area.
    normals : float64 (n, 3), unit normals of the vertices, zero for a vertex in no face; None if the file has none.
    degenerate : how many triangles of zero area the file had besides.
    uv : float64 (n, 2), finite texture coordinates of the vertices, v upwards; None if the file has none.
    kinds : int32 (m,), the number of each face's material in the file, see `gltf_materials.read_materials`; None if it
        has none.
    first_degenerate : the number of the first of the triangles of zero area, counted from 0 as the file has them; -1 if
        there is none.
    """

    vertices: Vectors
    faces: NDArray[np.uint32]
    normals: Vectors | None
    degenerate: int
    uv: Vectors | None = None
    kinds: NDArray[np.int32] | None = None
    first_degenerate: int = -1

    def vertex_normals(self) -> Vectors:
        """Return the file's normals, or those of `smooth_normals` if it has none: float64 (n, 3)."""
        return smooth_normals(self.vertices, self.faces) if self.normals is None else self.normals


def _blocks(faces: NDArray[Any]) -> Iterator[slice]:
    return (slice(start, start + _BLOCK) for start in range(0, len(faces), _BLOCK))


def _corners(vertices: Vectors, faces: NDArray[Any]) -> Vectors:
    """Gather the coordinates of the corners of `faces` (m, 3), as (axis, corner, m), the fastest order."""
    return np.ascontiguousarray(np.moveaxis(vertices.take(faces.T.astype(np.int64), axis=0), 2, 0))


def _cross(a: Vectors, b: Vectors) -> Vectors:
    """Compute cross products of column vectors: (3, m)."""
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def _has_area(vertices: Vectors, faces: NDArray[np.uint32]) -> NDArray[np.bool_]:
    """Find the triangles whose area is not exactly zero (m,).

    For coordinates that were float32 the edges and their products are exact, or nearly so, in float64: what is
    found to be zero is zero, and a sliver that is not is kept.
    """
    result = np.empty(len(faces), dtype=bool)
    for block in _blocks(faces):
        points = _corners(vertices, faces[block])
        normal = _cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
        result[block] = np.any(normal != 0.0, axis=0)
    return result


def _corner_sums(vertices: Vectors, faces: Integers, owner: Integers, owners: int) -> Vectors:
    """Sum, over the corners of each owner, the triangles' unit normals weighted by the corners' angles."""
    sums = np.zeros((3, owners))
    for block in _blocks(faces):
        points = _corners(vertices, faces[block])
        edges = [points[:, (k + 1) % 3] - points[:, k] for k in range(3)]
        normal = _cross(edges[0], edges[1])
        area = np.sqrt(np.einsum("ij,ij->j", normal, normal))
        np.divide(normal, area, out=normal, where=area > 0.0)
        for k in range(3):
            angle = np.arctan2(area, -np.einsum("ij,ij->j", edges[k], edges[k - 1]))
            for axis in range(3):
                np.add.at(sums[axis], owner[faces[block, k]], angle * normal[axis])
    return sums.T


def _normalized(vectors: Vectors) -> tuple[Vectors, NDArray[np.bool_]]:
    """Normalize `vectors` (n, 3), and find those that can be; the others become zero."""
    # Scaled by the largest component before, so that no square over- or underflows.
    largest = np.abs(vectors).max(axis=1, keepdims=True)
    usable = (largest > 0.0) & np.isfinite(largest)
    scaled = np.divide(vectors, largest, out=np.zeros_like(vectors), where=usable)
    length = np.linalg.norm(scaled, axis=1, keepdims=True)
    return np.divide(scaled, length, out=scaled, where=usable), usable[:, 0]


def smooth_normals(vertices: Vectors, faces: Integers) -> Vectors:
    """Compute unit normals of the vertices, float64 (n, 3): the mean of their triangles' normals, weighted by angle.

    Vertices (n, 3) in exactly the same place, as at the seam of a texture, are taken as one.  Where their triangles
    cancel out, as on the two sides of a sheet, each vertex has the normal of its own.  A vertex whose normal is not
    defined, because it is in no triangle with an area, has (0, 0, 0).

    References: Thürmer and Wüthrich 1998, "Computing Vertex Normals from Polygonal Facets", Journal of Graphics
        Tools 3(1).
    """
    first, place = weld(vertices)
    shared = _corner_sums(vertices, faces, place, len(first))[place]
    normals, defined = _normalized(shared)
    if len(first) < len(vertices) and not defined.all():
        own, _ = _normalized(_corner_sums(vertices, faces, np.arange(len(vertices)), len(vertices)))
        normals[~defined] = own[~defined]
    return normals


def _check_finite(rows: Vectors, sentence: str, largest: float = _LARGEST) -> None:
    """Raise BrokenFileError for the first of `rows` (n, k) with a value that is not finite, or beyond `largest`."""
    with np.errstate(invalid="ignore"):
        usable = (np.abs(rows) <= largest).all(axis=1)
    if not usable.all():
        raise BrokenFileError(sentence.format(int(np.argmin(usable))))


def _checked(parts: RawMesh) -> Mesh:
    """Check a raw mesh, and remove its degenerate triangles."""
    if len(parts.faces) >= _MOST_FACES:
        raise BrokenFileError(f"has {len(parts.faces)} triangles, and at most {_MOST_FACES - 1} are supported")
    if len(parts.faces) == 0:
        raise BrokenFileError("has no faces")
    vertices = np.ascontiguousarray(parts.vertices, dtype=np.float64)
    _check_finite(vertices, "has a vertex that is not finite (number {}, counted from 0)")

    # Indices are compared before they are converted, which would wrap a negative one around.
    lowest, highest = parts.faces.min(), parts.faces.max()
    if lowest < 0 or highest >= len(vertices):
        bad = int(lowest if lowest < 0 else highest)
        raise BrokenFileError(f"has a face with the vertex {bad} (counted from 0), and {len(vertices)} vertices")
    faces = np.ascontiguousarray(parts.faces, dtype=np.uint32)

    kept = _has_area(vertices, faces)
    degenerate = len(faces) - int(np.count_nonzero(kept))
    if degenerate == len(faces):
        raise BrokenFileError("has no faces with an area")
    if degenerate:
        faces = faces[kept]

    normals = None
    if parts.normals is not None:
        normals, usable = _normalized(np.asarray(parts.normals, dtype=np.float64))
        if not usable.all():
            normals[~usable] = smooth_normals(vertices, faces)[~usable]
    if parts.uv is not None:
        _check_finite(
            parts.uv, "has a texture coordinate that is not finite (of vertex {}, counted from 0)", _FARTHEST_UV
        )
    kinds = None if parts.kinds is None else parts.kinds[kept]
    first = int(np.argmin(kept)) if degenerate else -1
    return Mesh(vertices, faces, normals, degenerate, parts.uv, kinds, first)


_FORMATS = {".ply": "PLY", ".obj": "OBJ", ".stl": "STL", ".gltf": "glTF", ".glb": "glTF"}

_READERS = {"PLY": "ply", "OBJ": "obj", "STL": "stl", "glTF": "gltf_geometry"}
"""Modules of the formats' readers, imported where one is read: most scenes have no mesh, and the others few formats."""


def _read(path: Path) -> RawMesh:
    name = _FORMATS[path.suffix.lower()]
    reader = getattr(import_module(f"raytracer.scene.assets.{_READERS[name]}"), f"read_{name.lower()}")
    # Filters of warnings are of the whole process.
    with compiler_lock, open_regular(path) as file, warnings.catch_warnings(), np.errstate(all="ignore"):
        if not file.peek(1):
            raise BrokenFileError("is empty")

        # Before version 2.3, NumPy stopped at what is no number and warned.
        warnings.filterwarnings("error", "string or file could not be read", DeprecationWarning)
        try:
            return cast(RawMesh, reader(file))
        except BrokenFileError:
            raise
        except Exception as error:
            # A broken file raises anything, from KeyError to struct.error.
            reason = one_line(traceback.format_exception_only(error)[-1])
            raise BrokenFileError(f"cannot be read as {name}: {reason}") from error


def read_mesh(path: str | Path) -> Mesh:
    """Read the triangles of a .ply, .obj, .stl, .gltf or .glb file.

    Polygons are cut into triangles as if they were convex.  Materials are read by `gltf_materials.read_materials`;
    colours and animations are left out.  Normals in the file are normalised, and those that are zero or not finite
    replaced by `smooth_normals`.

    Raises
    ------
    InputError : the file is missing, unreadable, broken, of an unknown suffix, or without usable triangles.
    """
    path = Path(path)
    check_suffix(path, _FORMATS, "a mesh")
    with name_read_errors(path):
        return _checked(_read(path))
