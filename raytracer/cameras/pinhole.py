"""Pinhole camera: everything is sharp.

In a scene:

    camera: {type: pinhole, look_from: [0, 1, 4], look_at: [0, 1, 0], vfov: 40}
"""

from typing import Literal

from raytracer.cameras.perspective import PerspectiveCamera, PerspectiveSpec


class Pinhole(PerspectiveSpec):
    """Rays through one point: perspective without blur."""

    type: Literal["pinhole"] = "pinhole"

    def pack(self, width: int, height: int) -> PerspectiveCamera:
        """The camera without a lens."""
        return self.camera(width, height, None)
