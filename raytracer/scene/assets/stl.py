"""Read STL files, of bytes or of text; equal corners become one vertex, since the format has no indices.

Reference: 3D Systems, "StereoLithography Interface Specification", 1989.
"""

import io
import re
from typing import BinaryIO

import numpy as np

from raytracer.scene.assets.raw_mesh import RawMesh, parse_numbers, weld
from raytracer.util.safe_open import BrokenFileError

_HEADER_BYTES = 84
_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])

# The first and the last line of a solid, with its name, which may be any word of the format.
_SOLID = re.compile(rb"^[ \t]*(?:end)?solid\b.*$", re.MULTILINE)

# Where the end of a solid is looked for, so that a large file that is no text is not read as one.
_SEARCHED = 1 << 16


def read_stl(file: BinaryIO) -> RawMesh:
    """Read all solids of a file into one mesh.

    Raises
    ------
    BrokenFileError : it is neither text nor as long as its header says, or has facets that are no triangles.
    """
    header = file.read(_HEADER_BYTES)
    length = file.seek(0, io.SEEK_END)
    count = int.from_bytes(header[80:], "little")
    if length == _HEADER_BYTES + count * _FACET.itemsize:
        file.seek(_HEADER_BYTES)
        corners = np.frombuffer(file.read(), _FACET)["corners"].reshape(-1, 3)
    else:
        corners = _read_text(file, length)
    first, vertex = weld(corners)
    return RawMesh(corners[first].astype(np.float64), vertex.reshape(-1, 3))


def _read_text(file: BinaryIO, length: int) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Read the corners (n, 3) of all facets of a text."""
    for start in (0, max(0, length - _SEARCHED)):
        file.seek(start)
        if b"endsolid" in file.read(_SEARCHED).lower():
            break
    else:
        raise BrokenFileError("ends early, or is neither text nor as long as its binary header says")
    file.seek(0)
    facets, solids = _SOLID.subn(b"", file.read().lower())
    if solids % 2:
        raise BrokenFileError("ends early")
    numbers = parse_numbers(b" ".join(re.findall(rb"vertex([^\n]*)", facets)))
    if numbers.size != 9 * facets.count(b"endfacet"):
        raise BrokenFileError("ends early, or has facets that are not triangles")
    return numbers.reshape(-1, 3)
