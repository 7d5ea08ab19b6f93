"""Warn of pictures larger than the image circle of their lens."""

from raytracer.optics.lens_system.warnings import LensWarningKind, MountedLens
from raytracer.schema.warning_kind import Sentence, Warned

_ROUNDING = 0.2
"""Difference (mm) that says nothing: sensors and image circles are rounded to a tenth of a millimetre."""


class ImageCircle(LensWarningKind):
    """Pictures whose corners their lens was not made for."""

    rank = 50
    exceeded = Sentence(
        "the picture is {diagonal:.3g} mm across its corners, and the image circle of the lens {circle:.3g} mm: beyond "
        "it the picture is dark, or worse than the lens was made for",
        when="the film of a `lens` camera is larger than the picture that its lens was made for",
        remedy="a smaller `sensor`, or another lens",
    )

    def find(self, subject: MountedLens) -> Warned:
        circle = subject.lens.image_circle
        if circle is not None and subject.diagonal > circle + _ROUNDING:
            text = self.exceeded.fill(diagonal=subject.diagonal, circle=circle)
            yield self.record(text, subject.film_key)
