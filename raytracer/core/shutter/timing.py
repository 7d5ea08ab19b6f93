"""The timing of an exposure in seconds of the scene, when which line of the film is open and how far; and its packing.

A picture is a mean over the time for which a line is exposed: the integral of radiance times transmission over time,
divided by `Timing.seconds`, the integral of transmission.
"""

from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raytracer.core.shutter.table import Pulses, RollingShutter, Shutter, TransmissionCurve

Profile: TypeAlias = tuple[tuple[float, float], ...]


class Timing(NamedTuple):
    """The timing of an exposure, in seconds.

    Attributes
    ----------
    opens, closes : times of the scene at which the first line begins to open, and is closed again.
    profile : (time after the line begins to open, transmission), linear between these; None for a line that is fully
        open from the one to the other.
    readout, direction, curtain : as in `ShutterSpec`.
    """

    opens: float
    closes: float
    profile: Profile | None = None
    readout: float = 0.0
    direction: str = "down"
    curtain: str = "electronic"

    def span(self) -> Shutter:
        """Return the time from the first line's opening to the last one's closing."""
        return Shutter(self.opens, self.closes + self.readout)

    def seconds(self) -> float:
        """Return the exposure time (s) of a line: the integral of its transmission."""
        return self.transmitted(self.opens, self.closes)

    def transmitted(self, begin: float, end: float) -> float:
        """Integrate the first line's transmission between two times of the scene (s)."""
        if self.profile is None:
            return max(0.0, min(end, self.closes) - max(begin, self.opens))
        points = np.array(self.profile)
        integral = np.concatenate([[0.0], np.cumsum(np.diff(points[:, 0]) * (points[1:, 1] + points[:-1, 1]) / 2.0)])
        low, high = (_integral(points, integral, time - self.opens) for time in (begin, max(begin, end)))
        return high - low

    def full(self) -> tuple[float, float]:
        """Return the times of the scene (s) at which the first line is fully open, and at which it begins to close."""
        if self.profile is None:
            return self.opens, self.closes
        most = max(transmission for _, transmission in self.profile)
        times = [time for time, transmission in self.profile if transmission == most]
        return self.opens + times[0], self.opens + times[-1]


def _integral(points: NDArray[np.float64], integral: NDArray[np.float64], time: float) -> float:
    """Integrate a piecewise linear curve (n, 2) up to a time; `integral` (n,) is that up to its points."""
    if time <= points[0, 0]:
        return 0.0
    if time >= points[-1, 0]:
        return float(integral[-1])
    number = int(np.searchsorted(points[:, 0], time, side="right")) - 1
    there = float(np.interp(time, points[:, 0], points[:, 1]))
    return float(integral[number] + (time - points[number, 0]) * (points[number, 1] + there) / 2.0)


def ensure_distinct_times(timing: Timing, length: float) -> Timing:
    """Check that a timing of lines that are open for this long (s) has distinct times in float64, and return it.

    Raises
    ------
    ValueError : it is so late in the scene that the shutter closes, or its readout ends, at the time when it begins.
    """
    ends = (("is open", length, timing.closes), ("is read out", timing.readout, timing.span().close))
    for what, seconds, end in ends:
        if seconds > 0.0 and end == timing.opens:
            raise ValueError(
                f"{what} for {seconds:g} s, too short to be told from none at a time of {timing.opens:g} s"
            )
    return timing


# ---- Packing


def pack_shutter(timing: Timing, width: int, height: int, pulses: Sequence[Pulses] = ()) -> Shutter:
    """Pack the shutter of a film of width x height pixels, and flashes that shine in its time."""
    span = timing.span()
    scan = None
    if timing.readout > 0.0:
        whole = span.close - span.open
        across = timing.direction in ("left", "right")
        scan = RollingShutter(
            delay=timing.readout / whole,
            width=(timing.closes - timing.opens) / whole,
            lines=float(width if across else height),
            across=across,
            is_reversed=timing.direction in ("up", "left"),
            whole=timing.curtain == "electronic",
        )
    packed = None
    if pulses:
        both = np.unique(np.concatenate([np.stack([item.begin, item.end], axis=1) for item in pulses]), axis=0)
        packed = Pulses(np.ascontiguousarray(both[:, 0]), np.ascontiguousarray(both[:, 1]))
    return span._replace(curve=_pack_curve(timing.profile), scan=scan, pulses=packed)


def _pack_curve(profile: Profile | None) -> TransmissionCurve | None:
    """Normalize a profile to the time of a line; None where the line is evenly open all the time."""
    if profile is None:
        return None
    points = np.array(profile)
    if points[0, 0] > 0.0:
        points = np.concatenate([[[0.0, 0.0], [points[0, 0], 0.0]], points])
    elif np.all(points[:, 1] == points[0, 1]):
        return None
    time = points[:, 0] / points[-1, 0]
    cumulative = np.concatenate([[0.0], np.cumsum(np.diff(time) * (points[1:, 1] + points[:-1, 1]) / 2.0)])
    return TransmissionCurve(time, np.ascontiguousarray(points[:, 1] / cumulative[-1]), cumulative / cumulative[-1])
