"""Mesh: triangles from a file (.obj, .ply, .stl, .gltf, .glb), or from several, one for each of some times.

In a scene:

    - {type: mesh, file: bunny.ply, smooth: true, material: clay}

A mesh that changes its form, its vertices going straight from one frame to the next:

    - {type: mesh, frames: [{time: 0, file: flag0.ply}, {time: 1/24 s, file: flag1.ply}], material: cloth}
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from raytracer.core.geometry import pad_buffer
from raytracer.core.motion.trajectory import uniform_grid
from raytracer.core.primitives.triangles import (
    DeformingSmoothTriangles,
    DeformingTriangles,
    SmoothTriangles,
    TextureCoordinates,
    Triangles,
)
from raytracer.core.shutter.table import Shutter
from raytracer.plugins.shapes.base import affine
from raytracer.plugins.shapes.base.interface import Assets, ShapeSpec
from raytracer.schema.fields import Time
from raytracer.schema.spec import Spec, field_error


class Frame(Spec):
    """The form of a mesh at a time."""

    time: Time = Field(description="time of the scene (s)")
    file: str = Field(description="mesh file with the same triangles as that of the other frames", min_length=1)


class Mesh(ShapeSpec):
    """Triangles from a file, with flat faces or with shading normals that run smoothly over them.

    Smooth meshes lose no light, however coarse: what a shading normal sends to the wrong side of a face is turned to
    the right one. Outlines stay those of the faces, and so does where light from a lamp ends.

    An object without a `material` takes those of a glTF file, face by face: `principled` ones with their textures, cut
    out by the base colour's alpha where the file's alphaMode says so. Both sides of a face are seen, whatever
    `doubleSided` says, which is about what the face emits. Vertex colours, occlusion, clear coats and other extensions
    than transmission, ior, emissive_strength and texture_transform are left out.
    """

    loads: ClassVar[dict[str, str]] = {"file": "mesh"}
    is_closed: ClassVar[bool] = True

    type: Literal["mesh"] = "mesh"
    file: str | None = Field(
        default=None, description="mesh file (.obj .ply .stl .gltf .glb), relative to the scene", min_length=1
    )
    frames: tuple[Frame, ...] | None = Field(
        default=None,
        description="instead of a file: at least two forms, [{time, file}, ...], in the order of their times; the "
        "first and the last are held before and after",
    )
    smooth: bool = Field(default=False, description="interpolate the file's vertex normals, or make some by angle")

    @model_validator(mode="after")
    def _has_a_form(self) -> "Mesh":
        if (self.file is None) == (self.frames is None):
            raise ValueError(
                "needs a file or frames" if self.file is None else "takes either a file or frames, not both"
            )
        if self.frames is not None:
            if len(self.frames) < 2:
                field_error("frames", "a mesh that changes its form needs at least two frames")
            for number, (before, after) in enumerate(pairwise(self.frames), start=1):
                if after.time <= before.time:
                    field_error(
                        ("frames", number, "time"),
                        f"must be later than the frame before, {before.time:g} s, got {after.time:g} s",
                    )
        return self

    def files(self) -> dict[tuple[str | int, ...], tuple[str, str]]:
        frames = enumerate(self.frames or ())
        return super().files() | {("frames", number, "file"): (frame.file, "mesh") for number, frame in frames}

    def bounds(self, assets: Assets) -> NDArray[np.float64]:
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        for path in self.files():
            mesh = assets[".".join(map(str, path))]
            # A file may hold vertices that no triangle has.
            used = np.zeros(len(mesh.vertices), bool)
            used[mesh.faces.ravel()] = True
            columns = [column[used] for column in mesh.vertices.T]
            low = np.minimum(low, [column.min() for column in columns])
            high = np.maximum(high, [column.max() for column in columns])
        return np.stack([low, high])

    def pack(self, matrix: affine.Matrix, material: int, assets: Assets) -> Any:
        """Pack one row a triangle; of a mesh with frames, as it is at time 0."""
        return self.pack_moving(matrix, material, assets, Shutter(0.0, 0.0))

    def at_time(self, time: float) -> "Mesh":
        """Return the mesh at a time of the scene (s): of frames, in the form of the one that is nearest in time."""
        still = super().at_time(time)
        if self.frames is None:
            return still
        nearest = min(self.frames, key=lambda frame: abs(frame.time - time))
        return still.model_copy(update={"frames": None, "file": nearest.file})

    def pack_moving(self, matrix: affine.Matrix, material: int, assets: Assets, shutter: Shutter) -> Any:
        """Pack one row a triangle, moving where frames differ while the shutter is open.

        Raises
        ------
        ValueError : frames whose triangles are not the same.
        """
        if self.frames is None:
            return self._still(assets["file"], matrix, material)
        meshes = [assets[f"frames.{number}.file"] for number in range(len(self.frames))]
        for number, mesh in enumerate(meshes):
            if len(mesh.vertices) != len(meshes[0].vertices) or not np.array_equal(mesh.faces, meshes[0].faces):
                raise ValueError(
                    f"the file of frames[{number}] has not the same triangles as that of frames[0], so it is not known "
                    "which vertex goes where"
                )

        # Where nothing moves while the shutter is open, it is a mesh like others.
        frame_times = [frame.time for frame in self.frames]
        times = uniform_grid(frame_times, shutter)
        forms = [mesh.vertices for mesh in meshes]
        vertices = _between(frame_times, forms, times)
        bent = _between(frame_times, [mesh.vertex_normals() for mesh in meshes], times) if self.smooth else None
        if all(np.array_equal(form, vertices[0]) for form in vertices) and (
            bent is None or all(np.array_equal(form, bent[0]) for form in bent)
        ):
            first = meshes[0]._replace(vertices=vertices[0], normals=None if bent is None else bent[0])
            return self._still(first, matrix, material)
        faces = meshes[0].faces[:, ::-1] if affine.is_mirrored(matrix) else meshes[0].faces
        moved = pad_buffer(np.stack([affine.transform_points(matrix, form) for form in vertices]), np.float32)
        uv = None if meshes[0].uv is None else TextureCoordinates(np.ascontiguousarray(meshes[0].uv, np.float32))
        flat = DeformingTriangles(
            moved, pad_buffer(faces, np.uint32), affine.material_references(material, len(faces)), uv
        )
        if bent is None:
            return flat
        turned = [affine.transform_normals(matrix, form).astype(np.float32) for form in bent]
        return DeformingSmoothTriangles(*flat, np.ascontiguousarray(np.stack(turned)))

    def _still(self, mesh: Any, matrix: affine.Matrix, material: int) -> Triangles | SmoothTriangles:
        faces = mesh.faces[:, ::-1] if affine.is_mirrored(matrix) else mesh.faces
        rows = pad_buffer(affine.transform_points(matrix, mesh.vertices), np.float32), pad_buffer(faces, np.uint32)
        uv = None if mesh.uv is None else TextureCoordinates(np.ascontiguousarray(mesh.uv, np.float32))
        flat = Triangles(*rows, affine.material_references(material, len(faces)), uv)
        if not self.smooth:
            return flat
        return SmoothTriangles(
            *flat, np.ascontiguousarray(affine.transform_normals(matrix, mesh.vertex_normals()), np.float32)
        )


def _between(
    frame_times: Sequence[float], forms: Sequence[NDArray[np.float64]], times: Sequence[float]
) -> list[NDArray[np.float64]]:
    """Interpolate forms (n, 3) at some times, those of the frames themselves bit for bit."""
    result = []
    for time in times:
        after = int(np.searchsorted(frame_times, time, side="right"))
        first, last = max(after - 1, 0), min(after, len(forms) - 1)
        form = forms[first]
        if last > first and frame_times[first] < time:
            fraction = (time - frame_times[first]) / (frame_times[last] - frame_times[first])
            form = form + fraction * (forms[last] - form)
        result.append(form)
    return result
