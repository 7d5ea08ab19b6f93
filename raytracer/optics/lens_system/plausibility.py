"""Warnings about implausible lenses: surfaces that intersect, stops that are hidden or too small."""

import math
from collections.abc import Iterator

import numpy as np

from raytracer.optics.lens_system.first_order import cardinal_points, paraxial_heights
from raytracer.optics.lens_system.lens import Lens
from raytracer.optics.lens_system.stops import f_number_of, filled_stop_fraction

_THIRD_OF_A_STOP = 2.0 ** (1.0 / 6.0)
"""The finest step of a diaphragm's ring, as a factor of the f-number: numbers of lenses are rounded by less."""


def lens_warnings(lens: Lens, shift: float = 0.0) -> list[str]:
    """List what is implausible in a lens, wide open, a clause each.

    Parameters
    ----------
    lens : focused at infinity, as published numbers are; a group that focuses changes the focal length as it moves.
    shift (mm) : movement of that group towards the scene when surfaces are tested for intersection.

    Raises
    ------
    ValueError : see `Lens.focused`.
    """
    messages = [lens.reading.text] if lens.reading is not None and lens.reading.is_guess else []
    messages += [
        f"surfaces {first} and {second} go through each other within their apertures"
        for first, second in lens.focused(shift).crossings()
    ]
    try:
        return [*messages, *_stop_warnings(lens)]
    except ValueError:
        # What has no focal length, or lets no light through, is an error where it is used.
        return messages


def _stop_warnings(lens: Lens) -> Iterator[str]:
    """Compare the stop and the focal length with what rays and the published numbers say."""
    packed = lens.packed()
    filled, f_number = filled_stop_fraction(packed), f_number_of(packed)
    if filled * _THIRD_OF_A_STOP < 1.0:
        rim = int(np.argmax(np.abs(paraxial_heights(packed, 1.0, 0.0, towards_film=True)) / packed.radius))
        yield (
            f"its stop, surface {packed.stop + 1}, is hidden: the rim of surface {rim + 1} leaves light of the axis "
            f"{100.0 * filled:.2g} % of the stop's diameter, so that it has no effect until it is closed to "
            f"f/{f_number:.3g}"
        )
    elif lens.f_number is not None and f_number > _THIRD_OF_A_STOP * lens.f_number:
        yield (
            f"its stop, surface {packed.stop + 1}, blocks light: it opens to f/{f_number:.3g}, and f/{lens.f_number:g} "
            "is published"
        )
    if lens.focal_length is not None:
        length = abs(cardinal_points(packed).focal_length)
        if not math.isclose(length, abs(lens.focal_length), rel_tol=_THIRD_OF_A_STOP - 1.0):
            yield f"its focal length is {length:.6g} mm, and {abs(lens.focal_length):g} mm are published"
