"""Warn of focal lengths that look as if they were written in metres."""

from raytracer.analysis.explain.warnings import Photograph, PhotographicWarningKind
from raytracer.report.wording import compact_number
from raytracer.schema.warning_kind import Sentence, Warned

_SHORTEST_FOCAL_LENGTH = 1.0
"""Least focal length (mm) of any camera's lens; those of telephones have a few millimetres."""


class ShortFocalLength(PhotographicWarningKind):
    """Focal lengths shorter than any camera's."""

    name = "focal lengths that are very short"
    rank = 50
    short = Sentence(
        "{key} is {length} mm, shorter than any camera's, and a plain number is mm: was {length} m meant?",
        when="`focal_length` or `equivalent_focal_length` is below 1 mm",
        remedy="write it in millimetres, or with its unit",
    )

    def find(self, subject: Photograph) -> Warned:
        for key in ("focal_length", "equivalent_focal_length"):
            length = getattr(subject.view.spec.camera, key, None)
            if length is not None and length < _SHORTEST_FOCAL_LENGTH:
                yield self.record(self.short.fill(key=key, length=compact_number(length)))
