"""Equal time steps over a shutter's time, on which the times of keyframes fall."""

from collections.abc import Iterable, Sequence

import numpy as np

from raytracer.core.shutter.table import Shutter

MAX_STEPS = 129
"""The largest number of time steps that Embree takes for a moving geometry."""


_GRID_TOLERANCE = 1e-6
"""Distance from a step, in segments, at which the time of a keyframe still counts as on it.

Objects are then misplaced by a millionth of their displacement between two steps, as much as by Embree's own angles
(1.6e-6).
"""


def breakpoints(times: Iterable[float], shutter: Shutter) -> list[float]:
    """List the shutter's opening and closing, and the given times between: motion is smooth between two of these."""
    inner = [time for time in times if shutter.open < time < shutter.close]
    return [shutter.open, *inner, *([shutter.close] if shutter.close > shutter.open else [])]


def uniform_grid(times: Iterable[float], shutter: Shutter) -> list[float]:
    """Divide the time from the shutter's opening to its closing into equal steps on which the times between fall.

    At most 129, of which times may then lie beside; one for a shutter that is open for no time.
    """
    points = breakpoints(times, shutter)
    return grid(points, uniform_segments(points)) if len(points) > 1 else points


def uniform_segments(times: Sequence[float]) -> int:
    """Find the least number of equal segments of [times[0], times[-1]] that end at each of the sorted times.

    At most 128; that many if there is no such number.
    """
    fractions = (np.asarray(times) - times[0]) / (times[-1] - times[0])
    for segments in range(1, MAX_STEPS):
        steps = segments * fractions
        if np.abs(steps - np.round(steps)).max() <= _GRID_TOLERANCE:
            return segments
    return MAX_STEPS - 1


def grid(times: Sequence[float], segments: int) -> list[float]:
    """Make equal steps from the first time to the last; steps on one of the times have its bits."""
    grid = np.linspace(times[0], times[-1], segments + 1)
    width = (times[-1] - times[0]) / segments
    for time in times:
        nearest = int(np.argmin(np.abs(grid - time)))
        if abs(grid[nearest] - time) <= _GRID_TOLERANCE * width:
            grid[nearest] = time
    return [float(time) for time in grid]
