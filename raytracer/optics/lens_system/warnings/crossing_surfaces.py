"""Warn of surfaces that go through each other."""

from raytracer.optics.lens_system.warnings import LensWarningKind, MountedLens
from raytracer.schema.warning_kind import Sentence, Warned


class CrossingSurfaces(LensWarningKind):
    """Glass that nobody could grind."""

    rank = 20
    crossing = Sentence(
        "surfaces {first} and {second} go through each other within their apertures",
        when="the vertices of a lens's surfaces are in order, but its glass is not, as it stands when focused: rays "
        "meet surfaces in order all the same, so it has a picture, but nobody could grind it",
        remedy="look for a wrong radius or thickness; of a table of another program, whether [thickness stands after "
        "or before](lenses.md#lenses-of-other-programs) each surface",
    )

    def find(self, subject: MountedLens) -> Warned:
        for first, second in subject.lens.focused(subject.shift).crossings():
            yield self.record(self.crossing.fill(first=first, second=second), "lens")
