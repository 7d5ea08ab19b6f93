"""Mesh: triangles from a file (.obj, .ply, .stl, .gltf, .glb).

In a scene:

    - {type: mesh, file: bunny.ply, smooth: true, material: clay}
"""

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from raytracer.geometry import padded
from raytracer.primitives.triangles import SmoothTriangles, Triangles
from raytracer.shapes.affine import Matrix, is_mirrored, normals, points, references
from raytracer.shapes.interface import Assets, ShapeSpec


class Mesh(ShapeSpec):
    """Triangles from a file, with flat faces or with shading normals that run smoothly over them."""

    loads: ClassVar[dict[str, str]] = {"file": "mesh"}

    type: Literal["mesh"] = "mesh"
    file: str = Field(description="mesh file (.obj .ply .stl .gltf .glb), relative to the scene", min_length=1)
    smooth: bool = Field(default=False, description="interpolate the file's vertex normals, or make some by angle")

    def pack(self, matrix: Matrix, material: int, assets: Assets) -> Triangles | SmoothTriangles:
        """One row a triangle."""
        mesh = assets["file"]
        faces = mesh.faces[:, ::-1] if is_mirrored(matrix) else mesh.faces
        rows = padded(points(matrix, mesh.vertices), np.float32), padded(faces, np.uint32)
        flat = Triangles(*rows, references(material, len(faces)))
        if not self.smooth:
            return flat
        return SmoothTriangles(*flat, np.ascontiguousarray(normals(matrix, mesh.vertex_normals()), np.float32))
