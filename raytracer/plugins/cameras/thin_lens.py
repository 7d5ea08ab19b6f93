"""Thin lens camera: sharp in one plane, blurred before and behind it.

Its ray, which pinholes of a real size and camera arrays share, is in `base/thin_lens_ray.py`.

In a scene:

    camera: {type: thin_lens, look_from: [13, 2, 3], look_at: [0, 0, 0], vfov: 20,
             focus_distance: 10, defocus_angle: 0.6}
    camera: {type: thin_lens, look_from: [0, 1.6, 4], look_at: [0, 1, 0], sensor: full_frame, focal_length: 50 mm,
             f_number: 1.4, focus_distance: 2, shutter: 1/125 s, iso: 400}
"""

from typing import Literal

from raytracer.plugins.cameras.base.ideal import IdealLensSpec
from raytracer.plugins.cameras.base.interface import NO_ASSETS, Assets
from raytracer.plugins.cameras.base.perspective_camera import PerspectiveCamera


class ThinLens(IdealLensSpec):
    """An ideal lens: what lies in the plane of focus is sharp, what does not is a circle of confusion.

    With a focal length, the film lies where the plane of focus is sharp, by Gauss's equation 1/f = 1/z_i + 1/z_o: the
    nearer it is, the farther the film, the narrower the field of view, and the darker the picture.  A field of view
    that is given as an angle is that of the picture, wherever its focus is.  With none of `defocus_angle`, `aperture`
    and `f_number`, or where they make no opening, the lens is a pinhole and costs as little.

    Exposed by `iso`, the lens loses no light: what a patch of the plane of focus sends through it arrives in the image
    of that patch.  On the axis the film then gets E = pi L / (4 N^2 (1 + m)^2) whatever the f-number, as behind lenses
    that are corrected for coma (Abbe's sine condition), so each stop is a factor of 2.  With `pupil: flat` it gets what
    an even disc of light in the plane of the lens would send: E = pi L / (1 + 4 N^2 (1 + m)^2), and Foote's formula off
    the axis; the two agree where N is large.

    References: Kingslake 1983, "Optical System Design", ch. 7; Foote 1915, "Illumination from a Radiating Disk",
    Bull. Bureau of Standards 12; Shirley et al. 2024, "Ray Tracing in One Weekend", sec. 13; Pharr et al. 2023,
    sec. 5.2.3.
    """

    type: Literal["thin_lens"] = "thin_lens"

    def pack(self, width: int, height: int, assets: Assets = NO_ASSETS) -> PerspectiveCamera:
        """Pack the camera with its lens, or without one where the aperture is 0."""
        return self.pack_with_lens(width, height, self.pack_lens(width, height, assets))
