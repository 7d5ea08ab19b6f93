"""Read mesh files with libraries, and correct what the libraries get wrong.

trimesh reads PLY, OBJ and STL files, and meshio those PLY files that trimesh refuses: binary ones whose faces are not
all of one size, as Blender writes them.  They say little about files that are broken, or ask for more than they read,
so each function here checks what its format can get wrong without a word.

References: Wavefront Technologies, "Object Files (.obj)", Advanced Visualizer Manual, appendix B1; G. Turk, "The PLY
    Polygon File Format", 1994; Khronos Group, "glTF 2.0 Specification".
"""

import io
import logging
import re
import traceback
import warnings
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.scene.assets.gltf import BrokenGltfError, parse
from raytracer.scene.assets.gltf_geometry import read_triangles
from raytracer.util.errors import format_value, one_line
from raytracer.util.safe_open import open_regular

Integers = NDArray[np.integer[Any]]
Floats = NDArray[np.floating[Any]]

_LONGEST_HEADER = 1 << 16

# What trimesh logs would go to stderr.
logging.getLogger("trimesh").addHandler(logging.NullHandler())

_CORNERS = ("vertex_indices", "vertex_index")

_PLY_COORDINATES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))

# Faces as meshio reads them right, lists of corners and nothing else, and what follows, which it does not read.
_PLAIN_FACES = re.compile(
    rb"element face (\d+)\s+property list \w+ \w+ (vertex_ind(?:ices|ex)\s+(?:element .*)?)end_header\r?\n", re.DOTALL
)

# trimesh takes what comes second for the format, and bytes of an unknown one for little-endian.
_PLY_HEADER = re.compile(
    rb"ply\r?\nformat (ascii|binary_little_endian|binary_big_endian) 1\.0[ \t\r]*\n.*?\nend_header\r?\n", re.DOTALL
)

# The first and the last line of an STL solid, with its name, which may be any word of the format.
_SOLID = re.compile(r"^[ \t]*(?:end)?solid\b.*$", re.MULTILINE)

# No face that a program writes has as many corners as fit in a line of this length.
_LONGEST_LINE = 1 << 20

# An index of an OBJ face, and what its corners may be with a 1 for each.
_INDEX = re.compile(r"-?\b\d{1,18}\b", re.ASCII)
_FORMS = {"1", "1/", "1//", "1/1", "1/1/", "1//1", "1/1/1"}

# What of a line of each keyword is read: weights, colours and depths of textures are left out.
_NUMBERS = {"v": 3, "vt": 2, "vn": 3}
_ROWS = {"v": "vertex", "vn": "normal"}

# Corners of an OBJ face with an index that counts back, or is 0.
_RELATIVE = re.compile(r"-|\b0+\b")


class RawMesh(NamedTuple):
    """A mesh as a file has it, not yet checked.

    vertices : (n, 3).
    faces : (m, 3).
    normals : (n, 3), or None.
    uv : (n, 2), or None.
    kinds : (m,), number of each face's material in the file; None if it has none.
    """

    vertices: NDArray[np.float64]
    faces: Integers
    normals: NDArray[np.float64] | None
    uv: NDArray[np.float64] | None = None
    kinds: NDArray[np.int32] | None = None


class BrokenMeshError(ValueError):
    """Error of a mesh file that cannot be read; its text completes the sentence "FILE: ..."."""


def _parts(
    vertices: NDArray[Any], faces: NDArray[Any], normals: NDArray[Any] | None, uv: NDArray[Any] | None = None
) -> RawMesh:
    if faces.dtype.kind not in "iu":
        raise BrokenMeshError("has faces whose corners are not integers")
    vertices = np.ascontiguousarray(vertices, dtype=np.float64)
    normals, uv = (None if rows is None else np.asarray(rows, dtype=np.float64) for rows in (normals, uv))
    return RawMesh(vertices, faces, normals, uv)


def weld(points: Floats) -> tuple[Integers, Integers]:
    """Weld equal `points` (n, 3): the index of a point of each kind (k,), and the kind of each point (n,).

    Equal means equal in every bit but the sign of zero; NaN equals nothing.
    """
    order = np.lexsort(points.T)
    ordered = points[order]
    new = np.ones(len(points), dtype=bool)
    np.any(ordered[1:] != ordered[:-1], axis=1, out=new[1:])
    kind = np.empty(len(points), dtype=np.int64)
    kind[order] = np.cumsum(new) - 1
    return order[new], kind


