"""Packed shutters, as kernels read them."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

TICK = 2.0**-23
"""Fraction of the exposure within which two times are equal to paths, whose times are float32 numbers."""


class TransmissionCurve(NamedTuple):
    """The transmission of a line over its exposure, from 0 to 1.

    Attributes
    ----------
    time : float64 (n,), increasing.
    density : float64 (n,), linear between the times, with an integral of 1.
    cumulative : float64 (n,), the integral of the density.
    """

    time: NDArray[np.float64]
    density: NDArray[np.float64]
    cumulative: NDArray[np.float64]


class RollingShutter(NamedTuple):
    """Lines that are exposed one after another.

    Attributes
    ----------
    delay : time of the readout from edge to edge, as a fraction of the whole exposure.
    width : exposure of each line, as a fraction of the whole.
    lines : the number of lines from edge to edge.
    across : True if lines are columns.
    is_reversed : True if the last line of the picture is the first in time.
    whole : True if all of a line is exposed at one time.
    """

    delay: float
    width: float
    lines: float
    across: bool
    is_reversed: bool
    whole: bool


class Pulses(NamedTuple):
    """The times at which flashes shine: begin and end (n,) float64, fractions of the exposure, may lie outside."""

    begin: NDArray[np.float64]
    end: NDArray[np.float64]


class Shutter(NamedTuple):
    """The span of scene time in which light is gathered (s), and how; open and close are equal for a moment.

    Attributes
    ----------
    open, close : times of the scene (s).
    curve : the TransmissionCurve, None if all lines are fully open at once.
    scan : the RollingShutter, None if all of the film is exposed at the same time.
    pulses : the Pulses of flashes from which times are sampled too, or None.
    """

    open: float
    close: float
    curve: Any = None
    scan: Any = None
    pulses: Any = None


def pulse_interval(shutter: Shutter, begin: float, end: float) -> tuple[float, float]:
    """Convert two times of the scene (s) to fractions of the exposure that Embree rays can have.

    They are float32 numbers, so that a time between them that is rounded to float32 stays between them.  A pulse that
    is shorter than the spacing of such numbers is made as long as that.
    """
    whole = shutter.close - shutter.open
    # A time too far outside for a float32 number becomes infinite.
    with np.errstate(over="ignore"):
        first = float(np.float32((begin - shutter.open) / whole))
        last = float(np.float32((end - shutter.open) / whole))
    return first, max(last, float(np.float32(first + TICK)))
