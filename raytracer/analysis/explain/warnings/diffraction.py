"""Warn where diffraction, which is left out, would soften a real picture."""

import math

from raytracer.analysis.explain.warnings import Photograph, PhotographicWarningKind
from raytracer.report.wording import compact_number
from raytracer.schema.warning_kind import Sentence, Warned


class Diffraction(PhotographicWarningKind):
    """Airy discs wider than a pixel."""

    name = "pictures sharper than diffraction lets them be"
    rank = 10
    soft = Sentence(
        "diffraction is left out: at the working f-number f/{f_number} the Airy disc of green light (550 nm) is {disc} "
        "um wide, and a pixel {pixel} um, so a real picture would be softer",
        when="the camera has an aperture and a film with a size, and the Airy disc is wider than a pixel",
        remedy="a wider aperture or fewer pixels; or nothing, where a real picture's softness is not wanted",
    )

    def find(self, subject: Photograph) -> Warned:
        numbers = subject.numbers
        disc, pixel = numbers.get("airy_disc_um", math.nan), numbers.get("pixel_pitch_um", math.nan)
        if disc > pixel:
            f_number = compact_number(numbers["image_distance_mm"] / numbers["entrance_pupil_mm"])
            yield self.record(self.soft.fill(f_number=f_number, disc=compact_number(disc), pixel=compact_number(pixel)))