def _triangles(polygons: Integers | list[Integers]) -> Integers:
    """Cut polygons, an array (p, corners) or a list of arrays, into triangles (m, 3)."""
    from trimesh.geometry import triangulate_quads

    if isinstance(polygons, np.ndarray) and polygons.shape[1:] == (3,):
        return polygons
    triangles: Integers = triangulate_quads(polygons)
    return triangles


def _read_scene(text: str, format_name: str) -> RawMesh:
    """Read the triangles of all parts of a text without further files; missing normals are (0, 0, 0)."""
    import trimesh

    scene = trimesh.load_scene(io.StringIO(text), file_type=format_name, process=False, skip_materials=True)
    vertices: list[Floats] = []
    faces: list[Integers] = []
    normals: list[Floats] = []
    coordinates: list[Floats] = []
    has_normals = has_uv = False
    offset = 0
    for mesh in scene.geometry.values():
        if not isinstance(mesh, trimesh.Trimesh):
            continue
        if mesh.vertices.shape[1:] != (3,):
            raise BrokenMeshError("has vertices without 3 coordinates")
        own = len(mesh.vertices)
        if len(mesh.faces) and not 0 <= mesh.faces.min() <= mesh.faces.max() < own:
            raise BrokenMeshError("has a face with a vertex that is not there")
        vertices.append(mesh.vertices)
        faces.append(mesh.faces + offset)
        offset += own

        # Normals that were not in the file are not there yet; asking the mesh for them would make them.
        if "vertex_normals" in mesh._cache.cache:
            has_normals = True
            normals.append(mesh.vertex_normals)
        else:
            normals.append(np.zeros((own, 3)))

        # Parts without texture coordinates lie at one place of the texture.
        uv = getattr(mesh.visual, "uv", None)
        has_uv |= uv is not None
        coordinates.append(np.zeros((own, 2)) if uv is None else np.asarray(uv, np.float64)[:, :2])
    if not faces:
        raise BrokenMeshError("has no faces")
    return _parts(
        np.concatenate(vertices),
        np.concatenate(faces),
        np.concatenate(normals) if has_normals else None,
        np.concatenate(coordinates) if has_uv else None,
    )


def _read_gltf(file: BinaryIO) -> RawMesh:
    """Read the triangles of a .gltf or .glb file, with its materials' numbers if it has materials."""
    gltf = parse(file.read())
    vertices, faces, normals, uv, kinds = read_triangles(gltf, Path(file.name).parent)
    return _parts(vertices, faces, normals, uv)._replace(kinds=kinds if gltf.header.get("materials") else None)


def _read_stl(file: BinaryIO) -> RawMesh:
    """Read an STL file; equal corners become one vertex, since the format has no indices."""
    from trimesh.exchange.stl import HeaderError, load_stl_binary

    try:
        mesh = load_stl_binary(file)
        corners, faces = mesh.get("vertices", np.empty((0, 3))), mesh.get("faces", np.empty((0, 3), dtype=np.int64))
    except HeaderError:
        file.seek(0)
        if b"endsolid" not in file.read(_LONGEST_HEADER).lower() and not _ends_as_text(file):
            raise BrokenMeshError("ends early, or is neither text nor as long as its binary header says") from None
        file.seek(0)
        facets, solids = _SOLID.subn("", file.read().decode("latin-1").lower())
        if solids % 2:
            raise BrokenMeshError("ends early") from None

        # Of several solids trimesh makes a mesh each, and leaves out those that are not whole.
        corners, faces, *_ = _read_scene(f"solid\n{facets}\nendsolid\n", "stl")
        if len(faces) != facets.count("endfacet"):
            raise BrokenMeshError("ends early, or has facets that are not triangles") from None
    first, vertex = weld(corners)
    return _parts(corners[first], vertex[faces], None)


def _ends_as_text(file: BinaryIO) -> bool:
    """Return True if a solid ends near the end of the file, as in text; the file is not read whole."""
    file.seek(max(0, file.seek(0, io.SEEK_END) - _LONGEST_HEADER))
    return b"endsolid" in file.read().lower()


