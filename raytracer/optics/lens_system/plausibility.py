"""Signs that a lens is not what was meant: surfaces that go through each other, stops that are hidden or too small."""

import math
from collections.abc import Iterator

import numpy as np

from raytracer.lenses.first_order import cardinal_points, heights
from raytracer.lenses.lens import Lens
from raytracer.lenses.stops import f_number_of, filled_stop

_THIRD_OF_A_STOP = 2.0 ** (1.0 / 6.0)
"""The finest step of a diaphragm's ring, as a factor of the f-number: numbers of lenses are rounded by less."""


def doubts(lens: Lens, shift: float = 0.0) -> list[str]:
    """List what is probably not meant in a lens, wide open, a clause each.

    Parameters
    ----------
    lens : focused at infinity, as what is published is of; a group that focuses changes the focal length as it moves.
    shift : how far that group is moved when surfaces are held against each other (mm).

    Raises
    ------
    ValueError : see `Lens.focused`.
    """
    found = [lens.reading.text] if lens.reading is not None and lens.reading.is_guess else []
    found += [
        f"surfaces {first} and {second} go through each other within their apertures"
        for first, second in lens.focused(shift).crossings()
    ]
    try:
        return [*found, *_of_the_stop(lens)]
    except ValueError:
        # What has no focal length, or lets no light through, is an error where it is used.
        return found


def _of_the_stop(lens: Lens) -> Iterator[str]:
    packed = lens.packed()
    filled, f_number = filled_stop(packed), f_number_of(packed)
    if filled * _THIRD_OF_A_STOP < 1.0:
        rim = int(np.argmax(np.abs(heights(packed, 1.0, 0.0, towards_film=True)) / packed.radius))
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
