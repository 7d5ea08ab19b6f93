"""Warn of light fields without room for a sub-image."""

from raytracer.plugins.cameras.base.warnings import MicrolensFit, MicrolensWarningKind
from raytracer.report.wording import compact_number
from raytracer.schema.warning_kind import Sentence, Warned


class NoViews(MicrolensWarningKind):
    """Pictures that hold no views."""

    rank = 10
    small = Sentence(
        "the picture of {width} x {height} pixels has no room for sub-images of {spacing} pixels side by side, and "
        "so holds no views: {remedy}",
        when="the film of a `light_field` camera is smaller than a sub-image behind its microlenses",
        remedy="give a film with more pixels, or smaller microlenses",
    )

    def find(self, subject: MicrolensFit) -> Warned:
        layout = subject.layout
        if not layout.holds_views:
            text = self.small.fill(
                width=layout.width, height=layout.height, spacing=compact_number(subject.array.spacing)
            )
            yield self.record(text, "microlenses")
