"""Where the film must be for a plane of the scene to be sharp, by rays through the glass."""

import math

import numpy as np

from raytracer.lenses.first_order import heights
from raytracer.lenses.surfaces import LensSurfaces, trace_ray

# The ray that decides where an image is sharp goes through the pupil here: half of the pupil's area lies within.
# Kingslake, Johnson 2010, ch. 6, on the 0.7 zone; a blocked ray is followed by one of half the height.
_ZONE = math.sqrt(0.5)
_MOST_HALVINGS = 16


def _image(lens: LensSurfaces, distance: float, towards_film: bool) -> float:
    """How far behind the last surface on its way (mm) the light of a point of the axis meets the axis again.

    distance : of the point before the first surface on the way (mm), may be infinite.  The result is infinite where the
    light leaves as a parallel beam, and negative where it spreads.

    Raises
    ------
    ValueError : none of the light gets through.
    """
    height, slope = (1.0, 0.0) if math.isinf(distance) else (distance, 1.0)
    reached = np.abs(heights(lens, height, slope, towards_film))
    radius = np.asarray(lens.radius if towards_film else lens.radius[::-1])
    with np.errstate(divide="ignore"):
        marginal = float((radius / reached).min())
    ends = (float(lens.vertex[0]), float(lens.vertex[-1]))
    first, last = ends if towards_film else ends[::-1]
    side = 1.0 if towards_film else -1.0
    for halving in range(_MOST_HALVINGS):
        part = _ZONE * marginal / 2.0**halving
        length = math.hypot(1.0, part * slope)
        start = (0.0, part, first) if math.isinf(distance) else (0.0, 0.0, first - side * distance)
        weight, point, direction = trace_ray(lens, start, (0.0, part * slope / length, side / length), towards_film)
        if weight > 0.0:
            behind = side * (point[2] - last)
            return math.inf if direction[1] == 0.0 else behind - point[1] * side * direction[2] / direction[1]
    raise ValueError(f"no light of a point {distance:g} mm before the lens gets through it")


def nearest_focus(lens: LensSurfaces, travel: float) -> float:
    """Distance (mm) before the front vertex of the nearest plane that is sharp on a film this far behind the last one.

    Raises
    ------
    ValueError : so near behind the lens nothing is sharp.
    """
    distance = _image(lens, travel, towards_film=False)
    if distance <= 0.0:
        raise ValueError(
            f"nothing is sharp {travel:g} mm behind the lens: infinity is {_image(lens, math.inf, True):g} mm behind it"
        )
    return distance


def focus(lens: LensSurfaces, distance: float, travel: float) -> float:
    """How far behind the last vertex (mm) the film must be for a plane at a distance before the front one to be sharp.

    What is sharp is decided by light through the zone of the pupil that halves its area.  The ray is followed from the
    plane to the film, so nothing is searched for, however small the aperture or near the plane.

    Parameters
    ----------
    distance : of the plane (mm), greater than 0, may be infinite.
    travel : how far behind the last vertex the film can be (mm).

    Raises
    ------
    ValueError : the plane is nearer than the lens can focus; it names the nearest one that is possible.
    """
    nearest = nearest_focus(lens, travel)
    if not distance >= nearest:
        raise ValueError(
            f"the lens cannot focus at {distance:g} mm: the nearest plane that is sharp with the film {travel:g} mm "
            f"behind the lens is {nearest:g} mm before it"
        )
    return _image(lens, distance, towards_film=True)
