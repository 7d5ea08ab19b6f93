"""Pack the timing of an exposure for kernels."""

from collections.abc import Sequence

import numpy as np

from raytracer.core.shutter.table import Pulses, RollingShutter, Shutter, TransmissionCurve
from raytracer.core.shutter.timing import Profile, Timing


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
