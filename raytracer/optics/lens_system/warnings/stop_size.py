"""Warn of stops that a rim hides, and of those that open less far than is published."""

import numpy as np

from raytracer.optics.lens_system.first_order import paraxial_heights
from raytracer.optics.lens_system.lens_setup import f_number_of, filled_stop_fraction
from raytracer.optics.lens_system.warnings import THIRD_OF_A_STOP, LensWarningKind, MountedLens
from raytracer.schema.warning_kind import Sentence, Warned


class StopSize(LensWarningKind):
    """Stops that are not what limits the light along the axis, or limit it too much."""

    rank = 30
    hidden = Sentence(
        "its stop, surface {stop}, is hidden: the rim of surface {rim} leaves light of the axis {percent:.2g} % of the "
        "stop's diameter, so that it has no effect until it is closed to f/{f_number:.3g}",
        when="another rim takes more than a third of a stop (a factor of 1.12 in diameter) from what the lens's stop "
        "would let through along the axis",
        remedy="a smaller `aperture` of the stop, larger ones of the rims",
    )
    blocking = Sentence(
        "its stop, surface {stop}, blocks light: it opens to f/{f_number:.3g}, and f/{published:g} is published",
        when="the lens opens less far than its file's `f_number`, by more than a third of a stop",
        remedy="look at the `aperture` of the stop, which is a diameter",
    )

    def find(self, subject: MountedLens) -> Warned:
        lens = subject.lens
        try:
            packed = lens.packed()
            filled, f_number = filled_stop_fraction(packed), f_number_of(packed)
        except ValueError:
            # What has no focal length, or lets no light through, is an error where it is used.
            return
        stop = packed.stop + 1
        if filled * THIRD_OF_A_STOP < 1.0:
            rim = int(np.argmax(np.abs(paraxial_heights(packed, 1.0, 0.0, towards_film=True)) / packed.radius)) + 1
            text = self.hidden.fill(stop=stop, rim=rim, percent=100.0 * filled, f_number=f_number)
        elif lens.f_number is not None and f_number > THIRD_OF_A_STOP * lens.f_number:
            text = self.blocking.fill(stop=stop, f_number=f_number, published=lens.f_number)
        else:
            return
        yield self.record(text, "lens")
