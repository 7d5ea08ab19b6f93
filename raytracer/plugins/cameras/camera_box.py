"""A box of cameras round an object: a light slab on each face; or on the faces of a box, from which they look out.

In a scene, 5 x 5 cameras on each face of a cube of 4 m round the origin, and 3 x 3 on the walls of a case in a room:

    camera: {type: camera_box, rows: 5, columns: 5, size: [4, 4, 4], look_from: [0, 0, 1], look_at: [0, 0, 0], vfov: 60}
    camera: {type: camera_box, rows: 3, columns: 3, size: [0.4, 0.4, 0.4], facing: outward, look_from: [0, 1.5, 0],
             look_at: [0, 1.5, -1], vfov: 100}
"""

from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from raytracer.plugins.cameras.base import views
from raytracer.plugins.cameras.base.rig import RigSpec, RigViews, place_cells
from raytracer.schema.fields import Count, Quantity, Triple, Vector
from raytracer.schema.spec import field_error

Face: TypeAlias = Literal["front", "right", "back", "left", "top", "bottom"]
FACES: tuple[Face, ...] = ("front", "right", "back", "left", "top", "bottom")


class CameraBox(RigSpec):
    """Rows and columns of equal cameras on each face of a box, that look at right angles to it, inward or outward.

    The box lies about `look_at`, or about `look_from` where the cameras look outward; its front is the face at the side
    of `look_from`, or towards `look_at`.  The cameras of a face stand in the middles of equal parts of it and look in
    parallel.  Films of cameras that look inward are shifted so that all cameras of a face see the plane through the
    middle of the box alike, as those of a `camera_array`.  The picture of all holds the faces below each other, and the
    views of each side by side, each of the film's width x height.

    References: Gortler et al. 1996, "The Lumigraph", sec. 2.1 (a cube round the object); Levoy and Hanrahan 1996,
    "Light Field Rendering", sec. 2 (arrangements of light slabs).
    """

    type: Literal["camera_box"] = "camera_box"
    rows: Annotated[int, Count(1, views.MAX_VIEWS)] = Field(description="rows of cameras on a face")
    columns: Annotated[int, Count(1, views.MAX_VIEWS)] = Field(description="cameras in a row of a face")
    size: Annotated[Vector, Triple(Quantity("length", low=0.0, low_open=True), "a size", single=True)] = Field(
        description="width, height and depth of the box (m), as seen from `look_from`, or one length for all"
    )
    faces: tuple[Face, ...] = Field(
        default=FACES,
        min_length=1,
        description="those that have cameras, in the order of the picture; default: all",
    )

    @model_validator(mode="after")
    def _has_each_face_once(self) -> Any:
        if len(set(self.faces)) < len(self.faces):
            field_error("faces", "must name each face once")
        return self

    def reach(self) -> float:
        return 0.5 * self.size[2]

    def rig(self) -> RigViews:
        poses, shears = zip(*(self._face(face) for face in self.faces), strict=True)
        return RigViews(np.concatenate(poses), np.concatenate(shears))

    def _face(self, face: Face) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the poses and the shifts of the films of the cameras of a face."""
        sight, sign = self.sight(), self.outward_sign()
        axes = np.array([sight.right, sight.up, sight.forward])
        right, up, ahead = axes
        out = {"front": sign * ahead, "back": -sign * ahead, "right": right, "left": -right, "top": up, "bottom": -up}
        forward = sign * out[face]
        across = right if face in ("top", "bottom") else np.cross(forward, up)
        upward = np.cross(across, forward)
        # Lengths of the box along the axes of this face.
        wide, high, deep = (np.abs(axes @ axis) @ np.array(self.size) for axis in (across, upward, forward))
        u, v = np.meshgrid(
            place_cells(-0.5 * wide, 0.5 * wide, self.columns), place_cells(-0.5 * high, 0.5 * high, self.rows)[::-1]
        )
        place = self.center() + 0.5 * deep * out[face] + u[..., None] * across + v[..., None] * upward
        turned = np.broadcast_to(np.array([across, upward, forward]), (*u.shape, 3, 3))
        pose = np.concatenate([place[..., None, :], turned], axis=2)
        shear = np.stack([u, v], axis=-1) * (0.0 if self.facing == "outward" else -2.0 / deep)
        return pose, shear
