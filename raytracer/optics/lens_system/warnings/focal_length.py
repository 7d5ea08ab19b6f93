"""Warn of focal lengths that are not the published ones."""

import math

from raytracer.optics.lens_system.first_order import cardinal_points
from raytracer.optics.lens_system.warnings import THIRD_OF_A_STOP, LensWarningKind, MountedLens
from raytracer.schema.warning_kind import Sentence, Warned


class FocalLength(LensWarningKind):
    """Lenses that were scaled, or of another focal length for another reason."""

    rank = 40
    other = Sentence(
        "its focal length is {length:.6g} mm, and {published:g} mm are published",
        when="the two are more than 12 % apart, where the lens is focused at infinity",
        remedy="look at what was scaled",
    )

    def find(self, subject: MountedLens) -> Warned:
        if subject.lens.focal_length is None:
            return
        published = abs(subject.lens.focal_length)
        try:
            length = abs(cardinal_points(subject.lens.packed()).focal_length)
        except ValueError:
            # What has no focal length is an error where it is used.
            return
        if not math.isclose(length, published, rel_tol=THIRD_OF_A_STOP - 1.0):
            yield self.record(self.other.fill(length=length, published=published), "lens")
