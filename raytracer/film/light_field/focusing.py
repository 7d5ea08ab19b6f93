"""Focus of a light field: planes and ranges, and conversions of alpha, slope and f-number.

References: Ng 2005, "Fourier Slice Photography", sec. 3 (alpha); Isaksen, McMillan, Gortler 2000, "Dynamically
Reparameterized Light Fields", sec. 3; Chai et al. 2000, "Plenoptic Sampling" (one pixel between neighbouring views).
"""

import math
from typing import NamedTuple

import numpy as np

from raytracer.film.light_field.views import Views
from raytracer.schema.units import METRES_PER_MILLIMETRE


class ViewSpacing(NamedTuple):
    """Distance (m) from a view to the next in its row, and from a row to the next; 0 if there is only one."""

    right: float
    up: float


class FocusPlane(NamedTuple):
    """A plane of focus: one over its distance along the axis (1/m), by tangents.

    At the tangents x and y it is middle + right x + up y: a plane in space is one in inverse distance too.
    """

    middle: float
    right: float = 0.0
    up: float = 0.0


def view_spacing(views: Views) -> ViewSpacing:
    """Compute the median distance of neighbouring views."""
    across = np.linalg.norm(np.diff(views.position, axis=1), axis=-1)
    down = np.linalg.norm(np.diff(views.position, axis=0), axis=-1)
    return ViewSpacing(*(float(np.median(steps)) if steps.size else 0.0 for steps in (across, down)))


def refocusable(views: Views) -> tuple[float, float]:
    """Compute the nearest and the farthest distance (m) of points that move by at most a pixel from view to view.

    In this range a refocused picture has no copies of an edge side by side; beyond it they are a pixel or more apart.
    The farthest is inf if there is no limit, and so are both if there is only one view.
    """
    step = max(view_spacing(views))
    if step == 0.0:
        return math.inf, math.inf
    reach = views.plane.pixel / step
    near, far = views.inverse_focus + reach, views.inverse_focus - reach
    return 1.0 / near if near > 0.0 else math.inf, 1.0 / far if far > 0.0 else math.inf


def alpha_to_inverse_distance(views: Views, alpha: float) -> float:
    """Convert alpha to one over the distance (1/m) in focus with the film `alpha` times as far from the lens.

    Behind a lens that is the film of the picture as it was taken, 1 / f = 1 / z_i + 1 / z_o.  For an array of cameras,
    which has none, `alpha` multiplies the distance of the plane of focus.

    Raises ValueError: alpha is not above 0, or there is no such plane.
    """
    if not 0.0 < alpha < math.inf:
        raise ValueError(f"alpha must be greater than 0 and finite, got {alpha:g}")
    if views.focal_length is None:
        if views.inverse_focus == 0.0:
            raise ValueError("alpha has no meaning for parallel views without a focal length: give a distance")
        return views.inverse_focus / alpha
    power = 1.0 / (METRES_PER_MILLIMETRE * views.focal_length)
    inverse = power - (power - views.inverse_focus) / alpha
    if inverse < 0.0:
        least = 1.0 - views.inverse_focus / power
        raise ValueError(f"alpha {alpha:g} focuses beyond infinity: the least is {least:.6g}")
    return inverse


def slope_to_inverse_distance(views: Views, slope: float) -> float:
    """Convert a slope to one over the distance (1/m) of points that move against the views by `slope` pixels from each.

    Raises ValueError: there is only one view, or the slope is not finite.
    """
    step = max(view_spacing(views))
    if step == 0.0:
        raise ValueError("a slope is from view to view, and there is but one")
    if not math.isfinite(slope):
        raise ValueError(f"a slope must be finite, got {slope:g}")
    return views.inverse_focus + slope * views.plane.pixel / step


def aperture_diameter(views: Views, f_number: float) -> float:
    """Compute the diameter (m) of an f-number; a ValueError says that there is no focal length, or no such opening."""
    if views.focal_length is None:
        raise ValueError("an f-number needs the focal length of a lens, which these views do not have: give aperture")
    if not 0.0 < f_number < math.inf:
        raise ValueError(f"an f-number must be greater than 0 and finite, got {f_number:g}")
    return METRES_PER_MILLIMETRE * views.focal_length / f_number
