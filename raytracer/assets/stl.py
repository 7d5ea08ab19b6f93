"""STL meshes, ASCII or binary; equal corners are made one vertex, since the format has no indices.

References: M. Burns, "Automated Fabrication", 1993, section 6.5.
"""

import re
from pathlib import Path

import numpy as np

from raytracer.assets.polygons import BrokenMeshError, Floats, Parts, parse_floats, weld

_HEADER = np.dtype([("text", "S80"), ("triangles", "<u4")])
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_CORNER = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)


def _read_text(data: bytes) -> Floats:
    corners = [b" ".join(match) for match in _CORNER.findall(data)]
    points = parse_floats(b" ".join(corners)).reshape(len(corners), 3)
    facets = len(re.findall(rb"\bendfacet\b", data, re.IGNORECASE))
    if len(points) != 3 * facets or not re.search(rb"\bendsolid\b", data, re.IGNORECASE):
        raise BrokenMeshError("ends early, or has facets that are not triangles")
    return points


def read(path: Path) -> Parts:
    """Vertices and triangles; the normals, which are those of the triangles, are left out.

    Raises
    ------
    BrokenMeshError : the file is broken or ends early.
    OSError : the file cannot be read.
    """
    data = np.memmap(path, dtype=np.uint8, mode="r")
    triangles = -1
    if len(data) >= _HEADER.itemsize:
        triangles = int(data[: _HEADER.itemsize].view(_HEADER)[0]["triangles"])
    size = _HEADER.itemsize + triangles * _TRIANGLE.itemsize

    # A binary file may begin with "solid" as those of text do, but not have their length by chance.
    if triangles < 0 or (len(data) != size and data[:512].tobytes().lstrip().lower().startswith(b"solid")):
        points = _read_text(data.tobytes())
    elif len(data) < size:
        raise BrokenMeshError("ends early")
    else:
        points = data[_HEADER.itemsize : size].view(_TRIANGLE)["corners"].reshape(-1, 3)
    first, vertex = weld(points)
    return Parts(points[first].astype(np.float64), vertex.reshape(-1, 3), None)
