"""Warn of exposure times that look like the number below a 1."""

from raytracer.analysis.explain.warnings import Photograph, PhotographicWarningKind
from raytracer.report.wording import compact_number
from raytracer.schema.warning_kind import Sentence, Warned

_LONGEST_SHUTTER = 30.0
"""Longest exposure time (s) on the dials of cameras; longer ones are held open by hand."""


class LongShutter(PhotographicWarningKind):
    """Exposures of photographs longer than cameras offer."""

    name = "shutters that are open for long"
    rank = 40
    long = Sentence(
        "the shutter is open for {seconds} s, longer than cameras offer: was 1/{seconds} s meant?",
        when="a photograph, of a camera with `iso` or `exposure`, is exposed for more than 30 s",
        remedy="write the time with its unit, as in `1/125 s`, if that was meant",
    )

    def find(self, subject: Photograph) -> Warned:
        camera = subject.view.spec.camera
        seconds = camera.timing().seconds()
        is_photograph = camera.iso_speed() is not None or camera.exposure is not None
        if is_photograph and seconds > _LONGEST_SHUTTER:
            yield self.record(self.long.fill(seconds=compact_number(seconds)))