def _absolute(index: str, count: int) -> str:
    """Convert an OBJ index to one counted from 1; a negative one counts back from the `count` before its face."""
    if not index:
        return index
    absolute = int(index)
    if absolute < 0:
        absolute += count + 1
    if absolute <= 0:
        raise BrokenMeshError(f"has a face with the index {index}, after {count} that it could mean")
    return str(absolute)


def _plain_obj(text: str) -> str:
    """Rewrite an OBJ file's vertices, normals and faces in the forms of the format that trimesh reads correctly.

    It counts negative indices from the end of the file, takes 0 for 1, and takes all of a material's faces with the
    same count of numbers to be written as the first is.  It overlooks lines that are indented or have tabs, joins
    the words around the end of a line that is continued, and leaves faces out that have fewer than 3 corners.
    """
    before = {"v": 0, "vt": 0, "vn": 0}
    data: list[str] = []
    by_form: defaultdict[str, list[str]] = defaultdict(list)
    for line in re.sub(r"\\\r?\n|#.*", " ", text).split("\n"):
        if len(line) > _LONGEST_LINE:
            raise BrokenMeshError(f"has a line of {len(line):,} characters, and at most {_LONGEST_LINE:,} are read")
        words = line.split()
        keyword = words[0] if words else ""
        if keyword == "f":
            corners = words[1:]
            if len(corners) < 3:
                raise BrokenMeshError("has a face with fewer than 3 corners")
            forms = set(_INDEX.sub("1", " ".join(corners)).split())
            if len(forms) > 1 or not forms <= _FORMS:
                raise BrokenMeshError(
                    f"has a face whose corners are no indices of one kind: {format_value(line.strip())}"
                )
            if _RELATIVE.search(line):
                pairs = (zip(corner.split("/"), before.values(), strict=False) for corner in corners)
                corners = ["/".join(_absolute(*pair) for pair in corner) for corner in pairs]
            by_form[forms.pop()].append("f " + " ".join(corners))
        elif keyword in before:
            before[keyword] += 1
            numbers = words[1 : 1 + _NUMBERS[keyword]]
            # A texture coordinate without a v has 0 there.
            if keyword == "vt":
                numbers += ["0"] * (2 - len(numbers))
            if len(numbers) < _NUMBERS[keyword]:
                raise BrokenMeshError(f"has a {_ROWS[keyword]} without 3 coordinates")
            data.append(" ".join([keyword, *numbers]))
    for form, faces in by_form.items():
        data += [f"usemtl {form}", *faces]
    return "\n".join(data)


def _read_obj(file: BinaryIO) -> RawMesh:
    with io.TextIOWrapper(file, encoding="latin-1") as text:
        return _read_scene(_plain_obj(text.read()), "obj")


def _check_ply_size(file: BinaryIO, head: re.Match[bytes]) -> None:
    """Reject a file with fewer lines, or bytes, than elements in its header: trimesh reads a text that is cut off.

    Raises
    ------
    BrokenMeshError : the file ends early.
    """
    declared = sum(int(count) for count in re.findall(rb"^element\s+\S+\s+(\d+)", head[0], re.MULTILINE))
    file.seek(head.end())
    is_text = head[1] == b"ascii"
    available = file.read().rstrip().count(b"\n") + 1 if is_text else file.seek(0, io.SEEK_END) - head.end()
    if available < declared:
        raise BrokenMeshError("ends early")


def _is_uneven(elements: Mapping[str, Any]) -> bool:
    """Return True if the lists of a binary file have different sizes, which trimesh infers from the file's length.

    It would read a triangle and a pentagon behind a quad as two quads.
    """
    tables = (element["data"] for element in elements.values())
    sizes = (table[name]["f0"] for table in tables for name in table.dtype.names if table.dtype[name].names)
    return any((size != size[:1]).any() for size in sizes)


