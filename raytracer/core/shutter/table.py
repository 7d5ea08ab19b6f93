"""Packed shutters, and kernels that sample the time of a ray in proportion to their transmission, and from flashes."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import kernel, optional
from raytracer.core.sampling.warp import first_above

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


# ---- Sampling

# Fraction of the times that is sampled from the flashes, if there are any.
_PULSED = 0.5


@optional
def sample_curve(curve, u):
    """Sample a time of a line's exposure, from 0 to 1, in proportion to its transmission; increasing with u."""
    return u


@sample_curve.register(TransmissionCurve)
def sample_curve_transmission_curve(curve, u):
    segment = _segment(curve.cumulative, u)
    a, b = curve.density[segment], curve.density[segment + 1]
    width = curve.time[segment + 1] - curve.time[segment]
    rest = u - curve.cumulative[segment]

    # Solve a x + (b - a) x^2 / (2 width) = rest in the form that does not cancel; Press et al. 2007, sec. 5.6.
    root = math.sqrt(max(0.0, a * a + 2.0 * (b - a) / width * rest))
    if a + root == 0.0:
        return curve.time[segment]
    return curve.time[segment] + min(width, 2.0 * rest / (a + root))


@kernel
def _segment(values, value):
    """Find the last segment of increasing values that begins at most at `value`, and has a width."""
    return first_above(values, 1, len(values) - 1, value) - 1


@kernel
def curve_density(curve, time):
    """Compute the density of `sample_curve` at a time from 0 to 1; 0 outside."""
    if not 0.0 <= time <= 1.0:
        return 0.0
    if curve is None:
        return 1.0
    segment = _segment(curve.time, time)
    share = (time - curve.time[segment]) / (curve.time[segment + 1] - curve.time[segment])
    return curve.density[segment] + share * (curve.density[segment + 1] - curve.density[segment])


@optional
def line_exposure(scan, x, y):
    """Return when the line of film position (x, y) begins to open, and its exposure, as fractions of the whole."""
    return 0.0, 1.0


@line_exposure.register(RollingShutter)
def line_exposure_rolling_shutter(scan, x, y):
    place = max(0.0, min(scan.lines, x if scan.across else y))
    if scan.is_reversed:
        place = scan.lines - place
    if scan.whole:
        place = min(math.floor(place), scan.lines - 1.0)
    return scan.delay * place / scan.lines, scan.width


@kernel
def _rounded(time):
    """Round a time to float32, as Embree's rays have it, so that hits solved in float64 are of the same time."""
    return np.float64(np.float32(max(0.0, min(1.0, time))))


@kernel
def sample_shutter_time(pulses, shutter, x, y, u):
    """Sample a time for film position (x, y), as a fraction of the whole exposure; returns it and its weight.

    The weight is the density of the line's transmission over that of sampling: 1 without flashes.  With them, half of
    the times are sampled from the pulses that the line sees, each as often as any other: the one-sample model.

    References: Veach 1997, sec. 9.2.4 (with the balance heuristic, the weight is the integrand's density over that of
    the mixture, here at most 2).
    """
    begin, width = line_exposure(shutter.scan, x, y)
    if pulses is None:
        return _rounded(begin + width * sample_curve(shutter.curve, u)), 1.0
    seen = 0
    for pulse in range(len(pulses.begin)):
        if min(pulses.end[pulse], begin + width) >= max(pulses.begin[pulse], begin):
            seen += 1
    # All times of a line that is open for less than a tick are equal, so flashes make no difference.
    if seen == 0 or width <= TICK:
        return _rounded(begin + width * sample_curve(shutter.curve, u)), 1.0

    # Sample a pulse, or the curve.
    if u < _PULSED:
        place = u / _PULSED * seen
        wanted = min(int(place), seen - 1)
        time, passed = 0.0, 0
        for pulse in range(len(pulses.begin)):
            first, last = max(pulses.begin[pulse], begin), min(pulses.end[pulse], begin + width)
            if last >= first:
                if passed == wanted:
                    time = first + (place - wanted) * (last - first)
                passed += 1
    else:
        time = begin + width * sample_curve(shutter.curve, (u - _PULSED) / (1.0 - _PULSED))
    time = _rounded(time)

    # Weight by the density over all ways to sample this time.
    wanted_density = curve_density(shutter.curve, max(0.0, min(1.0, (time - begin) / width))) / width
    if wanted_density == 0.0:
        return time, 0.0
    drawn = (1.0 - _PULSED) * wanted_density
    for pulse in range(len(pulses.begin)):
        first, last = max(pulses.begin[pulse], begin), min(pulses.end[pulse], begin + width)
        if last >= first and pulses.begin[pulse] <= time <= pulses.end[pulse]:
            drawn += _PULSED / (seen * max(last - first, TICK))
    return time, wanted_density / drawn
