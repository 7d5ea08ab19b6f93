"""Warn of tables of other programs that may mean two lenses."""

from raytracer.optics.lens_system.lens import READING
from raytracer.optics.lens_system.warnings import LensWarningKind, MountedLens
from raytracer.schema.warning_kind import Sentence, Warned


class AmbiguousTable(LensWarningKind):
    """Lenses of which the more likely one was taken."""

    rank = 10
    guess = Sentence(
        READING,
        when="a [lens table](lenses.md#lenses-of-other-programs) may mean two lenses, and one of them is more likely",
        remedy="`rt lens import TABLE --thickness after -o LENS.yaml`, and that in its place",
    )

    def find(self, subject: MountedLens) -> Warned:
        reading = subject.lens.reading
        if reading is not None and reading.is_guess:
            yield self.record(self.guess.fill(place=reading.place, reason=reading.reason), "lens")