def _read_mixed_ply(file: BinaryIO, head: re.Match[bytes]) -> RawMesh:
    """Read a binary PLY file whose faces are not all of one size, with meshio.

    Raises
    ------
    BrokenMeshError : the file ends early, or is of a kind that meshio misreads.
    """
    import meshio

    file.seek(0)
    data = file.read()
    plain = _PLAIN_FACES.search(data, 0, head.end())
    if plain is None:
        raise BrokenMeshError("ends early, or has faces of different sizes with more to them than corners")

    # Under the only name that meshio knows, and without the elements that it does not know.
    mesh = meshio.ply.read(io.BytesIO(data[: plain.start(2)] + b"vertex_indices\n" + data[plain.end(2) :]))
    polygons = [polygon for block in mesh.cells for polygon in block.data]
    if len(polygons) != int(plain[1]) or min(map(len, polygons)) < 3:
        raise BrokenMeshError("ends early, or has a face with fewer than 3 corners")
    normals = [mesh.point_data[name] for name in ("nx", "ny", "nz") if name in mesh.point_data]
    bent = np.stack(normals, axis=1) if len(normals) == 3 else None
    return _parts(mesh.points, _triangles(polygons), bent, _ply_coordinates(mesh.point_data))


def _ply_coordinates(columns: Mapping[str, Any]) -> NDArray[np.float64] | None:
    """Find texture coordinates among the columns of a PLY file's vertices, under any of their usual names."""
    for names in _PLY_COORDINATES:
        if all(name in columns for name in names):
            return np.stack([np.asarray(columns[name], np.float64).reshape(-1) for name in names], axis=1)
    return None


def _read_ply(file: BinaryIO) -> RawMesh:
    from trimesh.exchange.ply import load_ply

    head = _PLY_HEADER.match(file.read(_LONGEST_HEADER))
    if head is None:
        raise BrokenMeshError("does not begin as a PLY file does")
    _check_ply_size(file, head)
    file.seek(0)

    # The arrays themselves, since a mesh of trimesh's takes twice their memory.
    try:
        mesh = load_ply(file, skip_materials=True, fix_texture=False)
    except ValueError:
        if head[1] == b"ascii":
            raise
        return _read_mixed_ply(file, head)
    if "faces" not in mesh:
        raise BrokenMeshError("has no faces")
    elements = mesh["metadata"]["_ply_raw"]
    if head[1] != b"ascii":
        if _is_uneven(elements):
            return _read_mixed_ply(file, head)
    elif min(len(face) for name, table in elements["face"]["data"].items() if name in _CORNERS for face in table) < 3:
        raise BrokenMeshError("has a face with fewer than 3 corners")
    return _parts(
        mesh["vertices"],
        _triangles(mesh["faces"]),
        mesh.get("vertex_normals"),
        _ply_coordinates(dict(_columns(elements["vertex"]["data"]))),
    )


def _columns(table: Any) -> Iterator[tuple[str, Any]]:
    """Walk through the columns of a PLY element, which trimesh keeps differently for text and binary files."""
    names = table if isinstance(table, Mapping) else table.dtype.names
    return ((name, table[name]) for name in names)


_READERS: Mapping[str, tuple[str, Callable[[BinaryIO], RawMesh]]] = {
    ".ply": ("PLY", _read_ply),
    ".obj": ("OBJ", _read_obj),
    ".stl": ("STL", _read_stl),
    ".gltf": ("glTF", _read_gltf),
    ".glb": ("glTF", _read_gltf),
}

SUFFIXES = tuple(_READERS)
"""Suffixes of the files that `read` reads, in lower case."""


def read(path: Path) -> RawMesh:
    """Read all triangles of a file into one mesh, with the library for its suffix.

    Raises
    ------
    BrokenMeshError : the file is broken, or holds no triangles.
    OSError : the file cannot be opened.
    """
    from raytracer.core.compiler.lock import compiler_lock

    name, reader = _READERS[path.suffix.lower()]
    with compiler_lock, open_regular(path) as file, warnings.catch_warnings(), np.errstate(all="ignore"):
        if not file.peek(1):
            raise BrokenMeshError("is empty")

        # Before version 2.3, NumPy stopped at what is no number and warned.
        warnings.filterwarnings("error", "string or file could not be read", DeprecationWarning)
        try:
            return reader(file)
        except BrokenMeshError:
            raise
        except BrokenGltfError as error:
            raise BrokenMeshError(str(error)) from error
        except Exception as error:
            # A broken file raises anything, from KeyError to struct.error.
            reason = one_line(traceback.format_exception_only(error)[-1])
            raise BrokenMeshError(f"cannot be read as {name}: {reason}") from error
