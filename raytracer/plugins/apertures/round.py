"""Round aperture: a disc, or an ellipse.

In a scene:

    camera: {type: thin_lens, look_from: [0, 1, 4], look_at: [0, 1, 0], vfov: 30, aperture: 40 mm,
             aperture_shape: {type: round, anamorphic: 2}}
"""

from typing import Literal

from raytracer.plugins.apertures.base.interface import ApertureSpec, Assets


class Round(ApertureSpec):
    """A circle, as of a lens wide open; stretched, an ellipse."""

    type: Literal["round"] = "round"

    def shape(self, assets: Assets) -> None:
        return None
