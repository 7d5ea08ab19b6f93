"""F-numbers of a lens and radii of its stop, by rays through the glass.

The f-number is the focal length over twice the height at which the ray that grazes the stop comes in, parallel to the
axis: that of the light which a lens gathers, also where its glass bends the outer rays by more than the inner ones.

References: Smith 2008, "Modern Optical Engineering", 4th ed., sec. 9.6.
"""

import math

import numpy as np
from numpy.typing import NDArray

from raytracer.optics.lens_system.first_order import cardinal_points, entrance_pupil
from raytracer.optics.lens_system.lens import Lens
from raytracer.optics.lens_system.ray_tracing import trace_rays
from raytracer.optics.lens_system.surfaces import LensSurfaces, slice_surfaces

_RAYS = 1025
_ROUNDS = 5


def _start(lens: LensSurfaces, heights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Place points on rays of light parallel to the axis, at these heights along y."""
    return np.stack([0.0 * heights, heights, np.full(len(heights), lens.vertex[0])], axis=1)


def _max_passing_height(lens: LensSurfaces) -> float:
    """Find the greatest height (mm) up to which all light parallel to the axis gets through.

    Raises
    ------
    ValueError : not even light near the axis does.
    """
    pupil = entrance_pupil(lens).radius
    low, high = 0.0, 2.0 * min(pupil, float(lens.radius.max()))
    # Each round leaves a thousandth of the interval, and five leave less than the spacing of float64 numbers.
    for _ in range(_ROUNDS):
        heights = np.linspace(low, high, _RAYS)
        weights, _, _ = trace_rays(lens, _start(lens, heights), (0.0, 0.0, 1.0))
        blocked = np.flatnonzero(weights == 0.0)
        if not len(blocked):
            return high
        if blocked[0] == 0:
            break
        low, high = float(heights[blocked[0] - 1]), float(heights[blocked[0]])
    if low == 0.0:
        raise ValueError("no light that comes in along the axis gets through the lens")
    return low


def _focal_length(lens: LensSurfaces) -> float:
    """Compute the absolute focal length (mm)."""
    return abs(cardinal_points(lens).focal_length)


def f_number_of(lens: LensSurfaces) -> float:
    """Compute the f-number of a lens as it is packed.

    Raises
    ------
    ValueError : it has no focal length, or no light gets through.
    """
    return _focal_length(lens) / (2.0 * _max_passing_height(lens))


def widest_f_number(lens: Lens) -> float:
    """Compute the f-number of a lens with its stop wide open; see `f_number_of`."""
    return f_number_of(lens.packed())


def stop_radius_for(lens: Lens, f_number: float) -> float:
    """Find the radius (mm) to which the stop closes for an f-number.

    Raises
    ------
    ValueError : the lens does not open so far, or has no focal length.
    """
    packed = lens.packed()
    length, widest = _focal_length(packed), _max_passing_height(packed)
    opens_to = length / (2.0 * widest)
    if not opens_to <= f_number < math.inf:
        raise ValueError(f"the lens opens to f/{opens_to:.4g}, and cannot be set to f/{f_number:g}")
    # At the smallest f-number itself rounding could leave a height beyond the rim.
    return _height_at_stop(packed, min(length / (2.0 * f_number), widest))


def _height_at_stop(lens: LensSurfaces, height: float) -> float:
    """Trace a ray that comes in parallel to the axis, at a height, to the stop: its height there (mm), rim at most."""
    _, points, _ = trace_rays(slice_surfaces(lens, 0, lens.stop + 1), _start(lens, np.array([height])), (0.0, 0.0, 1.0))
    return min(float(abs(points[0, 1])), float(lens.radius[lens.stop]))


def filled_stop_fraction(lens: LensSurfaces) -> float:
    """Measure the part of the stop's diameter that light parallel to the axis fills: 1 unless rims cut it.

    Raises
    ------
    ValueError : no light gets through.
    """
    return _height_at_stop(lens, _max_passing_height(lens)) / float(lens.radius[lens.stop])
