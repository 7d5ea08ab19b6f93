"""Warn of apertures that set the exposure alone."""

import math

from raytracer.analysis.explain.warnings import Photograph, PhotographicWarningKind
from raytracer.report.wording import compact_number
from raytracer.schema.warning_kind import Sentence, Warned


class ApertureWithoutBlur(PhotographicWarningKind):
    """F-numbers of cameras that see through a point."""

    name = "apertures that blur nothing"
    rank = 30
    point = Sentence(
        "the aperture of f/{f_number} sets the exposure but blurs nothing, since a {camera} camera sees through a "
        "point",
        when="a camera without a lens has an `f_number`",
        remedy="a `thin_lens` camera, if what is out of focus should blur",
    )

    def find(self, subject: Photograph) -> Warned:
        f_number = subject.numbers.get("f_number", math.nan)
        if subject.view.pupil() == 0.0 and math.isfinite(f_number):
            camera = subject.view.spec.camera.type
            yield self.record(self.point.fill(f_number=compact_number(f_number), camera=camera))
